//! The radio channel between beacons and drones, and what bends it: shadowing, reflectors,
//! scattering and dead zones.

use foxhunt_core::parameter::{
    FieldError, ParameterError, finite, in_range, not_negative, positive, probability,
};
use foxhunt_sensors::{AntennaConfig, LogDistance};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::PathLossConfig;

/// The radio channel between a beacon's power and a drone's reading.
///
/// A sample is P(d) + G − Ḡ + the place's shadowing + the pattern's offset + the sample's
/// noise, all in dB: the power P by the law of propagation; the antenna's gain G for the direction
/// in which the beacon lies from the drone's body, in azimuth and elevation, with the waves of the
/// reflectors and the scattered ones added to the direct one in amplitude; and the mean Ḡ of the
/// gain over a level turn, in dB, so that the mean over such a turn follows the law. Then come the
/// receiver's noise, its rounding, its floor, and losses.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ChannelConfig {
    /// The law of propagation, over the slant range.
    pub path_loss: PathLossConfig,
    /// The frequency that beacons send at, in MHz: what reflections and the laws that need a
    /// wavelength are computed with.
    pub frequency_mhz: f64,
    /// Shadowing that belongs to places; no shadowing if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shadowing: Option<ShadowingConfig>,
    /// The reflectors.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub reflectors: Vec<ReflectorConfig>,
    /// Waves scattered by the surroundings, drawn for each pattern; none if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scattering: Option<ScatteringConfig>,
    /// The places where nothing is received.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub dead_zones: Vec<DeadZoneConfig>,
    /// The antenna under every drone.
    pub antenna: AntennaConfig,
    /// σ in dB of the offset that all samples of a pattern share.
    pub pattern_sigma_db: f64,
    /// σ in dB of each sample's own noise.
    pub sample_sigma_db: f64,
    /// σ in degrees of the angle by which a whole pattern is turned.
    pub bearing_sigma_deg: f64,
    /// True if a pattern's offset and angle belong to the place, as a site's do: all turns of a
    /// drone that stays within half a metre have the same. Else each round has its own.
    #[serde(skip_serializing_if = "core::ops::Not::not")]
    pub patterns_stay: bool,
    /// The power in dBm of the receiver's noise in the bandwidth of a pulse or an answer, which
    /// adds to it as a wave of random phase: a sample of power P has E/N0 = P over it. Readings
    /// have its mean taken off, as detectors do. Absent for a receiver without noise of its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise_dbm: Option<f64>,
    /// The receiver reports whole dB, rounded half away from zero.
    pub whole_db: bool,
    /// An answer that would read less than this, in dBm, is not received; absent for a receiver
    /// that receives everything.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub floor_dbm: Option<f64>,
    /// The share of answers that are lost whatever their power.
    pub loss_probability: f64,
}

impl Default for ChannelConfig {
    /// The simulation of Pritzl 2018, §6.1, its noise read as standard deviations: 4 dB for each
    /// pattern, 2 dB for each sample, 30° for each pattern's direction; the law of the open field
    /// (−29.06 dBm, 2.765; §7.1); patterns of one round; the reference patch; 2440 MHz; neither
    /// shadowing, reflectors, scattering nor dead zones, no noise of the receiver, no rounding, no
    /// floor, no losses.
    fn default() -> Self {
        Self {
            path_loss: LogDistance::pritzl2018_field().into(),
            frequency_mhz: 2440.0,
            shadowing: None,
            reflectors: Vec::new(),
            scattering: None,
            dead_zones: Vec::new(),
            antenna: AntennaConfig::ReferencePatch,
            pattern_sigma_db: 4.0,
            sample_sigma_db: 2.0,
            bearing_sigma_deg: 30.0,
            patterns_stay: false,
            noise_dbm: None,
            whole_db: false,
            floor_dbm: None,
            loss_probability: 0.0,
        }
    }
}

impl ChannelConfig {
    /// All but path loss and antenna, which are checked where they are made.
    pub(super) fn check(&self) -> Result<(), FieldError> {
        let requirement = "a positive number, at most 1e6";
        in_range("frequency_mhz", self.frequency_mhz, 1e-3..=1e6, requirement)?;
        if let Some(shadowing) = &self.shadowing {
            shadowing.check().map_err(|error| error.within("shadowing"))?;
        }
        for (index, reflector) in self.reflectors.iter().enumerate() {
            reflector.check().map_err(|error| error.within(format_args!("reflectors[{index}]")))?;
        }
        if let Some(scattering) = &self.scattering {
            scattering.check().map_err(|error| error.within("scattering"))?;
        }
        for (index, zone) in self.dead_zones.iter().enumerate() {
            let within = format_args!("dead_zones[{index}]");
            zone.check().map_err(|error| error.within(within))?;
        }
        not_negative("pattern_sigma_db", self.pattern_sigma_db)?;
        not_negative("sample_sigma_db", self.sample_sigma_db)?;
        not_negative("bearing_sigma_deg", self.bearing_sigma_deg)?;
        for (field, level) in [("noise_dbm", self.noise_dbm), ("floor_dbm", self.floor_dbm)] {
            level.map_or(Ok(0.0), |level| finite(field, level))?;
        }
        probability("loss_probability", self.loss_probability)?;
        Ok(())
    }
}

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
    fn check(&self) -> Result<(), ParameterError> {
        not_negative("sigma_db", self.sigma_db)?;
        positive("correlation_m", self.correlation_m)?;
        Ok(())
    }
}

/// Something that reflects every beacon's signal to every drone: a wall, a mast, a car.
///
/// The reflected wave comes from the reflector's place. Its phase follows from the extra length of
/// its way, so the level at a moving drone beats within half a wavelength.
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

impl ReflectorConfig {
    fn check(&self) -> Result<(), ParameterError> {
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

impl ScatteringConfig {
    fn check(&self) -> Result<(), ParameterError> {
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
    /// Radius of the zone over ground in metres.
    pub radius_m: f64,
}

impl DeadZoneConfig {
    fn check(&self) -> Result<(), ParameterError> {
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

fn half_a_turn() -> f64 {
    180.0
}

fn six() -> u8 {
    6
}
