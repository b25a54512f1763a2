use foxhunt_core::{Pose, angle};
use nalgebra::Vector3;
use rand::rngs::Xoshiro256PlusPlus;

use super::{Controller, QuadrotorConfig, Reference, State, Wind};
use crate::SimError;

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
        let mut quadrotor = Self {
            config,
            state,
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

    /// Turns the nose at a rate in radians per second, counter-clockwise where it is positive; or
    /// holds it where it is.
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
        self.state = self.state.step(&inputs, dt);
        self.path_length += (self.state.position - before).norm();
    }
}
