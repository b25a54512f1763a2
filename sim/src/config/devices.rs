use serde::{Deserialize, Serialize};

use super::check::{not_negative, positive};
use crate::SimError;

/// How every drone flies: straight to its goal at constant speed, its nose where it was.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VehicleConfig {
    /// The most it moves over ground, in metres per second.
    pub speed_mps: f64,
    /// The most it climbs or sinks, in metres per second.
    pub climb_mps: f64,
}

impl Default for VehicleConfig {
    /// 2 m/s over ground, 1 m/s up and down.
    fn default() -> Self {
        Self { speed_mps: 2.0, climb_mps: 1.0 }
    }
}

impl VehicleConfig {
    pub(super) fn check(&self) -> Result<(), SimError> {
        positive("vehicle.speed_mps", self.speed_mps)?;
        positive("vehicle.climb_mps", self.climb_mps)
    }
}

/// How quick every drone's antenna and radio are.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SimStepperConfig {
    /// How fast the motor turns the antenna, in radians per second.
    pub rotator_speed_rad_s: f64,
    /// From a question to its answer, in seconds.
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
    pub(super) fn check(&self) -> Result<(), SimError> {
        positive("stepper.rotator_speed_rad_s", self.rotator_speed_rad_s)?;
        not_negative("stepper.radio_latency_s", self.radio_latency_s)
    }
}
