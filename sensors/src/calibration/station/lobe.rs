use alloc::vec::Vec;
use core::f64::consts::{PI, TAU};

use crate::extractor::lobe_db;

/// Steps of the table over the circle.
const STEPS: u16 = 720;

/// Step of the differences, in radians, logarithms and dB.
const H: f64 = 0.01;

/// Ranges of a lobe that is fitted.
const BEAMWIDTHS: [f64; 2] = [0.2, 3.0];
const FRONT_TO_BACKS_DB: [f64; 2] = [3.0, 40.0];

/// Gain of the shared lobe at an angle, and its slopes.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Slopes {
    pub(super) gain_db: f64,
    /// By the angle, in dB/rad.
    pub(super) by_angle: f64,
    /// By the logarithm of the beamwidth.
    pub(super) by_width: f64,
    /// By the front-to-back ratio.
    pub(super) by_depth: f64,
}

/// The lobe that all antennas share, as a table over the circle.
#[derive(Clone, Debug)]
pub(super) struct Lobe {
    pub(super) beamwidth: f64,
    pub(super) front_to_back_db: f64,
    table: Vec<Slopes>,
}

impl Lobe {
    /// Creates the lobe of these parameters, moved into the ranges of a lobe that is fitted.
    pub(super) fn new(beamwidth: f64, front_to_back_db: f64) -> Self {
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
    pub(super) fn at(&self, angle: f64) -> Slopes {
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

/// Largest standard deviation of an angle: a uniform one over the circle.
pub(super) const UNIFORM_SIGMA: f64 = PI / 1.732_050_807_568_877_2;
