//! The settings of what drones are made of: vehicles, antennas, and receivers of other quantities.

use foxhunt_core::parameter::{FieldError, ParameterError, finite, not_negative, positive};
use serde::{Deserialize, Serialize};

use crate::{Dynamics, Gains, Piloting, QuadrotorConfig, WindConfig, is_false};

/// The model of every drone's flight. A file has `kind = "kinematic"`, the default, or
/// `kind = "quadrotor"`, and the fields of that kind.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", try_from = "Fields")]
#[non_exhaustive]
pub enum VehicleConfig {
    /// A point that flies straight to its goal.
    Kinematic(KinematicConfig),
    /// A rigid body under its rotors, with an autopilot, in wind.
    Quadrotor(QuadrotorConfig),
}

/// Straight to the goal at constant speed; the nose stays or turns at a constant rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct KinematicConfig {
    /// The most it moves over ground, in metres per second.
    pub speed_mps: f64,
    /// The most it climbs or sinks, in metres per second.
    pub climb_mps: f64,
    /// True if its poses have a velocity; false unless given.
    #[serde(skip_serializing_if = "is_false")]
    pub reports_velocity: bool,
}

impl Default for KinematicConfig {
    /// 2 m/s over ground, 1 m/s up and down; poses without a velocity.
    fn default() -> Self {
        Self { speed_mps: 2.0, climb_mps: 1.0, reports_velocity: false }
    }
}

impl Default for VehicleConfig {
    /// The kinematic one.
    fn default() -> Self {
        Self::Kinematic(KinematicConfig::default())
    }
}

impl VehicleConfig {
    /// Returns true if the poses that it reports have a velocity.
    #[must_use]
    pub fn reports_velocity(&self) -> bool {
        match self {
            Self::Kinematic(config) => config.reports_velocity,
            Self::Quadrotor(config) => config.reports_velocity,
        }
    }

    pub(super) fn check(&self) -> Result<(), FieldError> {
        match self {
            Self::Kinematic(config) => {
                positive("speed_mps", config.speed_mps)?;
                positive("climb_mps", config.climb_mps)?;
                Ok(())
            }
            Self::Quadrotor(config) => config.check(),
        }
    }
}

/// The fields of either kind as they stand in a file, whose errors then name them.
#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Fields {
    kind: Kind,
    speed_mps: Option<f64>,
    climb_mps: Option<f64>,
    reports_velocity: bool,
    acceleration_mps2: Option<f64>,
    tilt_limit_deg: Option<f64>,
    thrust_limit: Option<f64>,
    yaw_limit_rad_s2: Option<f64>,
    drag_per_s: Option<f64>,
    rate_hz: Option<f64>,
    piloting: Option<Piloting>,
    dynamics: Option<Dynamics>,
    inertia_kg_m2: Option<[f64; 3]>,
    gains: Option<Gains>,
    wind: Option<WindConfig>,
}

#[derive(Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    #[default]
    Kinematic,
    Quadrotor,
}

impl TryFrom<Fields> for VehicleConfig {
    type Error = String;

    fn try_from(fields: Fields) -> Result<Self, String> {
        match fields.kind {
            Kind::Kinematic => {
                let foreign = [
                    ("acceleration_mps2", fields.acceleration_mps2.is_some()),
                    ("tilt_limit_deg", fields.tilt_limit_deg.is_some()),
                    ("thrust_limit", fields.thrust_limit.is_some()),
                    ("yaw_limit_rad_s2", fields.yaw_limit_rad_s2.is_some()),
                    ("drag_per_s", fields.drag_per_s.is_some()),
                    ("rate_hz", fields.rate_hz.is_some()),
                    ("piloting", fields.piloting.is_some()),
                    ("dynamics", fields.dynamics.is_some()),
                    ("inertia_kg_m2", fields.inertia_kg_m2.is_some()),
                    ("gains", fields.gains.is_some()),
                    ("wind", fields.wind.is_some()),
                ];
                if let Some((field, _)) = foreign.into_iter().find(|(_, given)| *given) {
                    return Err(format!("{field} is of a vehicle of kind = \"quadrotor\""));
                }
                let default = KinematicConfig::default();
                Ok(Self::Kinematic(KinematicConfig {
                    speed_mps: fields.speed_mps.unwrap_or(default.speed_mps),
                    climb_mps: fields.climb_mps.unwrap_or(default.climb_mps),
                    reports_velocity: fields.reports_velocity,
                }))
            }
            Kind::Quadrotor => {
                let default = QuadrotorConfig::default();
                Ok(Self::Quadrotor(QuadrotorConfig {
                    speed_mps: fields.speed_mps.unwrap_or(default.speed_mps),
                    climb_mps: fields.climb_mps.unwrap_or(default.climb_mps),
                    reports_velocity: fields.reports_velocity,
                    acceleration_mps2: fields
                        .acceleration_mps2
                        .unwrap_or(default.acceleration_mps2),
                    tilt_limit_deg: fields.tilt_limit_deg.unwrap_or(default.tilt_limit_deg),
                    thrust_limit: fields.thrust_limit.unwrap_or(default.thrust_limit),
                    yaw_limit_rad_s2: fields.yaw_limit_rad_s2.unwrap_or(default.yaw_limit_rad_s2),
                    drag_per_s: fields.drag_per_s.unwrap_or(default.drag_per_s),
                    rate_hz: fields.rate_hz.unwrap_or(default.rate_hz),
                    piloting: fields.piloting.unwrap_or(default.piloting),
                    dynamics: fields.dynamics.unwrap_or(default.dynamics),
                    inertia_kg_m2: fields.inertia_kg_m2,
                    gains: fields.gains.unwrap_or(default.gains),
                    wind: fields.wind.unwrap_or(default.wind),
                }))
            }
        }
    }
}

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

/// A receiver of three coils across each other, which measures the magnetic field up to its sign.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ThreeAxisConfig {
    /// σ of each axis, as a share of the field: its attitude, and how alike its coils are.
    pub share_sigma: f64,
    /// σ of each axis besides, in microamperes a metre: noise. Below three times this nothing is
    /// received.
    pub noise_ua_per_m: f64,
}

impl Default for ThreeAxisConfig {
    /// 5 % of the field, as of an attitude that is 2° off and coils that are alike to 4 %, and
    /// 0.5 nA/m, at which a beacon of the least strength is received some 45 m off.
    fn default() -> Self {
        Self { share_sigma: 0.05, noise_ua_per_m: 5e-4 }
    }
}

impl ThreeAxisConfig {
    /// Checks the ranges of all numbers.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the first that cannot.
    pub fn check(&self) -> Result<(), ParameterError> {
        positive("share_sigma", self.share_sigma)?;
        positive("noise_ua_per_m", self.noise_ua_per_m)?;
        Ok(())
    }

    /// σ of each axis where the field is that strong.
    #[must_use]
    pub fn sigma(&self, field_ua_per_m: f64) -> f64 {
        (self.share_sigma * field_ua_per_m).hypot(self.noise_ua_per_m)
    }

    /// The weakest field that is received.
    pub(crate) fn floor(&self) -> f64 {
        3.0 * self.noise_ua_per_m
    }
}

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
