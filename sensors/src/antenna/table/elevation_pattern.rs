use alloc::vec::Vec;
use core::f64::consts::FRAC_PI_2;

use foxhunt_core::parameter::{ParameterError, finite, require};

use super::{Antenna, spline::PeriodicSpline};

/// An antenna's mean gain over a turn by elevation: its vertical pattern as a level over a turn
/// knows it, in dB over that on the horizon.
///
/// A periodic cubic spline over the great circle through both poles, in steps of 1°.
///
/// ```
/// use foxhunt_sensors::{Dipole, ElevationPattern};
/// let pattern = ElevationPattern::of(&Dipole);
/// assert!(pattern.gain_db(0.0).abs() < 1e-9 && pattern.gain_db(1.0) < -5.0);
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "Vec<f64>", into = "Vec<f64>"))]
pub struct ElevationPattern {
    spline: PeriodicSpline,
}

/// Number of elevations from pole to pole.
const ELEVATIONS: usize = 181;

impl ElevationPattern {
    /// The pattern of an antenna.
    #[must_use]
    pub fn of(antenna: &(impl Antenna + ?Sized)) -> Self {
        let level = antenna.mean_gain_db(0.0);
        let gain = |degree: i16| antenna.mean_gain_db(f64::from(degree).to_radians()) - level;
        Self::through((-90_i16..=90).map(gain).collect())
    }

    /// The pattern of a way from one antenna to another: the transmitter sees the receiver as far
    /// below its horizon as the receiver sees it above its own.
    ///
    /// ```
    /// use foxhunt_sensors::{Dipole, ElevationPattern};
    /// let dipole = ElevationPattern::of(&Dipole);
    /// let way = ElevationPattern::between(&dipole, &dipole);
    /// assert!((way.gain_db(0.7) - 2.0 * dipole.gain_db(0.7)).abs() < 1e-9);
    /// ```
    #[must_use]
    pub fn between(receiver: &Self, transmitter: &Self) -> Self {
        let from_above = transmitter.gains().into_iter().rev();
        Self::through(receiver.gains().into_iter().zip(from_above).map(|(a, b)| a + b).collect())
    }

    /// Through the gains at −90°, −89° … 90°.
    fn through(gains: Vec<f64>) -> Self {
        // Over a pole the elevations come again.
        let over = gains.iter().copied().chain(gains[1..ELEVATIONS - 1].iter().rev().copied());
        let rows: Vec<_> = (-90_i16..)
            .zip(over)
            .map(|(degree, gain)| (f64::from(degree).to_radians(), gain))
            .collect();
        Self { spline: PeriodicSpline::new(&rows) }
    }

    /// The gains at −90°, −89° … 90°, in dB.
    fn gains(&self) -> Vec<f64> {
        self.spline.values().take(ELEVATIONS).collect()
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

/// The gains at −90°, −89° … 90°, as they stand in files.
impl From<ElevationPattern> for Vec<f64> {
    fn from(pattern: ElevationPattern) -> Self {
        pattern.gains()
    }
}

impl TryFrom<Vec<f64>> for ElevationPattern {
    type Error = ParameterError;

    fn try_from(gains: Vec<f64>) -> Result<Self, ParameterError> {
        #[expect(clippy::cast_precision_loss, reason = "for the message")]
        let count = gains.len() as f64;
        require(gains.len() == ELEVATIONS, "the number of elevations", count, "181")?;
        for &gain in &gains {
            finite("a gain", gain)?;
        }
        Ok(Self::through(gains))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 0.1 dB a degree, more above the horizon.
    fn tilted(db_per_degree: f64) -> ElevationPattern {
        let gains: Vec<f64> = (-90_i16..=90).map(|e| db_per_degree * f64::from(e)).collect();
        gains.try_into().expect("181 of them")
    }

    #[test]
    fn a_transmitter_sees_the_receiver_from_the_other_side() {
        let way = ElevationPattern::between(&tilted(0.1), &tilted(0.3));
        for degrees in [-40.0_f64, 0.0, 25.0] {
            let gain = way.gain_db(degrees.to_radians());
            assert!((gain - (0.1 - 0.3) * degrees).abs() < 1e-6, "{degrees}: {gain}");
        }
        assert_eq!(Vec::from(way).len(), 181);
    }

    #[test]
    fn gains_that_make_no_pattern_are_refused() {
        assert!(ElevationPattern::try_from(Vec::from([0.0; 180])).is_err());
        let mut gains = Vec::from([0.0; 181]);
        gains[7] = f64::NAN;
        assert!(ElevationPattern::try_from(gains).is_err());
    }
}
