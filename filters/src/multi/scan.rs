//! Scans: what a receiver detects of each transmitter, and its false alarms.

use alloc::vec::Vec;

use foxhunt_core::{
    Axis, Estimator, EstimatorError, Observation,
    parameter::{ParameterError, positive, require},
};
use nalgebra::DMatrix;

use super::{Associations, Density, Reduction, Updated};
use crate::count::number;

/// Weight over that of a missed track below which a track did not make an observation.
const NEGLIGIBLE: f64 = 1e-8;

/// Largest logarithm of a weight: its exponential, and sums of such, are finite.
const MOST_LOG_WEIGHT: f64 = 600.0;

/// Detections and false alarms of a receiver: a transmitter makes at most one observation of a
/// scan, with the detection probability; clutter is a Poisson process, spread evenly over a width
/// for each component.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detection<const M: usize> {
    probability: f64,
    clutter: f64,
    widths: [f64; M],
}

impl<const M: usize> Detection<M> {
    /// Detections with `probability`, and `clutter` false observations in a scan on average, spread
    /// evenly over these widths, each in its component's unit: 2π for a bearing, the span of
    /// levels that the receiver reports for a level.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names a probability that is not in (0, 1), a rate or a width that is not
    /// positive and finite.
    pub fn new(probability: f64, clutter: f64, widths: [f64; M]) -> Result<Self, ParameterError> {
        let proper = probability > 0.0 && probability < 1.0;
        require(proper, "the detection probability", probability, "in (0, 1)")?;
        positive("the rate of clutter", clutter)?;
        for width in widths {
            positive("the width of the clutter", width)?;
        }
        Ok(Self { probability, clutter, widths })
    }

    /// Probability that a transmitter is observed in a scan.
    #[must_use]
    pub fn probability(&self) -> f64 {
        self.probability
    }

    /// κ(z): intensity of clutter at an observation, over the components that are present.
    #[must_use]
    pub fn clutter_intensity(&self, observation: &Observation<M>) -> f64 {
        let present = self.widths.iter().enumerate().filter(|(i, _)| observation.has(*i));
        self.clutter / present.map(|(_, width)| width).product::<f64>()
    }
}

/// A track before a scan: its probability of existence and its density.
pub(super) struct Before<'a, E> {
    pub existence: f64,
    pub density: &'a Density<E>,
}

/// A track after a scan.
pub(super) struct After<E> {
    pub existence: f64,
    pub density: Density<E>,
}

/// Conditions tracks on a scan, each observation of which is made by one track at most.
///
/// The joint probability of existences and associations is a product of factors for each track:
/// 1 − r for absence, r (1 − p_D) for a missed detection, r p_D ℓ(z) / κ(z) for observation
/// z (Reuter, Vo, Vo & Dietmayer 2014, §IV). A track without an observation has the factor 1 − r
/// p_D, so that the sums over existence are done before those over associations.
pub(super) fn condition<E, const N: usize, const M: usize>(
    tracks: &[Before<'_, E>],
    observations: &[Observation<M>],
    detection: &Detection<M>,
    reduction: &Reduction<E, N>,
    axes: &[Axis; N],
) -> Result<(Vec<After<E>>, Associations), EstimatorError>
where
    E: Estimator<N, M> + Clone,
{
    let mut weights = DMatrix::zeros(tracks.len(), observations.len() + 1);
    let mut updated: Vec<Vec<(usize, Updated<E>)>> = Vec::with_capacity(tracks.len());
    let log_clutter: Vec<f64> =
        observations.iter().map(|o| libm::log(detection.clutter_intensity(o))).collect();
    for (row, track) in tracks.iter().enumerate() {
        let missed = 1.0 - track.existence * detection.probability;
        weights[(row, 0)] = missed;
        let log_detected = libm::log(track.existence * detection.probability);
        let mut made = Vec::new();
        for (index, observation) in observations.iter().enumerate() {
            if observation.is_empty() {
                continue;
            }
            let Some(after) = track.density.updated(observation) else { continue };
            let log_weight = log_detected + after.log_evidence - log_clutter[index];
            let weight = libm::exp(log_weight.min(MOST_LOG_WEIGHT));
            if weight > NEGLIGIBLE * missed {
                weights[(row, index + 1)] = weight;
                made.push((index, after));
            }
        }
        updated.push(made);
    }
    let associations = Associations::of_weights(&weights);
    let mut after = Vec::with_capacity(tracks.len());
    for (row, (track, made)) in tracks.iter().zip(updated).enumerate() {
        let missed = track.existence * (1.0 - detection.probability)
            / (1.0 - track.existence * detection.probability);
        let missed = associations.missed(row) * missed;
        let made: Vec<(f64, Density<E>)> = made
            .into_iter()
            .map(|(index, after)| (associations.of(row, index), after.into_density()))
            .collect();
        let existence = missed + made.iter().map(|(probability, _)| probability).sum::<f64>();
        let density = if existence > 0.0 {
            let histories = core::iter::once((missed, track.density.clone())).chain(made);
            let mut density = Density::sum(histories)?;
            density.reduce(reduction, axes)?;
            density
        } else {
            track.density.clone()
        };
        after.push(After { existence: existence.min(1.0), density });
    }
    Ok((after, associations))
}

/// Distribution of the number of transmitters, by the existence of each: element n is the
/// probability of n transmitters.
pub(super) fn cardinality(existences: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut distribution = alloc::vec![1.0];
    for existence in existences {
        let mut next = alloc::vec![0.0; distribution.len() + 1];
        for (count, probability) in distribution.iter().enumerate() {
            next[count] += probability * (1.0 - existence);
            next[count + 1] += probability * existence;
        }
        distribution = next;
    }
    distribution
}

/// Index of the largest value; the first of equal ones.
pub(super) fn most_probable(distribution: &[f64]) -> usize {
    let larger = |best: usize, (index, value): (usize, &f64)| {
        if *value > distribution[best] { index } else { best }
    };
    distribution.iter().enumerate().fold(0, larger)
}

/// Mean of a distribution of numbers.
pub(super) fn mean(distribution: &[f64]) -> f64 {
    distribution.iter().enumerate().map(|(count, p)| number(count) * p).sum()
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use foxhunt_core::Pose;
    use nalgebra::{Matrix2, Vector2};

    use super::*;

    #[test]
    fn clutter_is_spread_over_the_components_that_are_present() {
        let detection = Detection::new(0.9, 6.0, [3.0, 4.0]).expect("proper");
        let both = Observation::new(0.0, Pose::default(), Vector2::zeros(), Matrix2::identity());
        let both = both.expect("proper");
        assert_abs_diff_eq!(detection.clutter_intensity(&both), 0.5, epsilon = 1e-15);
        assert_abs_diff_eq!(detection.clutter_intensity(&both.without(0)), 1.5, epsilon = 1e-15);
    }

    #[test]
    fn improper_detections_are_refused() {
        for (probability, clutter, width) in [
            (0.0, 1.0, 1.0),
            (1.0, 1.0, 1.0),
            (f64::NAN, 1.0, 1.0),
            (0.5, 0.0, 1.0),
            (0.5, f64::INFINITY, 1.0),
            (0.5, 1.0, 0.0),
        ] {
            let refused = Detection::new(probability, clutter, [width]).is_err();
            assert!(refused, "{probability}, {clutter}, {width}");
        }
    }

    #[test]
    fn the_number_of_transmitters_is_a_sum_of_coins() {
        let distribution = cardinality([0.5, 0.25, 1.0].into_iter());
        for (value, expected) in distribution.iter().zip([0.0, 0.375, 0.5, 0.125]) {
            assert_abs_diff_eq!(*value, expected, epsilon = 1e-15);
        }
        assert_eq!(most_probable(&distribution), 2);
        assert_abs_diff_eq!(mean(&distribution), 1.75, epsilon = 1e-15);
        assert_eq!(most_probable(&cardinality(core::iter::empty())), 0);
    }
}
