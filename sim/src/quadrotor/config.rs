use foxhunt_core::parameter::{FieldError, finite, in_range, not_negative, positive};
use serde::{Deserialize, Serialize};

use super::Gains;
use crate::is_false;

/// A quadrotor and its autopilot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct QuadrotorConfig {
    /// The most it is ordered to move over ground, in metres per second.
    pub speed_mps: f64,
    /// The most it is ordered to climb or sink, in metres per second.
    pub climb_mps: f64,
    /// True if its poses have a velocity; false unless given.
    #[serde(skip_serializing_if = "is_false")]
    pub reports_velocity: bool,
    /// The most its ordered speed changes, in m/s².
    pub acceleration_mps2: f64,
    /// The most it is ordered to tilt, in degrees, so that enough of the rotors' power is left for
    /// yaw.
    pub tilt_limit_deg: f64,
    /// The most thrust, in units of the weight.
    pub thrust_limit: f64,
    /// The most angular acceleration about the body's up axis, in rad/s².
    pub yaw_limit_rad_s2: f64,
    /// Drag over mass and airspeed, per second.
    pub drag_per_s: f64,
    /// Steps of dynamics and control in a second.
    pub rate_hz: f64,
    /// The kind of the autopilot's commands.
    pub piloting: Piloting,
    /// The controllers' gains.
    pub gains: Gains,
    /// The air that it flies through.
    pub wind: WindConfig,
}

/// The kind of commands that an autopilot gives to the airframe.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Piloting {
    /// Thrust and torques (Isaacs et al. 2014, eq. 9 and 10).
    #[default]
    Forces,
    /// A climb rate and a yaw rate, as an AR.Drone takes them (eq. 26 and 27), which controllers
    /// on board turn into thrust and torque.
    Velocities,
}

/// Wind: a constant part and gusts, which are Dryden's to first order: each component is an
/// Ornstein-Uhlenbeck process, the vertical one half as strong (MIL-F-8785C, low altitude).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WindConfig {
    /// East of the wind, the way it blows to, in metres per second.
    pub east_mps: f64,
    /// Its North in metres per second.
    pub north_mps: f64,
    /// σ of the gusts' East and North in metres per second.
    pub gust_sigma_mps: f64,
    /// Time after which a gust is another one, in seconds.
    pub gust_time_s: f64,
}

impl Default for WindConfig {
    /// Still air; gusts, where there are some, of 2 s.
    fn default() -> Self {
        Self { east_mps: 0.0, north_mps: 0.0, gust_sigma_mps: 0.0, gust_time_s: 2.0 }
    }
}

impl Default for QuadrotorConfig {
    /// A small quadrotor: 2 m/s over ground and 1 m/s up, reached with 1 m/s²; a tilt of 20°, a
    /// thrust of two weights, 40 rad/s² about up; a drag that slows it down in 5 s; 400 steps in
    /// a second; forces and torques; still air; poses without a velocity.
    fn default() -> Self {
        Self {
            speed_mps: 2.0,
            climb_mps: 1.0,
            reports_velocity: false,
            acceleration_mps2: 1.0,
            tilt_limit_deg: 20.0,
            thrust_limit: 2.0,
            yaw_limit_rad_s2: 40.0,
            drag_per_s: 0.2,
            rate_hz: 400.0,
            piloting: Piloting::Forces,
            gains: Gains::default(),
            wind: WindConfig::default(),
        }
    }
}

impl QuadrotorConfig {
    /// Refuses numbers that no quadrotor flies with.
    pub(crate) fn check(&self) -> Result<(), FieldError> {
        positive("speed_mps", self.speed_mps)?;
        positive("climb_mps", self.climb_mps)?;
        positive("acceleration_mps2", self.acceleration_mps2)?;
        in_range("tilt_limit_deg", self.tilt_limit_deg, 1.0..=60.0, "in 1 … 60")?;
        in_range("thrust_limit", self.thrust_limit, 1.2..=10.0, "in 1.2 … 10")?;
        positive("yaw_limit_rad_s2", self.yaw_limit_rad_s2)?;
        in_range("rate_hz", self.rate_hz, 100.0..=10_000.0, "in 100 … 10 000")?;
        finite("wind.east_mps", self.wind.east_mps)?;
        finite("wind.north_mps", self.wind.north_mps)?;
        not_negative("wind.gust_sigma_mps", self.wind.gust_sigma_mps)?;
        positive("wind.gust_time_s", self.wind.gust_time_s)?;
        // What is quicker than half the rate is beyond the integration's stability.
        let most = 0.5 * self.rate_hz;
        in_range("drag_per_s", self.drag_per_s, 0.0..=most, "below half of rate_hz")?;
        self.gains.check(most).map_err(|error| error.within("gains"))
    }
}
