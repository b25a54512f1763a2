use alloc::vec::Vec;
use core::f64::consts::TAU;

use super::{Antenna, PatternTableError, spline::PeriodicSpline};

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

/// Three rows are the fewest that go round.
const FEWEST: usize = 3;

/// The least step from row to row, in radians: nearer ones would give one direction two gains.
const LEAST_STEP: f64 = 1e-6;

/// No gain is beyond this, in dB.
const LARGEST_GAIN_DB: f64 = 1000.0;

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
