//! A quadrotor that spins while it flies (Isaacs et al. 2014, §III, corrected): its settings, its
//! dynamics, and the air about it.

mod body;
mod rigid;

pub use body::Quadrotor;

use foxhunt_core::parameter::{
    FieldError, ParameterError, finite, in_range, not_negative, positive,
};
use nalgebra::Vector3;
use rand::{RngExt, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

use crate::is_false;

/// Standard gravity in m/s².
const GRAVITY: f64 = 9.806_65;

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
    /// The equations of motion.
    pub dynamics: Dynamics,
    /// Moments of inertia about the forward, left and up axes in kg m², of
    /// [`Dynamics::RigidBody`] alone; [`INERTIA_KG_M2`](Self::INERTIA_KG_M2) unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub inertia_kg_m2: Option<[f64; 3]>,
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

/// The equations of motion of a quadrotor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Dynamics {
    /// The simplified body, whose angles are three double integrators (Isaacs et al. 2014,
    /// eq. 3–8).
    #[default]
    Isaacs2014,
    /// The full rigid body with its moments of inertia (eq. 1 and 2).
    RigidBody,
}

/// Wind: a constant part and gusts, which are Dryden's to first order: each component is an
/// Ornstein-Uhlenbeck process, the vertical one half as strong (MIL-F-8785C, low altitude).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WindConfig {
    /// East of the wind, the way it blows to, in metres per second.
    pub east_mps: f64,
    /// North of the wind, the way it blows to, in metres per second.
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
    /// a second; forces and torques on the simplified body; still air; poses without a velocity.
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
            dynamics: Dynamics::Isaacs2014,
            inertia_kg_m2: None,
            gains: Gains::default(),
            wind: WindConfig::default(),
        }
    }
}

impl QuadrotorConfig {
    /// Default moments of inertia: a flat body of about half a kilogram, longer than wide.
    pub const INERTIA_KG_M2: [f64; 3] = [0.0022, 0.003, 0.0048];

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
        self.check_inertia()?;
        self.gains.check(most).map_err(|error| error.within("gains"))
    }

    /// Refuses moments of inertia that the dynamics does not use or that no body has.
    fn check_inertia(&self) -> Result<(), FieldError> {
        let Some(inertia) = self.inertia_kg_m2 else { return Ok(()) };
        let refused = |requirement| {
            let [x, y, z] = inertia;
            Err(FieldError::new("inertia_kg_m2", format!("[{x}, {y}, {z}]"), requirement))
        };
        if self.dynamics != Dynamics::RigidBody {
            return refused("left out unless dynamics = \"rigid-body\"");
        }
        if inertia.iter().any(|moment| !(1e-12..=1e12).contains(moment)) {
            return refused("three positive numbers");
        }
        // Σ m (y² + z²) + Σ m (x² + z²) ≥ Σ m (x² + y²), and so for each axis.
        let sum: f64 = inertia.iter().sum();
        if inertia.iter().any(|moment| 2.0 * moment > sum * (1.0 + 1e-9)) {
            return refused("the moments of a body, none above the sum of the other two");
        }
        Ok(())
    }
}

/// The controllers' gains: what acceleration, in m/s² or rad/s², an error of a metre or a radian
/// gives (`_p`), one that has lasted for a second (`_i`), and a speed of one per second (`_d`).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Gains {
    /// Altitude (eq. 9).
    pub altitude_p: f64,
    /// Altitude (eq. 9).
    pub altitude_d: f64,
    /// Heading (eq. 10).
    pub yaw_p: f64,
    /// Heading (eq. 10); a ramp needs it.
    pub yaw_i: f64,
    /// Heading (eq. 10).
    pub yaw_d: f64,
    /// Pitch and roll (eq. 19, 23).
    pub tilt_p: f64,
    /// Pitch and roll (eq. 19, 23).
    pub tilt_d: f64,
    /// Place (eq. 20, 24).
    pub place_p: f64,
    /// Place, against steady wind; 0 in the document.
    pub place_i: f64,
    /// Place (eq. 20, 24).
    pub place_d: f64,
}

impl Default for Gains {
    /// Altitude 16 and 8, yaw 48, 64 and 12 (three poles at −4 per second), tilt 225 and 30 (two
    /// at −15), place 5, 1.5 and 4: each critically damped or nearly so, and three to four times
    /// as fast as the loop around it.
    fn default() -> Self {
        Self {
            altitude_p: 16.0,
            altitude_d: 8.0,
            yaw_p: 48.0,
            yaw_i: 64.0,
            yaw_d: 12.0,
            tilt_p: 225.0,
            tilt_d: 30.0,
            place_p: 5.0,
            place_i: 1.5,
            place_d: 4.0,
        }
    }
}

impl Gains {
    /// Refuses what is not positive, or quicker than `most` per second.
    fn check(&self, most: f64) -> Result<(), ParameterError> {
        for (field, value) in [
            ("altitude_p", self.altitude_p),
            ("altitude_d", self.altitude_d),
            ("yaw_p", self.yaw_p),
            ("yaw_d", self.yaw_d),
            ("tilt_p", self.tilt_p),
            ("tilt_d", self.tilt_d),
            ("place_p", self.place_p),
            ("place_d", self.place_d),
        ] {
            positive(field, value)?;
            // A gain on a place goes with the square of its rate.
            in_range(field, value, 0.0..=most * most, "below the square of half of rate_hz")?;
        }
        for (field, value) in
            [("altitude_d", self.altitude_d), ("yaw_d", self.yaw_d), ("tilt_d", self.tilt_d)]
        {
            in_range(field, value, 0.0..=most, "below half of rate_hz")?;
        }
        not_negative("yaw_i", self.yaw_i)?;
        not_negative("place_i", self.place_i)?;
        Ok(())
    }
}

/// Place and attitude, and how fast each changes: heading ψ, pitch θ and roll φ as in a
/// [`Pose`](foxhunt_core::Pose), the heading not wrapped.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct State {
    position: Vector3<f64>,
    velocity: Vector3<f64>,
    /// ψ, θ, φ in radians.
    attitude: Vector3<f64>,
    /// Derivatives of the angles in radians per second.
    rates: Vector3<f64>,
}

/// The inputs of the rotors and the air, held over a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Inputs {
    /// Thrust over mass, along the body's up axis, in m/s².
    thrust: f64,
    /// Torque over inertia about ψ, θ and φ, in rad/s².
    torque: Vector3<f64>,
    /// The air's velocity over ground in m/s.
    wind: Vector3<f64>,
    /// Drag over mass and airspeed, per second.
    drag: f64,
}

impl State {
    /// The simplified rigid body (Isaacs et al. 2014, eq. 3–8), written in East-North-Up with the
    /// heading in the thrust, and with linear drag:
    ///
    /// ẍ = u (−sin θ cos φ cos ψ + sin φ sin ψ),
    /// ÿ = u (−sin θ cos φ sin ψ − sin φ cos ψ),
    /// z̈ = u cos θ cos φ − g, and ψ̈, θ̈, φ̈ = τ.
    fn derivative(&self, inputs: &Inputs) -> Self {
        let [heading, pitch, roll] = self.attitude.into();
        let forward = -libm::sin(pitch) * libm::cos(roll);
        let left = -libm::sin(roll);
        let sin = libm::sin(heading);
        let cos = libm::cos(heading);
        let thrust = Vector3::new(
            forward * cos - left * sin,
            forward * sin + left * cos,
            libm::cos(pitch) * libm::cos(roll),
        ) * inputs.thrust;
        let drag = (inputs.wind - self.velocity) * inputs.drag;
        Self {
            position: self.velocity,
            velocity: thrust + drag - Vector3::z() * GRAVITY,
            attitude: self.rates,
            rates: inputs.torque,
        }
    }

    /// One step of the classical Runge-Kutta method.
    fn step(&self, inputs: &Inputs, dt: f64) -> Self {
        let first = self.derivative(inputs);
        let second = self.after(&first, 0.5 * dt).derivative(inputs);
        let third = self.after(&second, 0.5 * dt).derivative(inputs);
        let fourth = self.after(&third, dt).derivative(inputs);
        self.after(&first, dt / 6.0)
            .after(&second, dt / 3.0)
            .after(&third, dt / 3.0)
            .after(&fourth, dt / 6.0)
    }

    /// The state after `dt` seconds of a constant change.
    fn after(&self, change: &Self, dt: f64) -> Self {
        Self {
            position: self.position + change.position * dt,
            velocity: self.velocity + change.velocity * dt,
            attitude: self.attitude + change.attitude * dt,
            rates: self.rates + change.rates * dt,
        }
    }

    /// The state `dt` seconds later if nothing accelerates it.
    fn coasting(&self, dt: f64) -> Self {
        let change = Self { position: self.velocity, attitude: self.rates, ..Self::default() };
        self.after(&change, dt)
    }
}

/// The air about one quadrotor.
#[derive(Clone, Debug)]
struct Wind {
    mean: Vector3<f64>,
    gust: Vector3<f64>,
    /// The share of a gust that is kept after a step, and σ of the new part.
    kept: f64,
    fresh: Vector3<f64>,
    rng: Xoshiro256PlusPlus,
}

impl Wind {
    /// Air that is drawn from `rng` every `dt` seconds.
    fn new(config: &WindConfig, dt: f64, mut rng: Xoshiro256PlusPlus) -> Self {
        let sigma = config.gust_sigma_mps * Vector3::new(1.0, 1.0, 0.5);
        let kept = libm::exp(-dt / config.gust_time_s);
        Self {
            mean: Vector3::new(config.east_mps, config.north_mps, 0.0),
            gust: sigma.component_mul(&normal(&mut rng)),
            kept,
            fresh: sigma * libm::sqrt(1.0 - kept * kept),
            rng,
        }
    }

    /// Returns the wind's velocity over the next step, in m/s.
    fn next(&mut self) -> Vector3<f64> {
        if self.fresh.x > 0.0 {
            let new = normal(&mut self.rng);
            self.gust = self.gust * self.kept + self.fresh.component_mul(&new);
        }
        self.mean + self.gust
    }
}

fn normal(rng: &mut Xoshiro256PlusPlus) -> Vector3<f64> {
    Vector3::from_fn(|_, _| rng.sample(StandardNormal))
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use foxhunt_core::Pose;
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn thrust_acts_along_the_up_axis_of_the_pose() {
        let attitude = Vector3::new(2.0, 0.3, -0.4);
        let state = State { attitude, ..State::default() };
        let inputs = Inputs { thrust: 12.0, ..Inputs::default() };
        let pose = Pose { heading: 2.0, pitch: 0.3, roll: -0.4, ..Pose::default() };
        let felt = state.derivative(&inputs).velocity + Vector3::z() * GRAVITY;
        assert!((pose.to_body(&felt) - Vector3::z() * 12.0).norm() < 1e-12);
    }

    #[test]
    fn a_fall_through_air_is_the_exact_one() {
        let inputs = Inputs { drag: 0.5, ..Inputs::default() };
        let mut state = State::default();
        for _ in 0..1000 {
            state = state.step(&inputs, 0.005);
        }
        // v = −(g / k) (1 − e^(−k t)), 5 s.
        let exact = -GRAVITY / 0.5 * (1.0 - (-2.5_f64).exp());
        assert_abs_diff_eq!(state.velocity.z, exact, epsilon = 1e-10);
    }

    #[test]
    fn gusts_have_their_deviation_and_their_time() {
        let config = WindConfig {
            east_mps: 3.0,
            gust_sigma_mps: 1.5,
            gust_time_s: 0.5,
            ..WindConfig::default()
        };
        let dt = 0.01;
        let mut wind = Wind::new(&config, dt, Xoshiro256PlusPlus::seed_from_u64(4));
        let east: Vec<f64> = (0..400_000).map(|_| wind.next().x - 3.0).collect();
        // 4000 s are 4000 independent gusts of 2 · 0.5 s: σ² to 2.2 % with one standard
        // deviation, and a band of 4.
        let n = 400_000.0;
        let variance = east.iter().map(|v| v * v).sum::<f64>() / n;
        assert_abs_diff_eq!(variance / 2.25, 1.0, epsilon = 0.09);
        let later: f64 = east.iter().zip(&east[50..]).map(|(a, b)| a * b).sum::<f64>() / n;
        assert_abs_diff_eq!(later / variance, (-1.0_f64).exp(), epsilon = 0.09);
    }
}
