use std::{
    sync::{Arc, LazyLock},
    vec::Vec,
};

use super::{Antenna, PatternTable, PatternTableError};

/// An antenna that is shared by those who hear through it and those who know it.
pub type SharedAntenna = Arc<dyn Antenna + Send + Sync>;

/// An antenna chosen at run time.
///
/// In a file `"reference-patch"`, or `{ table = [{ angle_deg = 0.0, gain_db = 8.0 }, …] }`. The
/// default is the reference patch.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum AntennaConfig {
    /// [`PatternTable::reference_patch`]: 70.1° half-power beamwidth, 17.0 dB front-to-back.
    #[default]
    ReferencePatch,
    /// Rows of increasing angle that span less than a turn; the gain is the same at every
    /// elevation.
    Table(Vec<GainRow>),
}

/// One row of an antenna's table.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct GainRow {
    /// The angle off boresight in degrees, counter-clockwise seen from above.
    pub angle_deg: f64,
    /// The gain in dB.
    pub gain_db: f64,
}

/// A thousand worlds of a campaign share its 1440 rows of powers and logarithms.
static REFERENCE_PATCH: LazyLock<SharedAntenna> =
    LazyLock::new(|| Arc::new(PatternTable::reference_patch()));

impl AntennaConfig {
    /// Builds the antenna.
    ///
    /// # Errors
    ///
    /// [`PatternTableError`] names the row that is not finite or out of order.
    pub fn build(&self) -> Result<SharedAntenna, PatternTableError> {
        match self {
            Self::ReferencePatch => Ok(Arc::clone(&REFERENCE_PATCH)),
            Self::Table(rows) => {
                let rows: Vec<_> =
                    rows.iter().map(|r| (r.angle_deg.to_radians(), r.gain_db)).collect();
                Ok(Arc::new(PatternTable::from_rows(&rows)?))
            }
        }
    }
}
