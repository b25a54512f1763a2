use alloc::vec::Vec;

use foxhunt_core::{Pose, noise::log_normal_cdf};

use super::{Censoring, ShadowedReading, ShadowingGridConfig};

/// Number of segments of one side that are weighed; of more, some stand for all, as neighbours
/// fade together.
const MOST: usize = 24;

/// The segments whose values are known to lie below or above a limit, and no more.
#[derive(Clone, Debug)]
pub(super) struct Censored {
    receivers: Vec<Pose>,
    /// Each limit, and the sign of limit − value: 1 below, −1 above.
    limits: Vec<(f64, f64)>,
    /// The exponent of each segment's probability, for each correlation length and nugget.
    exponents: Vec<Vec<f64>>,
}

impl Censored {
    /// Weighs each segment by the number that fade like it, 1 / Σⱼ Cᵢⱼ.
    pub(super) fn new(config: &ShadowingGridConfig, segments: &[ShadowedReading]) -> Self {
        let mut kept: Vec<&ShadowedReading> = Vec::new();
        for side in [Censoring::Below, Censoring::Above] {
            let of_side: Vec<_> = segments.iter().filter(|s| s.censoring == side).collect();
            let group = of_side.len().div_ceil(MOST).max(1);
            kept.extend(
                of_side.chunks(group).filter_map(|chunk| chunk.get(chunk.len() / 2).copied()),
            );
        }
        let receivers: Vec<Pose> = kept.iter().map(|s| s.receiver).collect();
        let sign = |s: &ShadowedReading| if s.censoring == Censoring::Above { -1.0 } else { 1.0 };
        let limits = kept.iter().map(|s| (s.value, sign(s))).collect();
        let exponent = |receiver: &Pose, length_m: f64, nugget: f64| {
            let alike = receivers.iter().map(|other| {
                let apart_m = (other.position - receiver.position).norm();
                (1.0 - nugget) * libm::exp(-apart_m / length_m)
            });
            1.0 / (nugget + alike.sum::<f64>())
        };
        let mut exponents = Vec::new();
        for &length_m in &config.correlation_lengths_m {
            for &nugget in &config.nuggets {
                exponents.push(receivers.iter().map(|r| exponent(r, length_m, nugget)).collect());
            }
        }
        Self { receivers, limits, exponents }
    }

    pub(super) fn receivers(&self) -> &[Pose] {
        &self.receivers
    }

    pub(super) fn is_empty(&self) -> bool {
        self.receivers.is_empty()
    }

    /// The weighted log-probability that all lie on their sides of their limits, where they are
    /// expected at `expected`, with a standard deviation, under the correlation of that number.
    pub(super) fn log_probability(
        &self,
        expected: impl Iterator<Item = f64>,
        deviation: f64,
        correlation: usize,
    ) -> f64 {
        let exponents = self.exponents.get(correlation).into_iter().flatten();
        let each = self.limits.iter().zip(expected).zip(exponents);
        each.map(|(((limit, sign), expected), exponent)| {
            exponent * log_normal_cdf(sign * (limit - expected) / deviation)
        })
        .sum()
    }
}
