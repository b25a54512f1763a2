use alloc::vec::Vec;
use core::f64::consts::FRAC_PI_2;

use super::{Antenna, spline::PeriodicSpline};

/// How an antenna's mean gain over a turn depends on the elevation: its vertical pattern as a
/// level over a turn knows it, in dB over that on the horizon.
///
/// A periodic cubic spline over the great circle through both poles, in steps of 1°.
///
/// ```
/// use foxhunt_sensors::{Dipole, ElevationPattern};
/// let pattern = ElevationPattern::of(&Dipole);
/// assert!(pattern.gain_db(0.0).abs() < 1e-9 && pattern.gain_db(1.0) < -5.0);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ElevationPattern {
    spline: PeriodicSpline,
}

impl ElevationPattern {
    /// That of an antenna.
    #[must_use]
    pub fn of(antenna: &(impl Antenna + ?Sized)) -> Self {
        let level = antenna.mean_gain_db(0.0);
        let quarter: Vec<f64> = (-90_i16..=90)
            .map(|degree| antenna.mean_gain_db(f64::from(degree).to_radians()) - level)
            .collect();
        // Over a pole the elevations come again.
        let over = quarter.iter().copied().chain(quarter[1..180].iter().rev().copied());
        let rows: Vec<_> = (-90_i16..)
            .zip(over)
            .map(|(degree, gain)| (f64::from(degree).to_radians(), gain))
            .collect();
        Self { spline: PeriodicSpline::new(&rows) }
    }

    /// The mean gain at an elevation in radians over that on the horizon, in dB.
    #[must_use]
    pub fn gain_db(&self, elevation: f64) -> f64 {
        self.spline.at(elevation.clamp(-FRAC_PI_2, FRAC_PI_2))
    }

    /// Its derivative, in dB per radian.
    #[must_use]
    pub fn slope(&self, elevation: f64) -> f64 {
        self.spline.slope(elevation.clamp(-FRAC_PI_2, FRAC_PI_2))
    }
}
