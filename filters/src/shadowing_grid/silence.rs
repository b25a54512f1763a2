use alloc::vec::Vec;

use foxhunt_core::{Pose, noise::log_normal_cdf};

use super::{ShadowingGridConfig, path::Segments};

/// More segments than these are represented by some of them: those near each other fade together.
const MOST: usize = 24;

/// The segments of which nothing is known but that their values lay below a limit.
#[derive(Clone, Debug)]
pub(super) struct Silences {
    receivers: Vec<Pose>,
    limits: Vec<f64>,
    /// What each counts for, for each correlation length and nugget.
    counts: Vec<Vec<f64>>,
}

impl Silences {
    /// Weighs each by how many fade like it, 1 / Σⱼ Cᵢⱼ.
    pub(super) fn new(config: &ShadowingGridConfig, segments: &Segments) -> Self {
        let group = segments.silences.len().div_ceil(MOST).max(1);
        let middles =
            segments.silences.chunks(group).filter_map(|chunk| chunk.get(chunk.len() / 2));
        let (receivers, limits): (Vec<Pose>, Vec<f64>) = middles.copied().unzip();
        let count = |receiver: &Pose, length_m: f64, nugget: f64| {
            let alike = receivers.iter().map(|other| {
                let apart_m = (other.position - receiver.position).norm();
                (1.0 - nugget) * libm::exp(-apart_m / length_m)
            });
            1.0 / (nugget + alike.sum::<f64>())
        };
        let mut counts = Vec::new();
        for &length_m in &config.correlation_lengths_m {
            for &nugget in &config.nuggets {
                counts.push(receivers.iter().map(|r| count(r, length_m, nugget)).collect());
            }
        }
        Self { receivers, limits, counts }
    }

    pub(super) fn receivers(&self) -> &[Pose] {
        &self.receivers
    }

    pub(super) fn is_empty(&self) -> bool {
        self.receivers.is_empty()
    }

    /// The weighted log-probability that all lay below their limits, where they are expected at
    /// `expected`, with a standard deviation, under the correlation of that number.
    pub(super) fn log_probability(
        &self,
        expected: impl Iterator<Item = f64>,
        deviation: f64,
        correlation: usize,
    ) -> f64 {
        let counts = self.counts.get(correlation).into_iter().flatten();
        let each = self.limits.iter().zip(expected).zip(counts);
        each.map(|((limit, expected), count)| {
            count * log_normal_cdf((limit - expected) / deviation)
        })
        .sum()
    }
}
