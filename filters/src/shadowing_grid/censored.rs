use alloc::vec::Vec;
use core::f64::consts::TAU;

use foxhunt_core::{Pose, noise::log_normal_cdf};

use super::{Censoring, NEIGHBOURS, Row, ShadowedReading};
use crate::vecchia::{Correlation, Neighbours, Receivers};

/// Number of segments of one side that are weighed; of more, some stand for all beside them.
const MOST: usize = 100;

/// Correlation of two segments below which they count as independent.
const UNLIKE: f64 = 0.02;

/// The segments whose values are known to lie below or above a limit, and no more.
///
/// Each is expected where the law and the segments with a value nearest to it say, as kriging
/// does, and weighs by the number that fade like it beyond that.
#[derive(Clone, Debug)]
pub(super) struct Censored {
    receivers: Vec<Pose>,
    /// Each limit, and the sign of limit − value: 1 below, −1 above.
    limits: Vec<(f64, f64)>,
    /// The segments with a value nearest to each.
    neighbours: Neighbours<NEIGHBOURS>,
    /// For each correlation, each segment given its neighbours.
    given: Vec<Vec<Given>>,
    log_normal_cdf: LogNormalCdf,
}

/// One censored segment under one correlation, given the segments with a value near by.
#[derive(Clone, Debug)]
struct Given {
    /// Weight of each neighbour in the mean.
    weights: [f64; NEIGHBOURS],
    /// Part of the mean that the neighbours' values make.
    value: f64,
    /// Part of the mean that a unit of the intercept makes: 1 less the weights.
    ones: f64,
    /// The variance given the neighbours, in units of σ².
    variance: f64,
    /// 1 / the standard deviation with the intercept's part, in units of σ.
    scale: f64,
    /// The exponent of the probability: 1 over the number of segments that fade alike, for all
    /// segments that this one stands for.
    exponent: f64,
}

/// The explanation of the levels by which censored segments are expected.
#[derive(Clone, Copy, Debug)]
pub(super) struct Law {
    pub(super) intercept: f64,
    /// Slope and gain.
    pub(super) coefficients: [f64; 2],
    /// σ² of the values.
    pub(super) variance: f64,
}

/// ln Φ between nodes by cubics that have its values and slopes there, to 10⁻⁸: it is needed for
/// each segment under each explanation of each cell.
#[derive(Clone, Debug)]
struct LogNormalCdf {
    /// Value and slope times the distance of the nodes.
    nodes: Vec<(f64, f64)>,
}

impl LogNormalCdf {
    const FIRST: f64 = -10.0;
    const NODES_PER_ONE: f64 = 16.0;
    /// The last node is at 8, where Φ is 1 to all digits.
    const NODES: u16 = 289;

    fn new() -> Self {
        let node = |i: u16| {
            let x = Self::FIRST + f64::from(i) / Self::NODES_PER_ONE;
            let value = log_normal_cdf(x);
            let slope = libm::exp(-0.5 * x * x - 0.5 * libm::log(TAU) - value);
            (value, slope / Self::NODES_PER_ONE)
        };
        Self { nodes: (0..Self::NODES).map(node).collect() }
    }

    fn at(&self, x: f64) -> f64 {
        let way = (x - Self::FIRST) * Self::NODES_PER_ONE;
        if way.is_nan() || way < 0.0 {
            return log_normal_cdf(x);
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "not negative, and beyond all nodes where it is cut off"
        )]
        let node = way as usize;
        let Some([(from, leaves), (to, arrives)]) = self.nodes.get(node..node.saturating_add(2))
        else {
            return 0.0;
        };
        let t = way - libm::floor(way);
        let rise = to - from;
        from + t * (rise + (1.0 - t) * ((1.0 - t) * (leaves - rise) + t * (rise - arrives)))
    }
}

impl Censored {
    /// Weighs each segment; the segments at `received` have `values`, and each correlation is given
    /// with the variance of the intercept under it, in units of σ². A correlation that is not
    /// positive definite leaves a segment without neighbours.
    pub(super) fn new(
        segments: &[(ShadowedReading, f64)],
        received: Receivers<'_>,
        values: &[f64],
        correlations: impl Iterator<Item = (Correlation, f64)>,
    ) -> Self {
        let mut ordered: Vec<&(ShadowedReading, f64)> = Vec::with_capacity(segments.len());
        // The number in `ordered` of each that is weighed, and those that it stands for.
        let mut kept: Vec<(usize, core::ops::Range<usize>)> = Vec::new();
        for side in [Censoring::Below, Censoring::Above] {
            let begin = ordered.len();
            ordered.extend(segments.iter().filter(|(reading, _)| reading.censoring == side));
            let group = (ordered.len() - begin).div_ceil(MOST).max(1);
            for from in (begin..ordered.len()).step_by(group) {
                let to = (from + group).min(ordered.len());
                kept.push((from + (to - from) / 2, from..to));
            }
        }
        let all: Neighbours<NEIGHBOURS> =
            Neighbours::among(ordered.iter().map(|(reading, _)| &reading.receiver), received.poses);
        let near: Vec<&[u32]> = all.each().collect();
        let of_correlation = |(correlation, of_intercept): (Correlation, f64)| {
            let each: Vec<Given> = (ordered.iter().zip(&near))
                .map(|((reading, count), near)| {
                    Given::new(reading, *count, near, received, values, correlation)
                })
                .collect();
            let given = kept.iter().filter_map(|(middle, group)| {
                let shared =
                    |j| remaining(&ordered, &near, &each, received, &correlation, *middle, j);
                let alike: f64 = (0..ordered.len()).map(shared).sum();
                #[expect(clippy::cast_precision_loss, reason = "fewer segments than 2⁵³")]
                let exponent = group.len() as f64 / alike;
                let own = each.get(*middle)?;
                let variance = own.variance + of_intercept * own.ones * own.ones;
                Some(Given { exponent, scale: 1.0 / libm::sqrt(variance), ..own.clone() })
            });
            given.collect()
        };
        let given = correlations.map(of_correlation).collect();
        let kept = || kept.iter().filter_map(|(middle, _)| ordered.get(*middle));
        let sign = |s: &ShadowedReading| if s.censoring == Censoring::Above { -1.0 } else { 1.0 };
        let receivers: Vec<Pose> = kept().map(|(reading, _)| reading.receiver).collect();
        Self {
            limits: kept().map(|(reading, _)| (reading.value, sign(reading))).collect(),
            neighbours: Neighbours::among(receivers.iter(), received.poses),
            receivers,
            given,
            log_normal_cdf: LogNormalCdf::new(),
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.receivers.is_empty()
    }

    pub(super) fn receivers(&self) -> &[Pose] {
        &self.receivers
    }

    /// Takes from each segment's regressors, `own`, what its neighbours' are expected to make of
    /// it under a correlation.
    pub(super) fn beyond_neighbours(
        &self,
        correlation: usize,
        own: &[[Row; 2]],
        received: &[[Row; 2]],
        beyond: &mut Vec<[Row; 2]>,
    ) {
        let given = self.given.get(correlation).into_iter().flatten();
        for ((own, near), given) in own.iter().zip(self.neighbours.each()).zip(given) {
            let mut rest = *own;
            for (index, weight) in near.iter().zip(&given.weights) {
                let Some(known) = received.get(*index as usize) else { continue };
                for (rest, known) in rest.as_flattened_mut().iter_mut().zip(known.as_flattened()) {
                    *rest -= weight * known;
                }
            }
            beyond.push(rest);
        }
    }

    /// The weighted log-probability that all lie on their sides of their limits under a law and
    /// a correlation, or −∞ if it is less than `least`; `beyond` are their regressors beyond what
    /// their neighbours tell, of which one column is read.
    pub(super) fn log_probability(
        &self,
        correlation: usize,
        law: &Law,
        beyond: &[[Row; 2]],
        column: usize,
        least: f64,
    ) -> f64 {
        let Law { intercept, coefficients: [b, c], variance } = *law;
        let per_sigma = 1.0 / libm::sqrt(variance);
        let given = self.given.get(correlation).into_iter().flatten();
        let mut sum = 0.0;
        if least >= sum {
            return f64::NEG_INFINITY;
        }
        for (((limit, sign), [x, g]), given) in self.limits.iter().zip(beyond).zip(given) {
            let [x, g] = [x, g].map(|row| row.get(column).copied().unwrap_or(0.0));
            let expected = given.value + intercept * given.ones + b * x + c * g;
            let beside = sign * (limit - expected) * given.scale * per_sigma;
            sum += given.exponent * self.log_normal_cdf.at(beside);
            if sum < least {
                return f64::NEG_INFINITY;
            }
        }
        sum
    }
}

impl Given {
    fn new(
        reading: &ShadowedReading,
        count: f64,
        near: &[u32],
        received: Receivers<'_>,
        values: &[f64],
        correlation: Correlation,
    ) -> Self {
        let given = correlation.given::<NEIGHBOURS>(near, received, &reading.receiver, count);
        let (weights, variance) = given.map_or_else(
            || ([0.0; NEIGHBOURS], correlation.variance(count)),
            |(weights, variance)| (weights.into(), variance),
        );
        let of = near.iter().zip(&weights);
        let value = of.filter_map(|(index, weight)| Some(weight * values.get(*index as usize)?));
        Self {
            weights,
            value: value.sum(),
            ones: 1.0 - weights.iter().take(near.len()).sum::<f64>(),
            variance,
            scale: 1.0 / libm::sqrt(variance),
            exponent: 1.0,
        }
    }
}

/// The correlation of two censored segments beyond what the neighbours of the first tell, from 0
/// to 1.
fn remaining(
    segments: &[&(ShadowedReading, f64)],
    near: &[&[u32]],
    given: &[Given],
    received: Receivers<'_>,
    correlation: &Correlation,
    i: usize,
    j: usize,
) -> f64 {
    let pair = || {
        let [first, second] = [segments.get(i)?, segments.get(j)?].map(|s| &s.0.receiver);
        let [own, other] = [given.get(i)?, given.get(j)?];
        let shared = correlation.shared(first, second);
        if shared < UNLIKE {
            return None;
        }
        let told = near.get(i)?.iter().zip(&own.weights).filter_map(|(index, weight)| {
            Some(weight * correlation.shared(received.poses.get(*index as usize)?, second))
        });
        let rest = shared - told.sum::<f64>();
        Some((rest / libm::sqrt(own.variance * other.variance)).clamp(0.0, 1.0))
    };
    if i == j { 1.0 } else { pair().unwrap_or(0.0) }
}

#[cfg(test)]
mod tests {
    use alloc::vec;
    use approx::assert_abs_diff_eq;

    use nalgebra::DMatrix;

    use super::*;

    fn above(east: f64, north: f64) -> (ShadowedReading, f64) {
        let receiver = Pose::at(east, north, 0.0);
        (ShadowedReading { receiver, value: -40.0, censoring: Censoring::Above }, 1.0)
    }

    #[test]
    fn a_segment_is_expected_as_kriging_with_all_values_expects_it() {
        let correlation = Correlation { length_m: 30.0, nugget: 0.3 };
        let poses: Vec<Pose> = [(0.0, 0.0), (20.0, 5.0), (45.0, -3.0), (12.0, 25.0), (-70.0, 9.0)]
            .map(|(east, north)| Pose::at(east, north, 0.0))
            .to_vec();
        let values = [3.0, -1.0, 0.5, 2.0, -4.0];
        let counts = [1.0, 4.0, 1.0, 2.0, 1.0];
        let received = Receivers { poses: &poses, counts: &counts };
        let censored = Censored::new(
            &[above(10.0, 10.0)],
            received,
            &values,
            [(correlation, 0.0)].into_iter(),
        );
        // Written out anew, from the model's definition.
        let of = |apart_m: f64| 0.7 * libm::exp(-apart_m / 30.0);
        let apart_m = |a: &Pose, b: &Pose| (a.position - b.position).norm();
        let c = DMatrix::from_fn(5, 5, |i, j| {
            let own = if i == j { 0.3 / counts[i] } else { 0.0 };
            of(apart_m(&poses[i], &poses[j])) + own
        });
        let with =
            DMatrix::from_fn(5, 1, |i, _| of(apart_m(&poses[i], &Pose::at(10.0, 10.0, 0.0))));
        let weights = c.lu().solve(&with).expect("regular");
        let given = &censored.given[0][0];
        let mean: f64 = weights.iter().zip(&values).map(|(weight, value)| weight * value).sum();
        assert_abs_diff_eq!(given.value, mean, epsilon = 1e-12);
        assert_abs_diff_eq!(given.ones, 1.0 - weights.sum(), epsilon = 1e-12);
        assert_abs_diff_eq!(given.variance, 1.0 - weights.dot(&with), epsilon = 1e-12);

        // A regressor that the values follow is taken off in the same way.
        let row = |value: f64| [[value; 16], [2.0 * value; 16]];
        let mut beyond = Vec::new();
        let known: Vec<[Row; 2]> = values.iter().map(|value| row(*value)).collect();
        censored.beyond_neighbours(0, &[row(7.0)], &known, &mut beyond);
        assert_abs_diff_eq!(beyond[0][0][3], 7.0 - mean, epsilon = 1e-12);
        assert_abs_diff_eq!(beyond[0][1][3], 2.0 * (7.0 - mean), epsilon = 1e-12);
    }

    #[test]
    fn the_table_is_the_function() {
        let table = LogNormalCdf::new();
        for i in -1300..1000_i16 {
            let x = f64::from(i) / 97.0;
            let [read, exact] = [table.at(x), log_normal_cdf(x)];
            assert!((read - exact).abs() < 1e-8 * (1.0 - exact), "{x}: {read} {exact}");
        }
        assert!(table.at(1e300).abs() < 1e-15 && table.at(f64::NAN).is_nan());
        assert!(table.at(f64::NEG_INFINITY) < -1e300);
    }

    #[test]
    fn segments_that_fade_alike_count_as_one() {
        let correlation = Correlation { length_m: 30.0, nugget: 1e-9 };
        let poses = [Pose::at(1e6, 0.0, 0.0)];
        let received = Receivers { poses: &poses, counts: &[1.0] };
        let of = |places: &[(f64, f64)]| {
            let segments: Vec<_> = places.iter().map(|(e, n)| above(*e, *n)).collect();
            let censored =
                Censored::new(&segments, received, &[0.0], [(correlation, 0.0)].into_iter());
            let law = Law { intercept: -42.0, coefficients: [0.0; 2], variance: 4.0 };
            let none = vec![[[0.0; 16]; 2]; places.len()];
            let all = censored.log_probability(0, &law, &none, 0, f64::NEG_INFINITY);
            all / log_normal_cdf(-1.0)
        };
        assert_abs_diff_eq!(of(&[(0.0, 0.0)]), 1.0, epsilon = 1e-6);
        assert_abs_diff_eq!(of(&[(0.0, 0.0), (0.0, 0.0)]), 1.0, epsilon = 1e-6);
        assert_abs_diff_eq!(of(&[(0.0, 0.0), (1e4, 0.0)]), 2.0, epsilon = 1e-6);
        // Of 300 side by side 100 are weighed, each for three.
        let many: Vec<(f64, f64)> = (0..300).map(|i| (1e3 * f64::from(i), 0.0)).collect();
        assert_abs_diff_eq!(of(&many), 300.0, epsilon = 1e-3);
    }
}
