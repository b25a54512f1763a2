use alloc::vec::Vec;
use core::f64::consts::{PI, TAU};

use foxhunt_core::angle;

use super::{Antenna, PatternTableError};

/// An antenna's gain in dB over the angle off boresight, from a table that closes on itself;
/// between rows linear in dB. It is the same at every elevation.
///
/// ```
/// use foxhunt_sensors::PatternTable;
/// let patch = PatternTable::reference_patch();
/// assert!(patch.gain_db(0.0) > patch.gain_db(1.0));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct PatternTable {
    /// Offsets from the first row's angle, increasing from 0, below a turn.
    offsets: Vec<f64>,
    gains: Vec<f64>,
    /// The first row's angle.
    origin: f64,
}

/// Three rows are the fewest that go round.
const FEWEST: usize = 3;

impl PatternTable {
    /// The pattern with `gains_db` at equal steps over a turn: the first on boresight, the next
    /// ones counter-clockwise.
    ///
    /// # Errors
    ///
    /// Names the gain that is not finite, or says that there are too few.
    pub fn equally_spaced(gains_db: &[f64]) -> Result<Self, PatternTableError> {
        #[expect(clippy::cast_precision_loss, reason = "a table has far fewer than 2^52 rows")]
        let step = TAU / gains_db.len() as f64;
        #[expect(clippy::cast_precision_loss, reason = "as above")]
        let rows: Vec<_> =
            gains_db.iter().enumerate().map(|(i, g)| (i as f64 * step, *g)).collect();
        Self::from_rows(&rows)
    }

    /// The pattern with rows of an angle off boresight in radians, counter-clockwise, and a gain in
    /// dB. The angles increase and span less than a turn.
    ///
    /// # Errors
    ///
    /// Names the row that is not finite or out of order, or says what the table lacks.
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
            if angle <= before {
                return Err(PatternTableError::Order { row, angle });
            }
            before = angle;
        }
        let span = last - origin;
        if span >= TAU {
            return Err(PatternTableError::Span { span });
        }
        let (offsets, gains) = rows.iter().map(|(a, gain)| (a - origin, *gain)).unzip();
        Ok(Self { offsets, gains, origin })
    }

    /// The gain in dB at `angle` radians off boresight.
    #[must_use]
    pub fn gain_db(&self, angle: f64) -> f64 {
        let wrapped = angle::wrap(angle - self.origin);
        let offset = if wrapped < 0.0 { wrapped + TAU } else { wrapped };
        let next = self.offsets.partition_point(|&o| o <= offset);
        let (from, start) = self.row(next.saturating_sub(1));
        let (to, end) = self.row(next);
        start + (end - start) * ((offset - from) / (to - from))
    }

    /// The angle between the half-power points about the maximum, in radians; `None` where the
    /// gain never falls by half.
    #[must_use]
    pub fn half_power_beamwidth(&self) -> Option<f64> {
        let (peak, maximum) = self.peak();
        let level = maximum - 10.0 * core::f64::consts::LOG10_2;
        let rows = self.gains.len();
        let ahead = (0..rows).find_map(|i| self.crossing(peak + i, peak + i + 1, level))?;
        let behind =
            (0..rows).find_map(|i| self.crossing(peak + rows - i, peak + rows - i - 1, level))?;
        let (at, _) = self.row(peak);
        Some((ahead - at) + (at + TAU - behind))
    }

    /// The gain at the maximum over that opposite to it, in dB.
    #[must_use]
    pub fn front_to_back_db(&self) -> f64 {
        let (peak, maximum) = self.peak();
        maximum - self.gain_db(self.origin + self.row(peak).0 + PI)
    }

    /// The row with the largest gain: the maximum, as the gain is linear between rows.
    fn peak(&self) -> (usize, f64) {
        let first = (0, f64::NEG_INFINITY);
        self.gains
            .iter()
            .enumerate()
            .fold(first, |best, (i, &g)| if g > best.1 { (i, g) } else { best })
    }

    /// Row `i`, counted on round the turn: its offset and gain.
    fn row(&self, i: usize) -> (f64, f64) {
        let rows = self.gains.len();
        let turns = if i >= 2 * rows {
            2.0
        } else if i >= rows {
            1.0
        } else {
            0.0
        };
        (self.offsets[i % rows] + turns * TAU, self.gains[i % rows])
    }

    /// Where the gain falls through `level` between two neighbouring rows.
    fn crossing(&self, near: usize, far: usize, level: f64) -> Option<f64> {
        let ((from, start), (to, end)) = (self.row(near), self.row(far));
        (start >= level && end < level)
            .then(|| from + (to - from) * ((start - level) / (start - end)))
    }
}

impl Antenna for PatternTable {
    fn gain_dbi(&self, azimuth: f64, _elevation: f64) -> f64 {
        self.gain_db(azimuth)
    }

    fn mean_gain_db(&self, _elevation: f64) -> f64 {
        // Exact for what is linear between rows.
        let strip = |i| {
            let ((from, start), (to, end)) = (self.row(i), self.row(i + 1));
            0.5 * (start + end) * (to - from)
        };
        (0..self.gains.len()).map(strip).sum::<f64>() / TAU
    }
}
