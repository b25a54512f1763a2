use foxhunt_core::parameter::{FieldError, finite, in_range, not_negative, probability};
use foxhunt_sensors::{AntennaConfig, LogDistance};
use serde::{Deserialize, Serialize};

use super::{DeadZoneConfig, PathLossConfig, ReflectorConfig, ScatteringConfig, ShadowingConfig};

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
