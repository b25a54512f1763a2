//! Antennas whose gain is tabulated.

use alloc::vec::Vec;
use core::f64::consts::{FRAC_PI_2, TAU};

use foxhunt_core::parameter::{ParameterError, finite, require};

use super::{Antenna, gain::linear, spline::PeriodicSpline};

/// Three rows are the fewest that go round.
const FEWEST: usize = 3;

/// The least step from row to row, in radians: nearer ones would give one direction two gains.
const LEAST_STEP: f64 = 1e-6;

/// No gain is beyond this, in dB.
const LARGEST_GAIN_DB: f64 = 1000.0;

/// Number of elevations from pole to pole.
const ELEVATIONS: usize = 181;

/// Reason that rows make no antenna pattern.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PatternTableError {
    /// A turn cannot be read from so few rows.
    #[error("the antenna pattern has {rows} rows; it needs at least {needed}")]
    TooFew {
        /// Number of rows.
        rows: usize,
        /// Number of rows that are needed.
        needed: usize,
    },
    /// A number is NaN or infinite.
    #[error("row {row} of the antenna pattern has the {field} {value}, not a finite number")]
    NotFinite {
        /// Index of the row, from 0.
        row: usize,
        /// Name of its field.
        field: &'static str,
        /// Value of the field.
        value: f64,
    },
    /// A gain is beyond what any antenna has.
    #[error(
        "row {row} of the antenna pattern has the gain {gain} dB; it must be within ±{limit} dB"
    )]
    Gain {
        /// Index of the row, from 0.
        row: usize,
        /// Gain of the row in dB.
        gain: f64,
        /// The largest that is taken.
        limit: f64,
    },
    /// An elevation is beyond the poles.
    #[error("the elevation {elevation} rad in row {row} of the antenna pattern is beyond a pole")]
    Elevation {
        /// Index of the row, from 0.
        row: usize,
        /// Elevation of the row in radians.
        elevation: f64,
    },
    /// The angles do not increase, or by less than the least step.
    #[error("the angle {angle} rad in row {row} of the antenna pattern does not exceed the last")]
    Order {
        /// Index of the row, from 0.
        row: usize,
        /// Angle of the row in radians.
        angle: f64,
    },
    /// The angles span a turn or more, so that the last row repeats the first.
    #[error("the antenna pattern spans {span} rad; it must stay below a turn")]
    Span {
        /// Angle from the first row to the last, in radians.
        span: f64,
    },
}

/// An antenna's gain in dB over the angle off boresight, from a table that closes on itself. It is
/// the same at every elevation.
///
/// Between rows it follows the periodic cubic spline of the gains in dB, which has continuous
/// first and second derivatives. A spline rings beside a null that is one row wide, so it is kept
/// within the table's own range: never above the largest gain and never below the least.
///
/// ```
/// use foxhunt_sensors::PatternTable;
/// let patch = PatternTable::reference_patch();
/// assert!(patch.gain_db(0.0) > patch.gain_db(1.0));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct PatternTable {
    spline: PeriodicSpline,
    least: f64,
    largest: f64,
    mean: f64,
}

impl PatternTable {
    /// The pattern with `gains_db` at equal steps over a turn: the first on boresight, the next
    /// ones counter-clockwise.
    ///
    /// # Errors
    ///
    /// Names the gain that is out of range, or states that there are too few.
    pub fn equally_spaced(gains_db: &[f64]) -> Result<Self, PatternTableError> {
        #[expect(clippy::cast_precision_loss, reason = "a table has far fewer than 2^52 rows")]
        let step = TAU / gains_db.len() as f64;
        #[expect(clippy::cast_precision_loss, reason = "as above")]
        let rows: Vec<_> =
            gains_db.iter().enumerate().map(|(i, g)| (i as f64 * step, *g)).collect();
        Self::from_rows(&rows)
    }

    /// The pattern with rows of an angle off boresight in radians, counter-clockwise, and a gain in
    /// dB. The angles increase by at least 10⁻⁶ and span less than a turn.
    ///
    /// # Errors
    ///
    /// Names the row that is out of range or out of order, or states what the table lacks.
    pub fn from_rows(rows: &[(f64, f64)]) -> Result<Self, PatternTableError> {
        let [(origin, _), _, .., (last, _)] = *rows else {
            return Err(PatternTableError::TooFew { rows: rows.len(), needed: FEWEST });
        };
        let mut before = f64::NEG_INFINITY;
        for (row, &(angle, gain)) in rows.iter().enumerate() {
            for (field, value) in [("angle", angle), ("gain", gain)] {
                if !value.is_finite() {
                    return Err(PatternTableError::NotFinite { row, field, value });
                }
            }
            if gain.abs() > LARGEST_GAIN_DB {
                return Err(PatternTableError::Gain { row, gain, limit: LARGEST_GAIN_DB });
            }
            if angle - before < LEAST_STEP {
                return Err(PatternTableError::Order { row, angle });
            }
            before = angle;
        }
        let span = last - origin;
        if span > TAU - LEAST_STEP {
            return Err(PatternTableError::Span { span });
        }
        let spline = PeriodicSpline::new(rows);
        let least = spline.values().fold(f64::INFINITY, f64::min);
        let largest = spline.values().fold(f64::NEG_INFINITY, f64::max);
        let mean = spline.mean(|gain| gain.clamp(least, largest));
        Ok(Self { spline, least, largest, mean })
    }

    /// The gain in dB at `angle` radians off boresight, counter-clockwise.
    #[must_use]
    pub fn gain_db(&self, angle: f64) -> f64 {
        self.spline.at(angle).clamp(self.least, self.largest)
    }

    /// The rows: angles off boresight in radians, counter-clockwise, and gains in dB.
    pub fn rows(&self) -> impl Iterator<Item = (f64, f64)> {
        self.spline.angles().zip(self.spline.values())
    }
}

impl Antenna for PatternTable {
    fn gain_dbi(&self, azimuth: f64, _elevation: f64) -> f64 {
        self.gain_db(azimuth)
    }

    fn mean_gain_db(&self, _elevation: f64) -> f64 {
        self.mean
    }
}

impl PatternTable {
    /// A patch in the place of the reference's CW8DPA: 70.1° half-power beamwidth, 17.0 dB
    /// front-to-back ratio, side lobes at ±105°; in rows of 0.25°.
    ///
    /// These figures are ours: of the antenna the document prints nothing but a gain of 8 dBi
    /// (Pritzl 2018). The table holds the gain over its maximum, 0 dB on boresight, and is the
    /// same at every elevation, which a directivity of 6.67 dBi follows from. The 8 dBi are in the
    /// identified reference power, as only the gain over the mean of a turn counts.
    #[must_use]
    pub fn reference_patch() -> Self {
        const ROWS: u16 = 1440;
        let gain = |i| reference_gain_db(TAU * f64::from(i) / f64::from(ROWS));
        let gains: Vec<f64> = (0..ROWS).map(gain).collect();
        Self::equally_spaced(&gains).expect("the formula is finite at every angle")
    }
}

/// An antenna's gain in dBi over azimuth and elevation, from a table of both.
///
/// Over azimuth each row of the table is a [`PatternTable`], a periodic spline; from row to row the
/// gain is linear in dB over the elevation, and beyond the highest and the lowest row it stays what
/// it is there.
#[derive(Clone, Debug, PartialEq)]
pub struct PatternTable3d {
    /// Elevations in radians, increasing, and the gain round each.
    rows: Vec<(f64, PatternTable)>,
}

impl PatternTable3d {
    /// The pattern with rows of an elevation in radians and the gain over azimuth there. The
    /// elevations increase, from −π/2 to π/2 at most.
    ///
    /// # Errors
    ///
    /// Names the row whose elevation is not finite, out of range or out of order, or states that
    /// there is no row.
    pub fn from_rows(rows: Vec<(f64, PatternTable)>) -> Result<Self, PatternTableError> {
        if rows.is_empty() {
            return Err(PatternTableError::TooFew { rows: 0, needed: 1 });
        }
        let mut before = f64::NEG_INFINITY;
        for (row, &(elevation, _)) in rows.iter().enumerate() {
            if elevation.is_nan() {
                let field = "elevation";
                return Err(PatternTableError::NotFinite { row, field, value: elevation });
            }
            // A rounded degree more is still the pole.
            if elevation.abs() > core::f64::consts::FRAC_PI_2 + 1e-6 {
                return Err(PatternTableError::Elevation { row, elevation });
            }
            if elevation - before < 1e-6 {
                return Err(PatternTableError::Order { row, angle: elevation });
            }
            before = elevation;
        }
        Ok(Self { rows })
    }

    /// The value of `of` at an elevation, interpolated between the rows about it.
    fn between(&self, elevation: f64, of: impl Fn(&PatternTable) -> f64) -> f64 {
        let next = self.rows.partition_point(|(row, _)| *row <= elevation);
        match (next.checked_sub(1).map(|i| &self.rows[i]), self.rows.get(next)) {
            (Some((from, below)), Some((to, above))) => {
                let share = (elevation - from) / (to - from);
                (1.0 - share) * of(below) + share * of(above)
            }
            (Some((_, only)), None) | (None, Some((_, only))) => of(only),
            (None, None) => unreachable!("a table has rows"),
        }
    }
}

impl Antenna for PatternTable3d {
    fn gain_dbi(&self, azimuth: f64, elevation: f64) -> f64 {
        self.between(elevation, |row| row.gain_db(azimuth))
    }

    fn mean_gain_db(&self, elevation: f64) -> f64 {
        self.between(elevation, |row| row.mean_gain_db(0.0))
    }
}

/// An antenna known by its two principal cuts, as data sheets and vendor files have them.
///
/// Between the cuts it is their weighted sum in dB (Vasiliadis, Dimitriou & Sergiadis 2005, with
/// their k = 2): G = (w₁ H + w₂ V) / √(w₁² + w₂²), w₁ = v (1 − h), w₂ = h (1 −
/// v), with H and V the cuts relative to the maximum in dB and h and v the cuts as factors of
/// power. On either cut it is that cut, where they agree that the maximum lies. Only the half of
/// the vertical cut before the antenna enters. For two antennas of which the whole pattern is known
/// (NEC models of a panel and a five-element Yagi) it errs by 0.6 and 2.0 dB rms over the front
/// half of the sphere, by 3.2 and 5.5 dB over all of it.
#[derive(Clone, Debug, PartialEq)]
pub struct PrincipalCuts {
    /// Cut over azimuth, relative to the maximum.
    horizontal: PatternTable,
    /// Cut over elevation, relative to the maximum.
    vertical: PatternTable,
    gain_dbi: f64,
}

impl PrincipalCuts {
    /// The antenna with this gain in dBi at its maximum and these cuts relative to it, in dB: the
    /// horizontal one over azimuth counter-clockwise, the vertical one over elevation, up and over
    /// the top to the back.
    #[must_use]
    pub fn new(gain_dbi: f64, horizontal: PatternTable, vertical: PatternTable) -> Self {
        Self { horizontal, vertical, gain_dbi }
    }
}

impl Antenna for PrincipalCuts {
    fn gain_dbi(&self, azimuth: f64, elevation: f64) -> f64 {
        // A cut that rises above its maximum is at it.
        let horizontal = self.horizontal.gain_db(azimuth).min(0.0);
        let vertical = self.vertical.gain_db(elevation).min(0.0);
        let across = linear(horizontal);
        let up = linear(vertical);
        let weights = [up * (1.0 - across), across * (1.0 - up)];
        let length = libm::hypot(weights[0], weights[1]);
        let sum = if length > 0.0 {
            (horizontal * weights[0] + vertical * weights[1]) / length
        } else {
            0.0
        };
        self.gain_dbi + sum
    }
}

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

    /// Returns the derivative of the gain, in dB per radian.
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

/// The linear gain ((1 + cos a)/2)^7.3 + 10^−1.7 ((1 − cos a)/2)³ + 10^−1.85 × two von
/// Mises side lobes at ±105° (κ = 10, peak 1), in dB.
fn reference_gain_db(a: f64) -> f64 {
    const SIDE: f64 = 105.0 / 360.0 * TAU;
    let cos = libm::cos(a);
    let side = |at: f64| libm::exp(10.0 * (libm::cos(a - at) - 1.0));
    let main = libm::pow(0.5 * (1.0 + cos), 7.3);
    let back = libm::exp10(-1.7) * libm::pow(0.5 * (1.0 - cos), 3.0);
    10.0 * libm::log10(main + back + libm::exp10(-1.85) * (side(SIDE) + side(-SIDE)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Antenna;
    use approx::{abs_diff_eq, assert_abs_diff_eq};

    /// Our figures, so that the table cannot change unseen: no document prints them.
    #[test]
    fn the_table_has_our_figures() {
        let patch = PatternTable::reference_patch();
        let width = patch.half_power_beamwidth().expect("it is directional").to_degrees();
        assert_abs_diff_eq!(width, 70.1, epsilon = 0.1);
        assert_abs_diff_eq!(patch.front_to_back_db(), 17.0, epsilon = 0.1);
        assert_abs_diff_eq!(patch.directivity_dbi(), 6.67, epsilon = 0.01);
        assert_abs_diff_eq!(patch.gain_db(0.0), 0.0, epsilon = 1e-2);
    }

    #[test]
    fn between_rows_it_follows_the_formula() {
        // The fourth derivative is below 2000 dB/rad⁴ at the side lobes; times 5/384 of the step
        // to its fourth power.
        let patch = PatternTable::reference_patch();
        for i in 0..1000 {
            let a = f64::from(i) * 0.00637 - 3.0;
            assert!(abs_diff_eq!(patch.gain_db(a), reference_gain_db(a), epsilon = 1e-8), "at {a}");
            assert!(
                abs_diff_eq!(reference_gain_db(a), reference_gain_db(-a), epsilon = 1e-12),
                "left and right are the same"
            );
        }
    }

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
            assert_abs_diff_eq!(gain, (0.1 - 0.3) * degrees, epsilon = 1e-6);
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
