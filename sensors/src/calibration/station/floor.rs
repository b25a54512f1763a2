use crate::extractor::{LOST, TAIL, normal_cdf};

/// The receivers' floor: the power at which half the bursts are received, and its spread in dB.
#[derive(Clone, Copy, Debug)]
pub(super) struct Floor {
    pub(super) dbm: f64,
    pub(super) width_db: f64,
}

/// An antenna's reading, or the power that it should have read and did not.
#[derive(Clone, Copy, Debug)]
pub(super) enum Chance {
    Received(f64),
    Silent(f64),
}

impl Floor {
    /// Expected power where nothing was received, if the power without a floor is a Gaussian of
    /// `sigma_db` about `expected`.
    pub(super) fn imputed(&self, expected: f64, sigma_db: f64) -> f64 {
        let spread = libm::hypot(self.width_db, sigma_db);
        let x = (self.dbm - expected) / spread;
        let below = normal_cdf(x);
        let hazard = if below > 1e-12 {
            libm::exp(-0.5 * x * x) / (libm::sqrt(core::f64::consts::TAU) * below)
        } else {
            -x
        };
        // A burst that was far above the floor was lost, and does not show its power.
        let lost = LOST / (LOST + (1.0 - LOST) * below);
        expected - (1.0 - lost) * sigma_db * sigma_db / spread * hazard
    }

    /// Log likelihood of a reading, but for a constant and the logarithm of the scale, or of a
    /// silence, at an expected power whose residuals have this scale.
    pub(super) fn log_likelihood(&self, reading: Option<f64>, expected: f64, scale: f64) -> f64 {
        match reading {
            Some(reading) => {
                let off = (reading - expected) / scale;
                -0.5 * (TAIL + 1.0) * libm::log1p(off * off / TAIL)
            }
            None => self.log_silence(expected, scale),
        }
    }

    /// Log likelihood of a silence at an expected power whose residuals have this scale.
    fn log_silence(&self, expected: f64, scale: f64) -> f64 {
        let x = (self.dbm - expected) / libm::hypot(self.width_db, scale);
        libm::log(LOST + (1.0 - LOST) * normal_cdf(x))
    }

    /// The floor that makes the receptions and silences most likely (Tobin 1958, with a floor that
    /// is not sharp).
    pub(super) fn fitted(
        self,
        chances: impl Iterator<Item = Chance> + Clone,
        sigma_db: f64,
    ) -> Self {
        let log_likelihood = |floor: &Self| -> f64 {
            let one = |chance| match chance {
                Chance::Received(reading) => {
                    libm::log(normal_cdf((reading - floor.dbm) / floor.width_db).max(1e-300))
                }
                Chance::Silent(expected) => floor.log_silence(expected, sigma_db),
            };
            chances.clone().map(one).sum()
        };
        let mut best = self;
        let mut value = log_likelihood(&self);
        let mut step = 2.0;
        while step > 0.05 {
            let dbm = best.dbm;
            let width_db = best.width_db;
            let tries = [
                Self { dbm: dbm + step, width_db },
                Self { dbm: dbm - step, width_db },
                Self { dbm, width_db: (width_db * (1.0 + 0.5 * step)).min(10.0) },
                Self { dbm, width_db: (width_db / (1.0 + 0.5 * step)).max(0.3) },
            ];
            let mut better = false;
            for tried in tries {
                let its = log_likelihood(&tried);
                if its > value + 1e-9 {
                    (best, value, better) = (tried, its, true);
                }
            }
            if !better {
                step *= 0.5;
            }
        }
        best
    }
}
