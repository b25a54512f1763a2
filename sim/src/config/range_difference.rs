use foxhunt_core::parameter::{ParameterError, finite, positive};
use serde::{Deserialize, Serialize};

/// Receiver that shares its clock with a reference receiver, and measures how much farther a beacon
/// is from it than from the reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RangeDifferenceConfig {
    /// Place of the reference receiver: East, North and Up in metres.
    pub reference_m: [f64; 3],
    /// σ of a difference in metres, the arrivals' times and both receivers' places in it.
    pub sigma_m: f64,
}

impl RangeDifferenceConfig {
    /// Checks the range of every number.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the first that is out of range.
    pub fn check(&self) -> Result<(), ParameterError> {
        for coordinate in self.reference_m {
            finite("reference_m", coordinate)?;
        }
        positive("sigma_m", self.sigma_m)?;
        Ok(())
    }
}
