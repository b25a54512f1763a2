use foxhunt_core::parameter::{ParameterError, finite, in_range, not_negative, positive};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

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
    pub(super) fn check(&self) -> Result<(), ParameterError> {
        not_negative("sigma_db", self.sigma_db)?;
        positive("correlation_m", self.correlation_m)?;
        Ok(())
    }
}

/// Something that reflects every beacon's signal to every drone: a wall, a mast, a car.
///
/// Its wave comes from where it is. Its phase follows from how much longer the way over it is, so
/// the level at a moving drone beats within half a wavelength.
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
    /// The angle by which the reflection itself turns the phase, in degrees; 180, as metal does,
    /// unless given.
    #[serde(default = "half_a_turn")]
    pub phase_deg: f64,
}

fn half_a_turn() -> f64 {
    180.0
}

impl ReflectorConfig {
    pub(super) fn check(&self) -> Result<(), ParameterError> {
        finite("east_m", self.east_m)?;
        finite("north_m", self.north_m)?;
        finite("up_m", self.up_m)?;
        not_negative("amplitude", self.amplitude)?;
        finite("phase_deg", self.phase_deg)?;
        Ok(())
    }
}

/// Waves that surroundings scatter: they come in beside the direct one from azimuths by chance, and
/// bend the pattern of a turn.
///
/// Every pattern draws its own, as its offset is drawn. Amplitudes are Rayleigh distributed, phases
/// uniform, and the mean power of all waves together is that of the law of propagation. The
/// envelope at an antenna without directions is therefore Rician, with the K-factor of the pattern.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ScatteringConfig {
    /// K: the power of the direct wave over the mean power of all scattered ones, in dB; the
    /// median over patterns.
    pub k_db: f64,
    /// σ of K over patterns in dB, which are drawn from a log-normal density; 0 unless given.
    #[serde(default)]
    pub k_sigma_db: f64,
    /// The number of scattered waves; 6 unless given.
    #[serde(default = "six")]
    pub waves: u8,
    /// σ of the waves' elevations in degrees: the ground scatters from below, roofs from above; 0,
    /// the horizon, unless given.
    #[serde(default)]
    pub elevation_sigma_deg: f64,
}

fn six() -> u8 {
    6
}

impl ScatteringConfig {
    pub(super) fn check(&self) -> Result<(), ParameterError> {
        in_range("k_db", self.k_db, -40.0..=60.0, "from -40 to 60")?;
        in_range("k_sigma_db", self.k_sigma_db, 0.0..=20.0, "from 0 to 20")?;
        in_range("waves", f64::from(self.waves), 1.0..=64.0, "from 1 to 64")?;
        let elevations = 0.0..=45.0;
        in_range("elevation_sigma_deg", self.elevation_sigma_deg, elevations, "from 0 to 45")?;
        Ok(())
    }
}

/// A place where nothing is received, such as one behind a wall, at any height.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DeadZoneConfig {
    /// East of its centre in metres.
    pub east_m: f64,
    /// North of its centre in metres.
    pub north_m: f64,
    /// Its radius over ground in metres.
    pub radius_m: f64,
}

impl DeadZoneConfig {
    pub(super) fn check(&self) -> Result<(), ParameterError> {
        finite("east_m", self.east_m)?;
        finite("north_m", self.north_m)?;
        positive("radius_m", self.radius_m)?;
        Ok(())
    }

    /// Returns true if the zone contains a place, East, North and Up in metres.
    pub(crate) fn contains(&self, place: &Vector3<f64>) -> bool {
        libm::hypot(place.x - self.east_m, place.y - self.north_m) <= self.radius_m
    }
}
