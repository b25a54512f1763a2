use serde::{Deserialize, Serialize};

use super::check::{finite, not_negative, positive};
use crate::SimError;

/// Shadowing that belongs to places: the level's departure from the law of propagation, the same
/// whenever a drone comes back, and alike nearby.
///
/// For each beacon a Gaussian field over East, North and Up with the correlation e^(−d/D) at the
/// distance d (Gudmundson 1991).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShadowingConfig {
    /// The standard deviation in dB.
    pub sigma_db: f64,
    /// D: where the correlation is e⁻¹, in metres.
    pub correlation_m: f64,
}

impl ShadowingConfig {
    pub(super) fn check(&self) -> Result<(), SimError> {
        not_negative("channel.shadowing.sigma_db", self.sigma_db)?;
        positive("channel.shadowing.correlation_m", self.correlation_m)
    }
}

/// Something that reflects every beacon's signal to every drone: a wall, a mast, a car.
///
/// Its wave comes from where it is. Its phase follows from how much longer the way over it is, so
/// what a moving drone hears beats within half a wavelength.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReflectorConfig {
    /// East in metres.
    pub east_m: f64,
    /// North in metres.
    pub north_m: f64,
    /// Height in metres; 0 unless given.
    #[serde(default)]
    pub up_m: f64,
    /// The amplitude of its wave over that of the direct one, wherever the drone is.
    pub amplitude: f64,
    /// By how much the reflection itself turns the phase, in degrees; 180, as metal does, unless
    /// given.
    #[serde(default = "half_a_turn")]
    pub phase_deg: f64,
}

fn half_a_turn() -> f64 {
    180.0
}

impl ReflectorConfig {
    pub(super) fn check(&self, index: usize) -> Result<(), SimError> {
        let field = |name: &str| format!("channel.reflectors[{index}].{name}");
        finite(field("east_m"), self.east_m)?;
        finite(field("north_m"), self.north_m)?;
        finite(field("up_m"), self.up_m)?;
        not_negative(field("amplitude"), self.amplitude)?;
        finite(field("phase_deg"), self.phase_deg)
    }
}
