//! From bursts of a transmitter whose place is known to the coarse patterns of stations.

mod fit;
mod pool;
mod shape;

pub use fit::{StationDoubt, StationFit, StationsFit, fit_stations};

use alloc::vec::Vec;
use core::f64::consts::TAU;

use crate::extractor::{LOST, lobe_db, log_student, normal_cdf};

/// Steps of the table over the circle.
const STEPS: u16 = 720;

/// Step of the differences, in radians, logarithms and dB.
const H: f64 = 0.01;

/// Ranges of a lobe that is fitted.
const BEAMWIDTHS: [f64; 2] = [0.2, 3.0];
const FRONT_TO_BACKS_DB: [f64; 2] = [3.0, 40.0];

/// A burst of the transmitter as a station received it.
#[derive(Clone, Debug, PartialEq)]
pub struct StationBurst {
    /// The direction from the station to the transmitter, in radians counter-clockwise from East.
    pub truth: f64,
    /// The day, or another name for bursts that belong together and go through the same places.
    pub group: i64,
    /// The reading of each antenna in dBm; `None` where it received nothing.
    pub readings_dbm: Vec<Option<f64>>,
}

/// A station and the bursts that it received of a transmitter at known places.
#[derive(Clone, Debug, PartialEq)]
pub struct StationRecord {
    /// The antennas' boresights as recordings have them, in radians; they also name the antennas.
    pub recorded: Vec<f64>,
    /// The bursts, in the order of time.
    pub bursts: Vec<StationBurst>,
}

/// Gain of the shared lobe at an angle, and its slopes.
#[derive(Clone, Copy, Debug, Default)]
struct Slopes {
    gain_db: f64,
    /// By the angle, in dB/rad.
    by_angle: f64,
    /// By the logarithm of the beamwidth.
    by_width: f64,
    /// By the front-to-back ratio.
    by_depth: f64,
}

/// The lobe that all antennas share, as a table over the circle.
#[derive(Clone, Debug)]
struct Lobe {
    beamwidth: f64,
    front_to_back_db: f64,
    table: Vec<Slopes>,
}

impl Lobe {
    /// Creates the lobe of these parameters, moved into the ranges of a lobe that is fitted.
    fn new(beamwidth: f64, front_to_back_db: f64) -> Self {
        let [least, most] = BEAMWIDTHS;
        let beamwidth = beamwidth.clamp(least, most);
        let [least, most] = FRONT_TO_BACKS_DB;
        let depth = front_to_back_db.clamp(least, most);
        let width = libm::log(beamwidth);
        let at = |step: u16| {
            let angle = TAU * f64::from(step) / f64::from(STEPS);
            let by = |a: f64, w: f64, d: f64| lobe_db(angle + a, libm::exp(width + w), depth + d);
            Slopes {
                gain_db: by(0.0, 0.0, 0.0),
                by_angle: (by(H, 0.0, 0.0) - by(-H, 0.0, 0.0)) / (2.0 * H),
                by_width: (by(0.0, H, 0.0) - by(0.0, -H, 0.0)) / (2.0 * H),
                by_depth: (by(0.0, 0.0, H) - by(0.0, 0.0, -H)) / (2.0 * H),
            }
        };
        Self { beamwidth, front_to_back_db: depth, table: (0..STEPS).map(at).collect() }
    }

    /// Returns gain and slopes `angle` radians off boresight.
    fn at(&self, angle: f64) -> Slopes {
        let turns = angle / TAU;
        let steps = (turns - libm::floor(turns)) * f64::from(STEPS);
        let below = libm::floor(steps);
        let share = steps - below;
        #[expect(clippy::cast_possible_truncation, reason = "at most the number of steps")]
        #[expect(clippy::cast_sign_loss, reason = "not negative")]
        let index = below as usize % usize::from(STEPS);
        let of = |index: usize| self.table.get(index).copied().unwrap_or_default();
        let low = of(index);
        let high = of((index + 1) % usize::from(STEPS));
        let mix = |a: f64, b: f64| a + share * (b - a);
        Slopes {
            gain_db: mix(low.gain_db, high.gain_db),
            by_angle: mix(low.by_angle, high.by_angle),
            by_width: mix(low.by_width, high.by_width),
            by_depth: mix(low.by_depth, high.by_depth),
        }
    }
}

/// The receivers' floor: the power at which half the bursts are received, and its spread in dB.
#[derive(Clone, Copy, Debug)]
struct Floor {
    dbm: f64,
    width_db: f64,
}

/// An antenna's reading, or the power that it should have read and did not.
#[derive(Clone, Copy, Debug)]
enum Chance {
    Received(f64),
    Silent(f64),
}

impl Floor {
    /// Expected power where nothing was received, if the power without a floor is a Gaussian of
    /// `sigma_db` about `expected`.
    fn imputed(&self, expected: f64, sigma_db: f64) -> f64 {
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
    fn log_likelihood(&self, reading: Option<f64>, expected: f64, scale: f64) -> f64 {
        match reading {
            Some(reading) => log_student((reading - expected) / scale),
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
    fn fitted(self, chances: impl Iterator<Item = Chance> + Clone, sigma_db: f64) -> Self {
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
