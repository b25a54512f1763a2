//! The flight of a quadrotor: the reference that it follows, and the controllers that follow it.

use foxhunt_core::{Pose, angle};
use nalgebra::{Vector2, Vector3};
use rand::rngs::Xoshiro256PlusPlus;

use super::{Dynamics, GRAVITY, Inputs, Piloting, QuadrotorConfig, State, Wind, rigid::RigidBody};
use crate::SimError;

/// The rate at which controllers on board of an AR.Drone make a commanded rate true, per second.
const ON_BOARD: f64 = 5.0;

/// A quadrotor with its autopilot: it flies to a goal, and may turn all the while (Isaacs et al.
/// 2014, §III).
///
/// Dynamics and control go in steps of their own, however long the steps of
/// [`advance`](Self::advance) are.
///
/// ```
/// use foxhunt_core::Pose;
/// use foxhunt_sim::{Quadrotor, QuadrotorConfig};
/// use nalgebra::Vector3;
/// use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};
///
/// let gusts = Xoshiro256PlusPlus::seed_from_u64(1);
/// let mut drone = Quadrotor::new(QuadrotorConfig::default(), Pose::at(0.0, 0.0, 4.0), gusts)?;
/// drone.go_to(Vector3::new(6.0, 0.0, 4.0))?;
/// drone.spin(Some(90.0_f64.to_radians()))?;
/// drone.advance(8.0);
/// assert!((drone.pose().position - Vector3::new(6.0, 0.0, 4.0)).norm() < 0.2);
/// assert!(drone.heading() > 10.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Quadrotor {
    config: QuadrotorConfig,
    state: State,
    /// The body of [`Dynamics::RigidBody`], of which `state` has the angles.
    rigid: Option<RigidBody>,
    reference: Reference,
    controller: Controller,
    wind: Wind,
    /// The time that has passed since the last step.
    since: f64,
    path_length: f64,
    /// The ordered speed over ground, in metres per second.
    cruise: f64,
}

impl Quadrotor {
    /// A quadrotor that hovers at a pose, which is taken to be level; its gusts are drawn from
    /// `gusts`.
    ///
    /// # Errors
    ///
    /// [`SimError::Field`] names what is out of range.
    pub fn new(
        config: QuadrotorConfig,
        pose: Pose,
        gusts: Xoshiro256PlusPlus,
    ) -> Result<Self, SimError> {
        config.check()?;
        let attitude = Vector3::new(pose.heading, 0.0, 0.0);
        let state = State { position: pose.position, attitude, ..State::default() };
        let rigid = match config.dynamics {
            Dynamics::Isaacs2014 => None,
            Dynamics::RigidBody => {
                let inertia = config.inertia_kg_m2.unwrap_or(QuadrotorConfig::INERTIA_KG_M2);
                Some(RigidBody::new(inertia, &state))
            }
        };
        let mut quadrotor = Self {
            config,
            state,
            rigid,
            reference: Reference::holding(pose.position, pose.heading),
            controller: Controller::default(),
            wind: Wind::new(&config.wind, 1.0 / config.rate_hz, gusts),
            since: 0.0,
            path_length: 0.0,
            cruise: config.speed_mps,
        };
        quadrotor.go_to(pose.position)?;
        Ok(quadrotor)
    }

    /// The drone's place, heading and tilt.
    #[must_use]
    pub fn pose(&self) -> Pose {
        let now = self.state.coasting(self.since);
        let [heading, pitch, roll] = now.attitude.into();
        Pose { position: now.position, heading: angle::wrap(heading), pitch, roll, velocity: None }
    }

    /// The drone's velocity, East, North and Up in metres per second.
    #[must_use]
    pub fn velocity(&self) -> Vector3<f64> {
        self.state.velocity
    }

    /// The drone's heading, in radians counter-clockwise from East, not wrapped: a turn more is 2π
    /// more.
    #[must_use]
    pub fn heading(&self) -> f64 {
        self.state.coasting(self.since).attitude.x
    }

    /// The place and the heading, not wrapped, that the drone should have.
    #[must_use]
    pub fn reference(&self) -> (Vector3<f64>, f64) {
        let Reference { position, velocity, heading, .. } = self.reference;
        (position + velocity * self.since, heading + self.reference.rate() * self.since)
    }

    /// Metres flown so far.
    #[must_use]
    pub fn path_length(&self) -> f64 {
        self.path_length
    }

    /// Sends it to a place; the nose goes on as it does.
    ///
    /// # Errors
    ///
    /// [`SimError::Goal`] for a goal that is not at a finite distance; the older one stays then.
    pub fn go_to(&mut self, goal: Vector3<f64>) -> Result<(), SimError> {
        if !(goal - self.state.position).norm().is_finite() {
            return Err(SimError::Goal { east: goal.x, north: goal.y, up: goal.z });
        }
        self.reference.go_to(goal);
        Ok(())
    }

    /// Turns the nose at a rate in radians per second, counter-clockwise if it is positive; or
    /// holds the heading.
    ///
    /// # Errors
    ///
    /// [`SimError::SpinRate`] for a rate that is not finite; it goes on as before then.
    pub fn spin(&mut self, rate: Option<f64>) -> Result<(), SimError> {
        let rate = rate.unwrap_or(0.0);
        if !rate.is_finite() {
            return Err(SimError::SpinRate { rate });
        }
        if rate.to_bits() != self.reference.rate().to_bits() {
            // From where it is: a ramp that went on elsewhere is no error to make up for.
            self.reference.turn(self.state.attitude.x, rate);
        }
        Ok(())
    }

    /// Puts it on the ground below, an Up of 0, level and at rest.
    #[cfg(feature = "emulators")]
    pub(crate) fn put_down(&mut self) {
        let mut position = self.state.position;
        let heading = self.state.attitude.x;
        position.z = 0.0;
        let attitude = Vector3::new(heading, 0.0, 0.0);
        self.state = State { position, attitude, ..State::default() };
        self.rigid = self.rigid.map(|body| body.put(&self.state));
        self.reference = Reference::holding(position, heading);
        self.controller = Controller::default();
    }

    /// Has it fly over ground at `speed` m/s, or as fast as it is configured to.
    #[cfg(feature = "emulators")]
    pub(crate) fn cruise(&mut self, speed: f64) {
        self.cruise = speed.min(self.config.speed_mps);
    }

    /// Lets `dt` seconds pass; a step that is negative or not finite passes no time.
    pub fn advance(&mut self, dt: f64) {
        let step = 1.0 / self.config.rate_hz;
        self.since += if dt.is_finite() { dt.max(0.0) } else { 0.0 };
        // A nanosecond is forgiven: time is a sum of steps.
        while self.since >= step - 1e-9 {
            self.since -= step;
            self.step(step);
        }
    }

    fn step(&mut self, dt: f64) {
        let mut inputs = self.controller.command(&self.config, &self.reference, &self.state, dt);
        inputs.wind = self.wind.next();
        let config = QuadrotorConfig { speed_mps: self.cruise, ..self.config };
        self.reference.advance(&config, dt);
        let before = self.state.position;
        self.state = match &mut self.rigid {
            None => self.state.step(&inputs, dt),
            Some(body) => {
                *body = body.step(&inputs, dt);
                body.state(self.state.attitude.x)
            }
        };
        self.path_length += (self.state.position - before).norm();
    }
}

/// The path that a quadrotor is requested to follow: from its place to its goal, with bounded speed
/// and change of speed; and the ramp of its heading.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Reference {
    goal: Vector3<f64>,
    position: Vector3<f64>,
    velocity: Vector3<f64>,
    acceleration: Vector3<f64>,
    /// The heading in radians, not wrapped.
    heading: f64,
    /// The slope of its ramp, in radians per second.
    rate: f64,
}

impl Reference {
    fn holding(position: Vector3<f64>, heading: f64) -> Self {
        let velocity = Vector3::zeros();
        let acceleration = Vector3::zeros();
        Self { goal: position, position, velocity, acceleration, heading, rate: 0.0 }
    }

    fn go_to(&mut self, goal: Vector3<f64>) {
        self.goal = goal;
    }

    /// Turns from `heading` on at `rate`.
    fn turn(&mut self, heading: f64, rate: f64) {
        (self.heading, self.rate) = (heading, rate);
    }

    /// The rate at which it turns, in radians per second.
    fn rate(&self) -> f64 {
        self.rate
    }

    fn advance(&mut self, config: &QuadrotorConfig, dt: f64) {
        self.heading += self.rate * dt;
        let way = self.goal - self.position;
        let distance = way.norm();
        let most = config.acceleration_mps2 * dt;
        if distance <= most * dt && self.velocity.norm() <= 2.0 * most {
            (self.position, self.velocity) = (self.goal, Vector3::zeros());
            self.acceleration = Vector3::zeros();
            return;
        }
        // The slower of the two sets the pace, so that the line is straight. On the goal, but
        // still moving, any direction will do, as nothing is wanted along it.
        let distance = distance.max(f64::MIN_POSITIVE);
        let over_ground = way.xy().norm() / distance;
        let climb = way.z.abs() / distance;
        let pace = (over_ground / config.speed_mps).max(climb / config.climb_mps);
        // Nine tenths of what it may do to slow down leave room to correct the course; near the
        // goal no faster than that a step does not pass it.
        let slowing = libm::sqrt(1.8 * config.acceleration_mps2 * distance);
        let wanted = way * ((1.0 / pace).min(slowing).min(distance / dt) / distance);
        let change = wanted - self.velocity;
        let change = change * (most / change.norm().max(most));
        self.velocity += change;
        self.acceleration = change / dt;
        self.position += self.velocity * dt;
    }
}

/// The controllers of Isaacs et al. 2014, §III, with what they have to remember.
///
/// Errors are reference minus state. What differs from the print: the derivative of (9) brakes;
/// (20) and (24) become angles by 1/g with the signs that East-North-Up gives them, and their
/// tangents are exact; the error of (10) is not wrapped; (26) brakes, too. A derivative acts on
/// the difference to the reference's own speed, but for the yaw's, as in the document.
#[derive(Clone, Copy, Debug, Default)]
struct Controller {
    /// ∫ of the place's error, in m s.
    place: Vector2<f64>,
    /// ∫ of the heading's error, in rad s.
    heading: f64,
}

impl Controller {
    /// The commands to the rotors for the next `dt` seconds.
    fn command(
        &mut self,
        config: &QuadrotorConfig,
        reference: &Reference,
        state: &State,
        dt: f64,
    ) -> Inputs {
        let [heading, pitch, roll] = state.attitude.into();
        let turning = state.rates.x;
        let level = libm::cos(pitch) * libm::cos(roll);
        let climb = self.climb(config, reference, state);
        let thrust = (GRAVITY + climb) / level.max(0.1);

        // The commanded tilt lies along the heading and across it (eq. 25), so it turns with the
        // body: the other way round, and that is its rate.
        let wanted = self.accelerate(config, reference, state, dt);
        let sin = libm::sin(heading);
        let cos = libm::cos(heading);
        let forward = wanted.x * cos + wanted.y * sin;
        let left = wanted.y * cos - wanted.x * sin;
        let pitched = -libm::atan(forward / GRAVITY);
        let rolled = -libm::atan(left * libm::cos(pitched) / GRAVITY);
        let tilting = Vector2::new(turning * rolled, -turning * pitched);
        let gains = &config.gains;
        let tilt = gains.tilt_p * Vector2::new(pitched - pitch, rolled - roll)
            + gains.tilt_d * (tilting - state.rates.yz());

        let yaw = self.yaw(config, reference, state, dt);
        Inputs {
            thrust: thrust.clamp(0.0, config.thrust_limit * GRAVITY),
            torque: Vector3::new(yaw, tilt.x, tilt.y),
            wind: Vector3::zeros(),
            drag: config.drag_per_s,
        }
    }

    /// The vertical acceleration in m/s² (eq. 9, or 26).
    fn climb(&self, config: &QuadrotorConfig, reference: &Reference, state: &State) -> f64 {
        let gains = &config.gains;
        let error = reference.position.z - state.position.z;
        let climb = state.velocity.z;
        let p = gains.altitude_p * error;
        let d = gains.altitude_d;
        let ahead = d * reference.velocity.z + reference.acceleration.z;
        match config.piloting {
            Piloting::Forces => p - d * climb + ahead,
            Piloting::Velocities => {
                // Twice the climb of the reference is enough for any correction.
                let most = 2.0 * config.climb_mps;
                on_board(commanded(p + ahead, d, climb).clamp(-most, most), climb)
            }
        }
    }

    /// The acceleration over ground in m/s², East and North (eq. 20, 24), within the tilt that is
    /// allowed.
    fn accelerate(
        &mut self,
        config: &QuadrotorConfig,
        reference: &Reference,
        state: &State,
        dt: f64,
    ) -> Vector2<f64> {
        let gains = &config.gains;
        let error = (reference.position - state.position).xy();
        let speed = (reference.velocity - state.velocity).xy();
        let wanted = gains.place_p * error
            + gains.place_i * self.place
            + gains.place_d * speed
            + reference.acceleration.xy();
        let most = GRAVITY * libm::tan(config.tilt_limit_deg.to_radians());
        let requested = wanted.norm();
        if requested > most {
            // What cannot be done is not remembered either.
            return wanted * (most / requested);
        }
        self.place += error * dt;
        wanted
    }

    /// The angular acceleration about up in rad/s² (eq. 10, or 27).
    fn yaw(
        &mut self,
        config: &QuadrotorConfig,
        reference: &Reference,
        state: &State,
        dt: f64,
    ) -> f64 {
        let gains = &config.gains;
        let error = reference.heading - state.attitude.x;
        let rate = state.rates.x;
        let requested = gains.yaw_p * error + gains.yaw_i * self.heading;
        let d = gains.yaw_d;
        let wanted = match config.piloting {
            Piloting::Forces => requested - d * rate,
            Piloting::Velocities => on_board(commanded(requested, d, rate), rate),
        };
        let most = config.yaw_limit_rad_s2;
        if wanted.abs() <= most {
            self.heading += error * dt;
        }
        wanted.clamp(-most, most)
    }
}

/// The commanded rate for an acceleration of `proportional` − `damping` · `rate` by controllers
/// on board: k_p e − k_d ẋ with k_d short of the braking that they do themselves (eq. 26, 27).
fn commanded(proportional: f64, damping: f64, rate: f64) -> f64 {
    proportional / ON_BOARD - (damping / ON_BOARD - 1.0) * rate
}

/// The acceleration that the controllers on board make of a commanded rate.
fn on_board(commanded: f64, rate: f64) -> f64 {
    ON_BOARD * (commanded - rate)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn it_arrives_within_its_limits_and_stays() {
        let config = QuadrotorConfig::default();
        let dt = 1.0 / config.rate_hz;
        let mut reference = Reference::holding(Vector3::new(1.0, 2.0, 3.0), 0.0);
        for goal in [Vector3::new(9.0, -4.0, 4.0), Vector3::new(9.0, -4.0, 0.5)] {
            // A first goal elsewhere: the way bends.
            reference.go_to(Vector3::new(-5.0, 2.0, 3.0));
            (0..800).for_each(|_| reference.advance(&config, dt));
            reference.go_to(goal);
            for _ in 0..8000 {
                reference.advance(&config, dt);
                assert!(reference.velocity.xy().norm() <= config.speed_mps * (1.0 + 1e-9));
                assert_abs_diff_eq!(
                    reference.velocity.z,
                    0.0,
                    epsilon = config.climb_mps * (1.0 + 1e-9)
                );
                assert!(reference.acceleration.norm() <= config.acceleration_mps2 * (1.0 + 1e-9));
            }
            assert_eq!((reference.position, reference.velocity), (goal, Vector3::zeros()));
        }
    }

    #[test]
    fn it_comes_back_to_where_it_is_ordered_to_stop() {
        let config = QuadrotorConfig::default();
        let dt = 1.0 / config.rate_hz;
        let mut reference = Reference::holding(Vector3::zeros(), 0.0);
        reference.go_to(Vector3::new(20.0, 0.0, 0.0));
        (0..800).for_each(|_| reference.advance(&config, dt));
        let here = reference.position;
        reference.go_to(here);
        (0..4000).for_each(|_| reference.advance(&config, dt));
        assert_eq!((reference.position, reference.velocity), (here, Vector3::zeros()));
    }
}
