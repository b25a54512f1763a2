use std::sync::LazyLock;

use foxhunt_sensors::{PatternTable, PatternTableError};
use serde::{Deserialize, Serialize};

/// The antenna under every drone.
///
/// In a file `"reference-patch"`, or `{ table = [{ angle_deg = 0.0, gain_db = 8.0 }, …] }`. The
/// default is the reference patch.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum AntennaConfig {
    /// [`PatternTable::reference_patch`]: 70.1° half-power beamwidth, 17.0 dB front-to-back.
    #[default]
    ReferencePatch,
    /// Rows of increasing angle that span less than a turn; linear in dB in between, and from the
    /// last row round to the first.
    Table(Vec<GainRow>),
}

/// One row of an antenna's table.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GainRow {
    /// The angle off boresight in degrees, counter-clockwise seen from above.
    pub angle_deg: f64,
    /// The gain in dB; only differences between rows count, as the mean is taken off.
    pub gain_db: f64,
}

/// A thousand worlds of a campaign share its 1440 rows of powers and logarithms.
static REFERENCE_PATCH: LazyLock<PatternTable> = LazyLock::new(PatternTable::reference_patch);

impl AntennaConfig {
    pub(crate) fn build(&self) -> Result<PatternTable, PatternTableError> {
        match self {
            Self::ReferencePatch => Ok(REFERENCE_PATCH.clone()),
            Self::Table(rows) => {
                let rows: Vec<_> =
                    rows.iter().map(|r| (r.angle_deg.to_radians(), r.gain_db)).collect();
                PatternTable::from_rows(&rows)
            }
        }
    }
}
