use serde::Serialize;
use statrs::{
    distribution::{ContinuousCDF, Normal, StudentsT},
    statistics::Statistics,
};

/// The comparison of the errors of two ways to do the same thing, run by run.
///
/// The ratio of two errors of one run, and not their difference: errors are skewed, and their
/// logarithms nearly Gaussian.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Paired {
    /// The number of runs that have both.
    pub pairs: usize,
    /// The geometric mean of the first one's error over the second's.
    pub ratio: f64,
    /// The 95 % interval of the true ratio, by Student's t on the logarithms.
    pub ratio_interval: [f64; 2],
    /// The probability of a ratio as far from 1 were there no difference, by the same test on both
    /// sides.
    pub p_value: f64,
}

impl Paired {
    /// The comparison of pairs of positive errors; `None` for less than two, or where their
    /// ratios are all the same.
    #[must_use]
    pub fn of(pairs: impl IntoIterator<Item = (f64, f64)>) -> Option<Self> {
        let logs: Vec<f64> = pairs
            .into_iter()
            .map(|(first, second)| (first / second).ln())
            .filter(|log| log.is_finite())
            .collect();
        let pairs = logs.len();
        #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^52 runs")]
        let count = pairs as f64;
        let mean = (&logs).mean();
        let error = (&logs).std_dev() / count.sqrt();
        if !(error > 0.0 && error.is_finite()) {
            return None;
        }
        let student = StudentsT::new(0.0, 1.0, count - 1.0).ok()?;
        let reach = student.inverse_cdf(0.975) * error;
        Some(Self {
            pairs,
            ratio: mean.exp(),
            ratio_interval: [(mean - reach).exp(), (mean + reach).exp()],
            p_value: 2.0 * student.cdf(-(mean / error).abs()),
        })
    }
}

/// The difference of two figures run by run, in their own unit.
///
/// Student's t goes by the mean of the differences and is that of nearly Gaussian ones; the
/// signed-rank test needs less of them: that they are as often above 0 as below, and as far.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PairedDifference {
    /// The number of runs that have both.
    pub pairs: usize,
    /// The mean of the first minus the second.
    pub mean: f64,
    /// The 95 % interval of the true mean, by Student's t.
    pub mean_interval: [f64; 2],
    /// The probability of a mean as far from 0 were there no difference, by Student's t on both
    /// sides; absent where all differences are the same.
    pub t_p_value: Option<f64>,
    /// The probability of rank sums as unequal were there no difference (Wilcoxon 1945), on both
    /// sides: exact for up to 50 differences without ties, else by the normal approximation with
    /// corrections for ties and continuity; absent where all differences are 0.
    pub signed_rank_p_value: Option<f64>,
}

impl PairedDifference {
    /// The comparison of pairs; pairs without a finite difference are left out. `None` for less
    /// than two.
    #[must_use]
    pub fn of(pairs: impl IntoIterator<Item = (f64, f64)>) -> Option<Self> {
        let mut differences: Vec<f64> = pairs
            .into_iter()
            .map(|(first, second)| first - second)
            .filter(|difference| difference.is_finite())
            .collect();
        let pairs = differences.len();
        #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^52 runs")]
        let count = pairs as f64;
        let student = StudentsT::new(0.0, 1.0, count - 1.0).ok()?;
        let mean = (&differences).mean();
        let error = (&differences).std_dev() / count.sqrt();
        let reach = student.inverse_cdf(0.975) * error;
        Some(Self {
            pairs,
            mean,
            mean_interval: [mean - reach, mean + reach],
            t_p_value: (error > 0.0).then(|| 2.0 * student.cdf(-(mean / error).abs())),
            signed_rank_p_value: signed_rank(&mut differences),
        })
    }
}

/// Up to this number of differences without ties the distribution of their rank sum is counted.
const EXACT_RANKS: usize = 50;

/// Wilcoxon's test of signed ranks on both sides; differences of 0 are left out (Wilcoxon 1945).
fn signed_rank(differences: &mut Vec<f64>) -> Option<f64> {
    differences.retain(|difference| difference.abs() > 0.0);
    differences.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
    if differences.is_empty() {
        return None;
    }
    #[expect(clippy::cast_precision_loss, reason = "far fewer than 2^52 runs")]
    let number = |count: usize| count as f64;
    let mut above = 0.0_f64;
    let mut below = 0.0_f64;
    let mut ties = 0.0;
    let mut before = 0;
    for equal in differences.chunk_by(|a, b| a.abs().total_cmp(&b.abs()).is_eq()) {
        let size = number(equal.len());
        // All of them have the mean of their ranks.
        let rank = number(before) + 0.5 * (size + 1.0);
        for difference in equal {
            *(if *difference > 0.0 { &mut above } else { &mut below }) += rank;
        }
        ties += size * size * size - size;
        before += equal.len();
    }
    let least = above.min(below);
    let count = number(before);
    if before <= EXACT_RANKS && ties.total_cmp(&0.0).is_eq() {
        return Some(exact_tail(before, least));
    }
    let mean = count * (count + 1.0) / 4.0;
    let variance = mean * (2.0 * count + 1.0) / 6.0 - ties / 48.0;
    let z = (least - mean + 0.5).min(0.0) / variance.sqrt();
    Some((2.0 * Normal::standard().cdf(z)).min(1.0))
}

/// Twice the share of all signs of the ranks 1 … `count` with a sum of at most `least`.
fn exact_tail(count: usize, least: f64) -> f64 {
    let most = count * (count + 1) / 2;
    let mut shares = vec![0.0_f64; most + 1];
    shares[0] = 1.0;
    for rank in 1..=count {
        for sum in (0..=most).rev() {
            let with = if sum >= rank { shares[sum - rank] } else { 0.0 };
            shares[sum] = 0.5 * (shares[sum] + with);
        }
    }
    let sums = (0_u32..).map(f64::from);
    let tail = shares.iter().zip(sums).filter(|(_, sum)| *sum <= least);
    (2.0 * tail.map(|(share, _)| share).sum::<f64>()).min(1.0)
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;

    #[test]
    fn the_textbook_numbers() {
        // Logarithms of the ratios: 0.1, 0.3, 0.2, 0.4; mean 0.25, s.d. 0.1291, t = 3.873 with
        // 3 degrees of freedom, for which p = 0.0305 and the quantile of 97.5 % is 3.1824.
        let pairs = [0.1_f64, 0.3, 0.2, 0.4].map(|log| (5.0 * log.exp(), 5.0));
        let reported = Paired::of(pairs).expect("four pairs");
        assert_eq!(reported.pairs, 4);
        assert_relative_eq!(reported.ratio, 0.25_f64.exp(), epsilon = 1e-12);
        assert_relative_eq!(reported.p_value, 0.0305, epsilon = 1e-4);
        let reach = 3.1824 * 0.129_099 / 2.0;
        assert_relative_eq!(reported.ratio_interval[0].ln(), 0.25 - reach, epsilon = 1e-4);
        assert_relative_eq!(reported.ratio_interval[1].ln(), 0.25 + reach, epsilon = 1e-4);
        let turned = Paired::of(pairs.map(|(a, b)| (b, a))).expect("four pairs");
        assert_relative_eq!(turned.ratio * reported.ratio, 1.0, epsilon = 1e-12);
        assert_relative_eq!(turned.p_value, reported.p_value, epsilon = 1e-12);
    }

    #[test]
    fn nothing_to_compare_is_no_comparison() {
        assert_eq!(Paired::of([]), None);
        assert_eq!(Paired::of([(1.0, 2.0)]), None);
        assert_eq!(Paired::of([(1.0, 2.0), (2.0, 4.0)]), None);
        assert_eq!(Paired::of([(0.0, 2.0), (2.0, f64::NAN), (1.0, 3.0)]), None);
    }

    /// Darwin's maize as Fisher (1935, ch. 3) has it, cross minus self in eighths of an inch:
    /// t = 2.148 with 14 degrees of freedom, p = 0.0497.
    #[test]
    fn differences_of_the_textbook() {
        let maize = [49., -67., 8., 16., 6., 23., 28., 41., 14., 29., 56., 24., 75., 60., -48.];
        let found = PairedDifference::of(maize.map(|d: f64| (d + 3.0, 3.0))).expect("fifteen");
        assert_relative_eq!(found.mean, 314.0 / 15.0, epsilon = 1e-12);
        assert_relative_eq!(found.t_p_value.expect("they vary"), 0.0497, epsilon = 1e-4);
        // 2.1448 standard errors of 9.746 to each side.
        assert_relative_eq!(found.mean_interval[0], 0.03, epsilon = 0.01);
        assert_relative_eq!(found.mean_interval[1], 41.84, epsilon = 0.01);
        // The two below 0 have the ranks 10 and 14; all 2^15 signs are counted below.
        let ranks = found.signed_rank_p_value.expect("they are not 0");
        assert_relative_eq!(ranks, by_hand(&maize), epsilon = 1e-12);
        assert!((0.03..0.06).contains(&ranks), "{ranks}");
    }

    /// The share of all signs whose lesser rank sum is at most that of the differences.
    fn by_hand(differences: &[f64]) -> f64 {
        let mut sizes: Vec<f64> = differences.to_vec();
        sizes.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        let count = u32::try_from(sizes.len()).expect("a few");
        let least = |below: &dyn Fn(u32) -> bool| {
            let sum: u32 = (0..count).filter(|i| below(*i)).map(|i| i + 1).sum();
            sum.min(count * (count + 1) / 2 - sum)
        };
        let own = least(&|i| sizes[i as usize] < 0.0);
        let as_small = (0..1_u32 << count).filter(|signs| least(&|i| signs >> i & 1 == 1) <= own);
        f64::from(u32::try_from(as_small.count()).expect("a few")) / f64::from(1_u32 << count)
    }

    /// A count and the normal approximation, which a tie needs, agree for 48 differences; more
    /// of them show more.
    #[test]
    fn many_ranks_are_as_a_count_has_them() {
        let alternating = |count: i32| -> Vec<f64> {
            (1..=count).map(|i| f64::from(if i % 3 == 0 { -i } else { i })).collect()
        };
        let approximate = |differences: &[f64]| {
            // A tie of two in the middle, which moves no sum by much, ends the exact count.
            let mut tied = differences.to_vec();
            tied[20] = tied[19].abs() * tied[20].signum();
            signed_rank(&mut tied).expect("they are not 0")
        };
        let many = alternating(48);
        let exact = signed_rank(&mut many.clone()).expect("they are not 0");
        assert_relative_eq!(exact, approximate(&many), max_relative = 0.05);
        assert!(exact < 0.1, "{exact}");
        let more = signed_rank(&mut alternating(90)).expect("they are not 0");
        assert!(more < exact, "{more}, {exact}");
        // As many above as below: nothing to see.
        let even: Vec<f64> = (1..=80).map(|i| f64::from(if i % 4 < 2 { -i } else { i })).collect();
        assert!(signed_rank(&mut even.clone()).expect("they are not 0") > 0.5);
    }

    #[test]
    fn no_difference_is_no_p_value() {
        assert_eq!(PairedDifference::of([(1.0, 2.0)]), None);
        let same = PairedDifference::of([(1.0, 1.0), (2.0, 2.0)]).expect("two");
        assert_eq!((same.t_p_value, same.signed_rank_p_value), (None, None));
        let left_out = [(1.0, f64::INFINITY), (f64::NAN, 2.0), (3.0, 1.0), (2.0, 1.0)];
        assert_eq!(PairedDifference::of(left_out).expect("two").pairs, 2);
    }
}
