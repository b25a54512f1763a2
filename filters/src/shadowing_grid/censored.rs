use alloc::vec::Vec;
use foxhunt_core::{Pose, elementary};

use super::{Censoring, NEIGHBOURS, Row, ShadowedReading};
use crate::{
    vecchia::{Correlation, Neighbours, Receivers},
    vectorised::{Kernel, run},
};

/// Gap in the log-likelihood below the best beyond which an explanation is left out, where censored
/// segments make it less probable still.
pub(super) const NEGLIGIBLE: f64 = 12.0;

/// Number of segments of one side that are weighed; of more, some stand for all beside them.
const MOST: usize = 50;

/// Correlation of two segments below which they count as independent.
const UNLIKE: f64 = 0.02;

/// The segments whose values are known to lie below or above a limit, and no more.
///
/// Each is expected where the law and the segments with a value nearest to it say, as kriging
/// does, and weighs by the number that fade like it beyond that.
#[derive(Clone, Debug)]
pub(super) struct Censored {
    receivers: Vec<Pose>,
    /// The segments with a value nearest to each.
    neighbours: Neighbours<NEIGHBOURS>,
    /// For each correlation, each segment given its neighbours.
    given: Vec<Vec<Given>>,
    /// For each correlation, the columns of all segments.
    columns: Vec<Columns>,
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
}

/// Censored segments under one correlation, column by column.
#[derive(Clone, Debug, Default)]
struct Columns {
    /// The limit less the part of the mean that the neighbours' values make, in `scale`s.
    limits: Vec<f64>,
    /// Part of the mean that a unit of the intercept makes, in `scale`s.
    ones: Vec<f64>,
    /// 1 / the standard deviation with the intercept's part, in units of σ; negative above.
    scales: Vec<f64>,
    /// Exponents of the probabilities: 1 over the number of segments that fade alike, for all
    /// segments that one stands for.
    exponents: Vec<f64>,
}

/// Number of laws that are weighed side by side.
const BESIDE: usize = 16;

/// Number of segments after which laws that have become improbable are looked for.
const CHECKED: usize = 8;

/// Regressors of censored segments for one cell, in the scales of [`Columns`]: slopes and gains.
#[derive(Debug, Default)]
pub(super) struct Scaled([Vec<f64>; 2]);

/// The explanation of the levels by which censored segments are expected.
#[derive(Clone, Copy, Debug)]
pub(super) struct Law {
    pub intercept: f64,
    /// Slope and gain.
    pub coefficients: [f64; 2],
    /// σ² of the values.
    pub variance: f64,
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
        // The first ones are from all over the path, and rule out most of what is improbable.
        kept.sort_by_key(|(middle, _)| middle.reverse_bits());
        let all: Neighbours<NEIGHBOURS> =
            Neighbours::among(ordered.iter().map(|(reading, _)| &reading.receiver), received.poses);
        let near: Vec<&[u32]> = all.each().collect();
        let of_correlation = |(correlation, of_intercept): (Correlation, f64)| {
            let each: Vec<Given> = (ordered.iter().zip(&near))
                .map(|((reading, count), near)| {
                    Given::new(reading, *count, near, received, values, correlation)
                })
                .collect();
            let mut columns = Columns::default();
            let mut given = Vec::with_capacity(kept.len());
            for (middle, group) in &kept {
                let (Some((reading, _)), Some(own)) = (ordered.get(*middle), each.get(*middle))
                else {
                    continue;
                };
                let shared =
                    |j| remaining(&ordered, &near, &each, received, &correlation, *middle, j);
                let alike: f64 = (0..ordered.len()).map(shared).sum();
                #[expect(clippy::cast_precision_loss, reason = "fewer segments than 2⁵³")]
                let exponent = group.len() as f64 / alike;
                let variance = own.variance + of_intercept * own.ones * own.ones;
                let sign = if reading.censoring == Censoring::Above { -1.0 } else { 1.0 };
                columns.push(reading.value, own, sign / libm::sqrt(variance), exponent);
                given.push(own.clone());
            }
            (given, columns)
        };
        let (given, columns) = correlations.map(of_correlation).unzip();
        let receivers: Vec<Pose> = (kept.iter())
            .filter_map(|(middle, _)| Some(ordered.get(*middle)?.0.receiver))
            .collect();
        Self {
            neighbours: Neighbours::among(receivers.iter(), received.poses),
            receivers,
            given,
            columns,
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

    /// Adds to the log-mass of each law the weighted log-probability that all segments lie on their
    /// sides of their limits under the law and a correlation, or −∞ if the sum is less than
    /// `needed`, or negligible beside the largest. `beyond` are the segments' regressors beyond
    /// what their neighbours tell, of which one column is read. Returns the largest log-mass,
    /// `peak` if none is larger.
    pub(super) fn add_to<'a>(
        &self,
        correlation: usize,
        beyond: &[[Row; 2]],
        column: usize,
        laws: impl Iterator<Item = (Law, &'a mut f64)>,
        (needed, peak): (f64, f64),
        scaled: &mut Scaled,
    ) -> f64 {
        let Some(columns) = self.columns.get(correlation) else { return peak };
        for (index, scaled) in scaled.0.iter_mut().enumerate() {
            scaled.clear();
            let own = |rows: &[Row; 2]| rows.get(index)?.get(column).copied();
            let of = beyond.iter().zip(&columns.scales);
            scaled.extend(of.map(|(rows, scale)| scale * own(rows).unwrap_or(0.0)));
        }
        let [slopes, gains] = &scaled.0;
        run(Weighing { columns, slopes, gains, laws, needed, peak })
    }
}

/// Weighing of the laws of a cell by the censored segments.
struct Weighing<'c, L> {
    columns: &'c Columns,
    /// Regressors of the segments, in their scales.
    slopes: &'c [f64],
    gains: &'c [f64],
    laws: L,
    /// Least log-mass that counts.
    needed: f64,
    /// Largest log-mass so far.
    peak: f64,
}

impl<'a, L: Iterator<Item = (Law, &'a mut f64)>> Kernel for Weighing<'_, L> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let Self { columns, slopes, gains, mut laws, needed, mut peak } = self;
        loop {
            // A censored segment makes nothing more probable.
            let least = needed.max(peak - NEGLIGIBLE);
            let mut block = Block::default();
            let mut log_masses: [Option<&mut f64>; BESIDE] = [const { None }; BESIDE];
            let mut count = 0;
            while count < BESIDE {
                let Some((law, log_mass)) = laws.next() else { break };
                if *log_mass > least {
                    block.set(count, law, *log_mass);
                    log_masses[count] = Some(log_mass);
                    count += 1;
                } else {
                    *log_mass = f64::NEG_INFINITY;
                }
            }
            if count == 0 {
                return peak;
            }
            block.weigh(columns, slopes, gains, least);
            for (log_mass, weighed) in log_masses.into_iter().flatten().zip(block.log_masses) {
                *log_mass = if weighed > least { weighed } else { f64::NEG_INFINITY };
                peak = peak.max(*log_mass);
            }
        }
    }
}

/// Laws that are weighed side by side, column by column; those after the last have no mass.
struct Block {
    intercepts: [f64; BESIDE],
    slopes: [f64; BESIDE],
    gains: [f64; BESIDE],
    /// 1 / σ.
    per_sigmas: [f64; BESIDE],
    log_masses: [f64; BESIDE],
}

impl Default for Block {
    #[inline(always)]
    fn default() -> Self {
        let none = [0.0; BESIDE];
        let log_masses = [f64::NEG_INFINITY; BESIDE];
        Self { intercepts: none, slopes: none, gains: none, per_sigmas: none, log_masses }
    }
}

impl Block {
    #[inline(always)]
    fn set(&mut self, index: usize, law: Law, log_mass: f64) {
        let Law { intercept, coefficients: [slope, gain], variance } = law;
        self.intercepts[index] = intercept;
        self.slopes[index] = slope;
        self.gains[index] = gain;
        self.per_sigmas[index] = 1.0 / elementary::sqrt(variance);
        self.log_masses[index] = log_mass;
    }

    /// Adds the log-probabilities of the segments, until no law has more than `least`.
    #[inline(always)]
    fn weigh(&mut self, columns: &Columns, slopes: &[f64], gains: &[f64], least: f64) {
        let Columns { limits, ones, exponents, .. } = columns;
        let segments = limits.iter().zip(ones).zip(exponents).zip(slopes).zip(gains);
        for (index, ((((limit, one), exponent), slope), gain)) in segments.enumerate() {
            if index % CHECKED == 0 && self.log_masses.iter().all(|log_mass| *log_mass <= least) {
                return;
            }
            for k in 0..BESIDE {
                let expected =
                    self.intercepts[k] * one + self.slopes[k] * slope + self.gains[k] * gain;
                let beside = (limit - expected) * self.per_sigmas[k];
                self.log_masses[k] += exponent * elementary::ln_normal_cdf(beside);
            }
        }
    }
}

impl Columns {
    /// Appends a segment; `scale` is 1 / its standard deviation, negative above the limit.
    fn push(&mut self, limit: f64, given: &Given, scale: f64, exponent: f64) {
        self.limits.push(scale * (limit - given.value));
        self.ones.push(scale * given.ones);
        self.scales.push(scale);
        self.exponents.push(exponent);
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

    use foxhunt_core::noise::log_normal_cdf;
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
            let mut all = 0.0;
            let laws = [(law, &mut all)].into_iter();
            let ends = (f64::NEG_INFINITY, f64::NEG_INFINITY);
            let peak = censored.add_to(0, &none, 0, laws, ends, &mut Scaled::default());
            assert_abs_diff_eq!(peak, all, epsilon = 0.0);
            all / log_normal_cdf(-1.0)
        };
        assert_abs_diff_eq!(of(&[(0.0, 0.0)]), 1.0, epsilon = 1e-6);
        assert_abs_diff_eq!(of(&[(0.0, 0.0), (0.0, 0.0)]), 1.0, epsilon = 1e-6);
        assert_abs_diff_eq!(of(&[(0.0, 0.0), (1e4, 0.0)]), 2.0, epsilon = 1e-6);
        // Of 300 side by side 50 are weighed, each for six.
        let many: Vec<(f64, f64)> = (0..300).map(|i| (1e3 * f64::from(i), 0.0)).collect();
        assert_abs_diff_eq!(of(&many), 300.0, epsilon = 1e-3);
    }
}
