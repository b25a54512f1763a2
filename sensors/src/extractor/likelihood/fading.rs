use core::f64::consts::PI;

use super::gain_table::GainTable;

/// Effect of diffuse reflections on a pattern: along every boresight a signal's direct wave meets
/// the sum of many weaker ones from all around, so that its power is Rician (Rice 1945).
///
/// For a reflected amplitude `ratio` times the direct one, the reflected power is `ratio`² times
/// the mean gain along every boresight; K is the direct power over it. The back of a pattern is all
/// reflections, its main lobe hardly.
#[derive(Clone, Debug)]
pub(super) struct Fading {
    /// The variance of the logarithm in dB² by the angle off boresight.
    variance: GainTable,
}

/// 10 log₁₀ e.
const DB: f64 = 10.0 * core::f64::consts::LOG10_E;

impl Fading {
    pub(super) fn new(gain: &GainTable, ratio: f64) -> Self {
        let count: f64 = gain.rows().iter().map(|_| 1.0).sum();
        let mean = gain.rows().iter().map(|row| libm::exp(row / DB)).sum::<f64>() / count;
        let variance = |row: f64| {
            let factor = libm::exp(row / DB) / (ratio * ratio * mean);
            DB * DB * log_power_variance(factor)
        };
        Self { variance: gain.map(variance) }
    }

    /// The variance in dB² that a boresight `azimuth` radians clockwise of the signal has.
    pub(super) fn variance(&self, azimuth: f64) -> f64 {
        self.variance.at(azimuth)
    }
}

/// The variance of the logarithm of a Rician power: π²/6 without a direct wave, 2/K with a strong
/// one (the delta method); between them a formula that has both limits.
fn log_power_variance(factor: f64) -> f64 {
    1.0 / (6.0 / (PI * PI) + 0.5 * factor)
}
