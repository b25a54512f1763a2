use alloc::vec::Vec;

use super::{Antenna, PatternTable, PatternTableError};

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
