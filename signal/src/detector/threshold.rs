use std::f64::consts::{FRAC_1_SQRT_2, PI};

/// The rate at which noise alone exceeds a threshold somewhere, when a pulse-long window slides
/// over all times and frequencies.
///
/// The statistic is a window's energy over the noise's, X = |Σ x e^{−iωt}|² / (n N), exponential
/// under noise. Its maxima above a high T come at a rate that the correlation of neighbours gives:
/// in frequency |r| ≈ 1 − (π w δ)²/6, smooth, with √(πT/3) w upcrossings a hertz (Rice 1944); in
/// time |r| = 1 − |τ|/w, with 2T/w a second (Pickands 1969), less by ν(√(4T/n)) as windows begin at
/// samples only, n to a window (Siegmund 1985). So λ = B · 2 √(π/3) T^{3/2} ν P(X > T), whatever
/// the width. The noise's level is an estimate worth k exponentials, so that P(X > T) is
/// (1 + T/k)^−k (Finn & Johnson 1968). Rates of several widths add, which is above the truth as
/// widths share noise.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct FalseAlarms {
    band_hz: f64,
    /// Samples in the window of each width.
    windows: Vec<usize>,
}

impl FalseAlarms {
    pub(super) fn new(band_hz: f64, windows: Vec<usize>) -> Self {
        Self { band_hz, windows }
    }

    /// The number of noise's maxima above the threshold, a second; the level of the noise is worth
    /// `known` exponentials.
    pub(super) fn rate_hz(&self, threshold: f64, known: f64) -> f64 {
        let nu = |n: &usize| discrete((4.0 * threshold / super::channeliser::float(*n)).sqrt());
        let beyond = (-known * (threshold / known).ln_1p()).exp();
        let each: f64 = self.windows.iter().map(nu).sum();
        self.band_hz * 2.0 * (PI / 3.0).sqrt() * threshold.powf(1.5) * beyond * each
    }

    /// The threshold that noise exceeds `rate_hz` times a second.
    pub(super) fn threshold(&self, rate_hz: f64, known: f64) -> f64 {
        // The rate falls above 1.5, where T^{3/2} e^−T is highest.
        let mut low = 2.0;
        let mut high = 2000.0;
        for _ in 0..60 {
            let middle = (low + high) / 2.0;
            if self.rate_hz(middle, known) > rate_hz {
                low = middle;
            } else {
                high = middle;
            }
        }
        high
    }
}

/// The rate at which a random walk of steps x exceeds a level, over that of a continuous one
/// (Siegmund 1985; the closed form of Siegmund & Yakir 2007).
pub(super) fn discrete(x: f64) -> f64 {
    let half = x / 2.0;
    let above = 0.5 * libm::erf(half * FRAC_1_SQRT_2);
    let density = (-half * half / 2.0).exp() / (2.0 * PI).sqrt();
    (above / half) / (half * (0.5 + above) + density)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_make_maxima_rarer() {
        // exp(−0.583 x) for small steps (Siegmund 1985, equation 4.38).
        for x in [0.1_f64, 0.5, 1.0] {
            assert!((discrete(x) / (-0.583 * x).exp() - 1.0).abs() < 0.02, "{x}");
        }
    }

    #[test]
    fn a_threshold_has_its_rate() {
        let alarms = FalseAlarms::new(4e3, vec![120, 240]);
        for rate in [1e-6, 1e-3, 1.0] {
            for known in [100.0, 1e4] {
                let threshold = alarms.threshold(rate, known);
                let back = alarms.rate_hz(threshold, known);
                assert!((back / rate - 1.0).abs() < 1e-6, "{rate} {known}: {back}");
            }
        }
        let known = alarms.threshold(1e-3, 1e6);
        assert!((20.0..22.0).contains(&known), "{known}");
        assert!(alarms.threshold(1e-3, 500.0) > known + 0.3, "an unknown level costs");
    }
}
