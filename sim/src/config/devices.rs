use foxhunt_core::parameter::{ParameterError, not_negative, positive};
use serde::{Deserialize, Serialize};

/// The speed of every drone's antenna and radio.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SimStepperConfig {
    /// The motor's speed in turning the antenna, in radians per second.
    pub rotator_speed_rad_s: f64,
    /// Time from a question to its answer, in seconds.
    pub radio_latency_s: f64,
}

impl Default for SimStepperConfig {
    /// 2 rad/s, with which half a turn fits the 2 s that the reference allows the first position
    /// of a turn; 10 ms from question to answer. A turn of 128 positions takes 11 s.
    fn default() -> Self {
        Self { rotator_speed_rad_s: 2.0, radio_latency_s: 0.01 }
    }
}

impl SimStepperConfig {
    pub(super) fn check(&self) -> Result<(), ParameterError> {
        positive("rotator_speed_rad_s", self.rotator_speed_rad_s)?;
        not_negative("radio_latency_s", self.radio_latency_s)?;
        Ok(())
    }
}
