use alloc::{vec, vec::Vec};

use foxhunt_core::{
    Bearing, BearingExtractor, BearingMode, BearingModes, NoBearing, NoReading, Reading, Sweep,
    angle,
};

use super::{
    StationPattern,
    pattern::{Gain, NODES},
};
use crate::extractor::{
    check,
    likelihood::{Node, Peak, normal_cdf, peaks, summit},
};

/// Degrees of freedom of the residuals' Student's t.
pub(crate) const TAIL: f64 = 4.0;

/// The probability that an antenna loses a burst above its floor.
pub(crate) const LOST: f64 = 0.03;

/// The level is integrated from so far below the strongest reading to so far above it, in dB: an
/// antenna's front receives it at its level, its back some 15 dB below. A step is this share of the
/// residuals' scale.
const BELOW: f64 = 15.0;
const ABOVE: f64 = 35.0;
const STEP: f64 = 0.4;

/// Largest distance from an antenna's recorded boresight of a boresight of its own, in radians: a
/// degree.
const SAME_ANTENNA: f64 = 0.0175;

impl StationPattern {
    /// The mean reading of each antenna in dBm, where it received the burst.
    fn measured(&self, sweep: &Sweep<'_>) -> Vec<Option<f64>> {
        let mut sums = vec![(0.0, 0.0); self.antennas.len()];
        for sample in sweep.samples {
            if let Some((sum, count)) = sums.get_mut(self.antenna_of(sample.boresight)) {
                *sum += sample.rss_dbm;
                *count += 1.0;
            }
        }
        sums.into_iter().map(|(sum, count)| (count > 0.0).then(|| sum / count)).collect()
    }

    /// The log posterior of the direction, the level integrated out, with the moments of the level.
    fn nodes(&self, measured: &[Option<f64>]) -> Vec<Node> {
        let strongest = measured.iter().flatten().fold(f64::NEG_INFINITY, |a, &b| a.max(b));
        let step = STEP * self.residual_db;
        let variance = self.residual_db * self.residual_db;
        #[expect(clippy::cast_possible_truncation, reason = "the scale is bounded from below")]
        #[expect(clippy::cast_sign_loss, reason = "all three are positive")]
        let steps = libm::ceil((BELOW + ABOVE) / step) as u32;
        let node = |node: usize| {
            let at_node = |(reading, gains): (&Option<f64>, &Vec<Gain>)| {
                let Gain { mean_db, variance: own } = gains.get(node).copied().unwrap_or_default();
                (*reading, mean_db, libm::sqrt(variance + own))
            };
            let each: Vec<(Option<f64>, f64, f64)> =
                measured.iter().zip(&self.gains).map(at_node).collect();
            let log_likelihood = |off: f64| -> f64 {
                let one = |&(reading, gain, scale): &(Option<f64>, f64, f64)| {
                    self.log_likelihood(reading, strongest + off + gain, scale)
                };
                each.iter().map(one).sum()
            };
            // Normalises the readings' densities, whose scales vary over the circle.
            let scales = each.iter().filter(|(reading, ..)| reading.is_some());
            let widths: f64 = scales.map(|(.., scale)| libm::log(scale / self.residual_db)).sum();
            let mut best = f64::NEG_INFINITY;
            let mut ones = 0.0;
            let mut sum = 0.0;
            let mut squares = 0.0;
            for k in 0..=steps {
                let off = f64::from(k) * step - BELOW;
                let log = log_likelihood(off);
                if log > best {
                    let shrink = libm::exp(best - log);
                    (ones, sum, squares) = (ones * shrink, sum * shrink, squares * shrink);
                    best = log;
                }
                let weight = libm::exp(log - best);
                ones += weight;
                sum += weight * off;
                squares += weight * off * off;
            }
            let mean = sum / ones;
            Node {
                log_density: best + libm::log(ones) - widths,
                level: strongest + mean,
                level_variance: (squares / ones - mean * mean).max(0.0),
            }
        };
        (0..usize::from(NODES)).map(node).collect()
    }

    /// The log likelihood of an antenna's reading, or of its silence, at an expected power whose
    /// residuals have this scale.
    fn log_likelihood(&self, reading: Option<f64>, expected: f64, scale: f64) -> f64 {
        match (reading, self.floor) {
            (Some(reading), _) => {
                let off = (reading - expected) / scale;
                -0.5 * (TAIL + 1.0) * libm::log1p(off * off / TAIL)
            }
            (None, Some([floor, width])) => {
                let x = (floor - expected) / libm::hypot(width, scale);
                libm::log(LOST + (1.0 - LOST) * normal_cdf(x))
            }
            (None, None) => 0.0,
        }
    }
}

impl BearingExtractor for StationPattern {
    fn extract(&self, sweep: &Sweep<'_>) -> Result<Reading, NoReading> {
        check(sweep)?;
        for (index, sample) in sweep.samples.iter().enumerate() {
            let boresight = sample.boresight;
            let of = self.antennas.get(self.antenna_of(boresight));
            let off =
                of.map_or(f64::INFINITY, |a| angle::distance(a.recorded_boresight, boresight));
            if off > SAME_ANTENNA {
                return Err(NoReading::Boresight { index, boresight });
            }
        }
        let measured = self.measured(sweep);
        let nodes = self.nodes(&measured);
        let found = peaks(&nodes);
        let (leading, _) = summit(&nodes);
        let mut directions = [BearingMode::default(); BearingModes::CAPACITY];
        let mut level = 0.0;
        let mut second = 0.0;
        let mut square = 0.0;
        for (mode, peak) in directions.iter_mut().zip(&found) {
            let angle = angle::wrap(peak.offset);
            let off = angle::wrap(peak.offset - leading);
            *mode = BearingMode { weight: peak.weight, angle, sigma: peak.sigma };
            let mean = peak.level + self.mean_db;
            level += peak.weight * mean;
            second += peak.weight * (mean * mean + peak.level_variance);
            square += peak.weight * (peak.sigma * peak.sigma + off * off);
        }
        let product = |peak: &Peak| {
            let (off, rise) =
                (angle::wrap(peak.offset - leading), peak.level + self.mean_db - level);
            peak.weight * (peak.covariance + off * rise)
        };
        let level_variance = (second - level * level).max(0.0);
        // Without a peak the pattern or the readings are beyond reckoning.
        let sigma = if found.is_empty() { f64::INFINITY } else { libm::sqrt(square) };
        // What is left of certainty; of a direction of which nothing is known, hardly any.
        let confidence = libm::exp(-0.5 * square);
        let bearing = if sigma > self.max_sigma {
            Err(NoBearing::TooWide { sigma, limit: self.max_sigma })
        } else {
            Ok(Bearing { angle: angle::wrap(leading), sigma, confidence })
        };
        let covariance = if bearing.is_ok() { found.iter().map(product).sum() } else { 0.0 };
        Ok(Reading {
            rss_dbm: level,
            rss_sigma_db: libm::hypot(self.level_sigma_db, libm::sqrt(level_variance)),
            bearing,
            covariance,
            modes: BearingModes::new(directions.get(..found.len()).unwrap_or(&[]))
                .unwrap_or_default(),
        })
    }
}
