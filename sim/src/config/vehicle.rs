use foxhunt_core::parameter::{FieldError, positive};
use serde::{Deserialize, Serialize};

use crate::{Gains, Piloting, QuadrotorConfig, WindConfig, is_false};

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
                    gains: fields.gains.unwrap_or(default.gains),
                    wind: fields.wind.unwrap_or(default.wind),
                }))
            }
        }
    }
}
