use serde::{Deserialize, Serialize};

/// Quality of a GNSS receiver's position, from no position to centimetres.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum FixQuality {
    /// There is no position.
    #[default]
    None,
    /// Dead reckoning, typed in by hand, or simulated by the receiver.
    Estimated,
    /// The satellites alone.
    Autonomous,
    /// With corrections of the ranges: SBAS or DGNSS.
    Differential,
    /// With corrections of the carrier's phase, its ambiguities not yet resolved: decimetres.
    RtkFloat,
    /// With corrections of the carrier's phase, its ambiguities resolved: centimetres.
    RtkFixed,
}

impl FixQuality {
    /// The common name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Estimated => "estimated",
            Self::Autonomous => "autonomous",
            Self::Differential => "differential",
            Self::RtkFloat => "RTK float",
            Self::RtkFixed => "RTK fixed",
        }
    }
}
