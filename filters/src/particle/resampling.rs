use core::hint;

use rand::{Rng, RngExt};

use super::white::{CHUNK, Draws};
use crate::{
    count::number,
    vectorised::{self, Kernel},
};

/// How a particle filter draws the ancestors of its next generation. Each scheme draws a particle
/// of weight w n w times on average.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Resampling {
    /// One draw, then equal strides (Kitagawa 1996): a particle comes ⌊n w⌋ or ⌈n w⌉ times, and
    /// little noise is added.
    #[default]
    Systematic,
    /// Independent draws (Gordon, Salmond & Smith 1993): what most theorems are about.
    Multinomial,
    /// One draw in each of n strides (Kitagawa 1996): less noise than independent draws, and
    /// without what equal strides may have in common with the weights.
    Stratified,
    /// ⌊n w⌋ copies of each, and independent draws for what is left (Liu & Chen 1998).
    Residual,
}

impl Resampling {
    /// Fills `ancestors` with indices into `weights`, which sum to 1; those of weight 0 are never
    /// drawn. There is room in each of
    /// `scratch` for as many numbers.
    pub(super) fn draw(
        self,
        weights: &[f64],
        rng: &mut impl Rng,
        scratch: [&mut [f64]; 2],
        ancestors: &mut [u32],
    ) {
        match self {
            Self::Systematic => {
                let start = rng.random();
                vectorised::run(Systematic { weights, start, ancestors });
            }
            Self::Multinomial => {
                let key = rng.next_u64();
                vectorised::run(Multinomial { weights, key, scratch, ancestors });
            }
            Self::Stratified => stratified(weights, rng, ancestors),
            Self::Residual => residual(weights, rng, scratch, ancestors),
        }
    }
}

struct Systematic<'a> {
    weights: &'a [f64],
    start: f64,
    ancestors: &'a mut [u32],
}

impl Kernel for Systematic<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let strides = number(self.ancestors.len());
        copies(self.weights, self.ancestors, |reach| {
            let before = (reach * strides - self.start).max(0.0);
            let nearest = nearest(before);
            nearest + usize::from(number(nearest) < before)
        });
    }
}

struct Multinomial<'a> {
    weights: &'a [f64],
    key: u64,
    scratch: [&'a mut [f64]; 2],
    ancestors: &'a mut [u32],
}

impl Kernel for Multinomial<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { weights, key, scratch: [marks, begins], ancestors } = self;
        let count = ancestors.len();
        let (marks, begins) = (&mut marks[..count], &mut begins[..count]);
        let total = Ascending { key, marks: &mut *marks }.run();
        // As many bins as marks: how many marks lie in the bins before each, as the bits of a
        // number.
        let bins = number(count) / total;
        begins.fill(0.0);
        for (i, mark) in marks.iter().enumerate() {
            if let Some(begin) = begins.get_mut(nearest(mark * bins) + 1) {
                *begin = f64::from_bits(i as u64 + 1);
            }
        }
        let mut before = 0;
        for begin in &mut *begins {
            before = larger(before, begin.to_bits());
            *begin = f64::from_bits(before);
        }
        copies(weights, ancestors, |reach| {
            let reach = reach * total;
            let mut first = index_of(begins[nearest(reach * bins).min(count - 1)]);
            // A bin holds one mark on average and seldom more than four.
            while let Some(near) = marks.get(first..).and_then(<[f64]>::first_chunk::<4>) {
                // The sign of a difference: of positive numbers the bits are ordered alike.
                let below = |mark: &f64| mark.to_bits().wrapping_sub(reach.to_bits()) >> 63;
                let below: u64 = near.iter().map(below).sum();
                first += index_of(f64::from_bits(below));
                if below < 4 {
                    return first;
                }
            }
            first + marks[first..].iter().take_while(|mark| **mark < reach).count()
        });
    }
}

/// Writes each particle where its copies begin, which `begin` makes of the sum of the weights
/// before it, over one that has none; the largest so far is then the ancestor. There is no branch
/// to be predicted.
#[inline(always)]
fn copies(weights: &[f64], ancestors: &mut [u32], begin: impl Fn(f64) -> usize) {
    let last = weights.iter().rposition(|w| *w > 0.0).unwrap_or(0);
    ancestors.fill(0);
    let mut reach = 0.0;
    for (i, weight) in weights[..=last].iter().enumerate() {
        if let Some(ancestor) = ancestors.get_mut(begin(reach)) {
            *ancestor = index(i);
        }
        reach += weight;
    }
    let mut largest = 0;
    for ancestor in ancestors {
        largest = larger(largest, *ancestor);
        *ancestor = largest;
    }
}

/// The larger one, by no branch: nothing could predict it.
#[inline(always)]
fn larger<T: Copy + PartialOrd>(a: T, b: T) -> T {
    hint::select_unpredictable(b > a, b, a)
}

fn stratified(weights: &[f64], rng: &mut impl Rng, ancestors: &mut [u32]) {
    let count = number(ancestors.len());
    let mut walk = Walk::over(weights, |weight| weight);
    for (i, ancestor) in ancestors.iter_mut().enumerate() {
        *ancestor = walk.to((number(i) + rng.random::<f64>()) / count);
    }
}

/// Independent uniform numbers in ascending order, but for a factor that it returns.
///
/// Without sorting: the sums of k of n + 1 exponential numbers over that of all of them are
/// distributed so (Devroye 1986, §V.2.2).
struct Ascending<'a> {
    key: u64,
    marks: &'a mut [f64],
}

impl Kernel for Ascending<'_> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let (mut draws, mut sum) = (Draws::new(self.key), 0.0);
        for (chunk, marks) in self.marks.chunks_mut(CHUNK).enumerate() {
            draws.fill_exponential(chunk, marks);
            for mark in marks {
                sum += *mark;
                *mark = sum;
            }
        }
        let (mut last, blocks) = ([0.0], self.marks.len().div_ceil(CHUNK));
        draws.fill_exponential(blocks, &mut last);
        sum + last[0]
    }
}

fn residual(
    weights: &[f64],
    rng: &mut impl Rng,
    [marks, _]: [&mut [f64]; 2],
    ancestors: &mut [u32],
) {
    let all = number(ancestors.len());
    // A share that rounding left just below a whole copy is one.
    let copies = |weight: f64| libm::floor(weight * all * (1.0 + 4.0 * f64::EPSILON));
    let rest = |weight: f64| (weight * all - copies(weight)).max(0.0);
    let (mut whole, mut broken) = (0, 0.0);
    for weight in weights {
        whole += floor(copies(*weight));
        broken += rest(*weight);
    }
    let whole = whole.min(ancestors.len());

    // The draws, in order, go to the end of `ancestors`, and are merged from there.
    let marks = &mut marks[whole..ancestors.len()];
    let total = vectorised::run(Ascending { key: rng.next_u64(), marks: &mut *marks });
    let mut walk = Walk::over(weights, |weight| rest(weight) / broken * total);
    for (ancestor, mark) in ancestors[whole..].iter_mut().zip(marks) {
        *ancestor = walk.to(*mark);
    }
    let (mut write, mut read) = (0, whole);
    for (i, weight) in weights.iter().enumerate() {
        for _ in 0..floor(copies(*weight)) {
            if write < read {
                ancestors[write] = index(i);
                write += 1;
            }
        }
        while read < ancestors.len() && ancestors[read] == index(i) {
            ancestors[write] = index(i);
            write += 1;
            read += 1;
        }
    }
}

/// The whole part of a number that is no larger than a cloud; 0 of a negative one.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a share of a count, rounded down"
)]
fn floor(share: f64) -> usize {
    share as usize
}

/// The whole number nearest to one that is not negative, and below 2³².
#[inline(always)]
fn nearest(share: f64) -> usize {
    // The sum has no room for a fraction: two instructions, where a cast is a dozen.
    const WHOLE: f64 = 4_503_599_627_370_496.0;
    index_of(f64::from_bits((share + WHOLE).to_bits() & 0xffff_ffff))
}

/// The index whose bits a number holds.
#[expect(clippy::cast_possible_truncation, reason = "what is stored is below 2³²")]
fn index_of(bits: f64) -> usize {
    bits.to_bits() as usize
}

/// The index of a particle: there are fewer than 2³².
#[expect(clippy::cast_possible_truncation, reason = "checked where a cloud is made")]
fn index(particle: usize) -> u32 {
    particle as u32
}

/// A walk up the cumulative sum of what `share` makes of weights.
struct Walk<'a, S> {
    weights: &'a [f64],
    share: S,
    at: usize,
    reach: f64,
    /// The last particle that can be drawn: the sum may round to less than 1.
    last: usize,
}

impl<'a, S: Fn(f64) -> f64> Walk<'a, S> {
    fn over(weights: &'a [f64], share: S) -> Self {
        let last = weights.iter().rposition(|w| share(*w) > 0.0).unwrap_or(0);
        let reach = weights.first().copied().map_or(0.0, &share);
        Self { weights, share, at: 0, reach, last }
    }

    /// The particle whose share holds `mark`; marks ascend.
    fn to(&mut self, mark: f64) -> u32 {
        while self.reach <= mark && self.at < self.last {
            self.at += 1;
            self.reach += (self.share)(self.weights[self.at]);
        }
        index(self.at)
    }
}

#[cfg(test)]
mod tests {
    use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

    use super::*;

    const WEIGHTS: [f64; 6] = [0.0, 0.05, 0.4, 0.3, 0.25, 0.0];

    /// How often each particle is drawn, on average over 20 000 draws from seed 1; `each` sees
    /// the counts of one.
    fn mean_counts(scheme: Resampling, mut each: impl FnMut(&[u32; 6])) -> [f64; 6] {
        const DRAWS: u32 = 20_000;
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
        let mut totals = [0.0; 6];
        for _ in 0..DRAWS {
            let mut ancestors = [u32::MAX; 6];
            scheme.draw(&WEIGHTS, &mut rng, [&mut [0.0; 6], &mut [0.0; 6]], &mut ancestors);
            assert!(ancestors.is_sorted());
            let mut counts = [0; 6];
            for ancestor in ancestors {
                counts[ancestor as usize] += 1;
            }
            each(&counts);
            for (total, count) in totals.iter_mut().zip(counts) {
                *total += f64::from(count) / f64::from(DRAWS);
            }
        }
        totals
    }

    #[test]
    fn systematic_is_even_and_unbiased() {
        let means = mean_counts(Resampling::Systematic, |counts| {
            for (weight, count) in WEIGHTS.iter().zip(counts) {
                assert!((f64::from(*count) - 6.0 * weight).abs() < 1.0, "{count} of {weight}");
            }
        });
        for (weight, mean) in WEIGHTS.iter().zip(means) {
            // Beyond its floor a count is Bernoulli: σ ≤ 0.5 / √20 000; five of them, so a false
            // alarm comes once in 3 million runs.
            assert!((mean - 6.0 * weight).abs() < 5.0 * 0.5 / libm::sqrt(20_000.0), "{mean}");
        }
    }

    #[test]
    fn multinomial_counts_are_binomial() {
        let mut squares = [0.0; 6];
        let means = mean_counts(Resampling::Multinomial, |counts| {
            for (square, (weight, count)) in squares.iter_mut().zip(WEIGHTS.iter().zip(counts)) {
                let off = f64::from(*count) - 6.0 * weight;
                *square += off * off / 20_000.0;
            }
        });
        for ((weight, mean), square) in WEIGHTS.iter().zip(means).zip(squares) {
            let variance = 6.0 * weight * (1.0 - weight);
            let band = 5.0 * libm::sqrt(variance / 20_000.0);
            assert!((mean - 6.0 * weight).abs() <= band, "{mean} of {weight}");
            // The variance of a squared deviation is at most 3 of its square here, by the
            // binomial's kurtosis 3 + (1 − 6 w (1 − w)) / variance.
            let kurtosis = 3.0 + (1.0 - 6.0 * weight * (1.0 - weight)) / variance.max(1e-9);
            let band = 5.0 * variance * libm::sqrt((kurtosis - 1.0) / 20_000.0);
            assert!((square - variance).abs() <= band, "variance {square}, not {variance}");
        }
    }

    #[test]
    fn residual_gives_whole_shares_whole() {
        // Six times the weights: 0.3, 2.4, 1.8 and 1.5; the whole copies are certain, and 2 draws
        // are left for the rest.
        let means = mean_counts(Resampling::Residual, |counts| {
            assert!(counts[2] >= 2 && counts[3] >= 1 && counts[4] >= 1, "{counts:?}");
            assert!(counts[0] == 0 && counts[5] == 0, "{counts:?}");
        });
        for (weight, mean) in WEIGHTS.iter().zip(means) {
            // Two draws of at most ½: a variance of ½; five σ of the mean of 20 000.
            assert!((mean - 6.0 * weight).abs() < 5.0 * libm::sqrt(0.5 / 20_000.0), "{mean}");
        }
        // Even weights are all copied once.
        let mut ancestors = [u32::MAX; 10];
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(2);
        Resampling::Residual.draw(
            &[0.1; 10],
            &mut rng,
            [&mut [0.0; 10], &mut [0.0; 10]],
            &mut ancestors,
        );
        assert_eq!(ancestors, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9]);
    }

    #[test]
    fn stratified_is_unbiased_within_a_stride() {
        let means = mean_counts(Resampling::Stratified, |counts| {
            for (weight, count) in WEIGHTS.iter().zip(counts) {
                assert!((f64::from(*count) - 6.0 * weight).abs() < 2.0, "{count} of {weight}");
            }
        });
        for (weight, mean) in WEIGHTS.iter().zip(means) {
            // A draw in each of two strides may or may not fall to a particle: a variance of ½.
            assert!((mean - 6.0 * weight).abs() < 5.0 * libm::sqrt(0.5 / 20_000.0), "{mean}");
        }
    }
}
