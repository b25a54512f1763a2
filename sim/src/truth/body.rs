//! The bodies that drones fly with: one that goes straight to its goal, a quadrotor, and one that
//! something outside of the world flies.

use foxhunt_core::{Pose, angle};
use nalgebra::Vector3;
use rand::rngs::Xoshiro256PlusPlus;

use crate::{KinematicConfig, Quadrotor, SimError, VehicleConfig};

/// The body that a drone flies with.
#[derive(Clone, Debug)]
pub(crate) enum Body {
    Kinematic(Kinematics),
    Quadrotor(Box<Quadrotor>),
    #[cfg(feature = "emulators")]
    Carried(Carried),
}

impl Body {
    pub(super) fn new(
        config: VehicleConfig,
        pose: Pose,
        gusts: Xoshiro256PlusPlus,
    ) -> Result<Self, SimError> {
        Ok(match config {
            VehicleConfig::Kinematic(config) => Self::Kinematic(Kinematics::new(config, pose)),
            VehicleConfig::Quadrotor(config) => {
                Self::Quadrotor(Box::new(Quadrotor::new(config, pose, gusts)?))
            }
        })
    }

    #[inline]
    pub(crate) fn pose(&self) -> Pose {
        match self {
            Self::Kinematic(body) => body.pose(),
            Self::Quadrotor(body) => body.pose(),
            #[cfg(feature = "emulators")]
            Self::Carried(body) => body.pose(),
        }
    }

    /// The body's velocity, East, North and Up in metres per second.
    pub(crate) fn velocity(&self) -> Vector3<f64> {
        match self {
            Self::Kinematic(body) => body.velocity(),
            Self::Quadrotor(body) => body.velocity(),
            #[cfg(feature = "emulators")]
            Self::Carried(body) => body.velocity(),
        }
    }

    /// Returns true if it stays as it is until it is ordered to move. A quadrotor never does: it
    /// hovers.
    #[inline]
    pub(super) fn rests(&self) -> bool {
        match self {
            Self::Kinematic(body) => body.rests(),
            Self::Quadrotor(_) => false,
            #[cfg(feature = "emulators")]
            Self::Carried(_) => false,
        }
    }

    /// The body's velocity, East, North and Up in metres per second, and for how many seconds it
    /// goes on so; `None` if that is not known.
    pub(super) fn steady_motion(&self) -> Option<(Vector3<f64>, f64)> {
        match self {
            Self::Kinematic(body) => body.steady_motion(),
            Self::Quadrotor(_) => None,
            #[cfg(feature = "emulators")]
            Self::Carried(_) => None,
        }
    }

    /// The body's heading, a turn more being 2π more.
    pub(super) fn heading(&self) -> f64 {
        match self {
            Self::Kinematic(body) => body.heading(),
            Self::Quadrotor(body) => body.heading(),
            #[cfg(feature = "emulators")]
            Self::Carried(body) => body.heading(),
        }
    }

    /// Metres flown so far.
    pub(crate) fn path_length(&self) -> f64 {
        match self {
            Self::Kinematic(body) => body.path_length(),
            Self::Quadrotor(body) => body.path_length(),
            #[cfg(feature = "emulators")]
            Self::Carried(body) => body.path_length(),
        }
    }

    pub(super) fn go_to(&mut self, goal: Vector3<f64>) -> Result<(), SimError> {
        match self {
            Self::Kinematic(body) => body.go_to(goal),
            Self::Quadrotor(body) => body.go_to(goal),
            #[cfg(feature = "emulators")]
            Self::Carried(_) => Ok(()),
        }
    }

    pub(crate) fn spin(&mut self, rate: Option<f64>) -> Result<(), SimError> {
        if let Some(rate) = rate.filter(|rate| !rate.is_finite()) {
            return Err(SimError::SpinRate { rate });
        }
        match self {
            Self::Kinematic(body) => {
                body.spin(rate.unwrap_or(0.0));
                Ok(())
            }
            Self::Quadrotor(body) => body.spin(rate),
            #[cfg(feature = "emulators")]
            Self::Carried(_) => Ok(()),
        }
    }

    /// Puts the body on the ground below, an Up of 0, where it stays.
    #[cfg(feature = "emulators")]
    pub(crate) fn put_down(&mut self) {
        match self {
            Self::Kinematic(body) => body.put_down(),
            Self::Quadrotor(body) => body.put_down(),
            Self::Carried(_) => {}
        }
    }

    /// Has it fly over ground at `speed` m/s, or as fast as it can.
    #[cfg(feature = "emulators")]
    pub(crate) fn cruise(&mut self, speed: f64) {
        match self {
            Self::Kinematic(body) => body.cruise(speed),
            Self::Quadrotor(body) => body.cruise(speed),
            Self::Carried(_) => {}
        }
    }

    /// Puts it where something outside of the world flies it; orders move it no more.
    #[cfg(feature = "emulators")]
    pub(super) fn carry(&mut self, pose: Pose) {
        match self {
            Self::Carried(body) => body.put(pose),
            other => {
                let mut body = Carried::new(other.pose(), other.heading(), other.path_length());
                body.put(pose);
                *other = Self::Carried(body);
            }
        }
    }

    pub(super) fn advance(&mut self, dt: f64) {
        match self {
            Self::Kinematic(body) => body.advance(dt),
            Self::Quadrotor(body) => body.advance(dt),
            #[cfg(feature = "emulators")]
            Self::Carried(_) => {}
        }
    }
}

/// A body that goes straight to its goal at constant speed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Kinematics {
    limits: KinematicConfig,
    /// The ordered speed over ground, in metres per second.
    cruise: f64,
    pose: Pose,
    /// The heading, not wrapped.
    heading: f64,
    /// The rate at which it turns, in radians per second.
    rate: f64,
    goal: Vector3<f64>,
    leg: Leg,
    /// True if it is at its goal and does not turn.
    rests: bool,
    path_length: f64,
}

/// The body's flight from its place to its goal.
#[derive(Clone, Copy, Debug, Default)]
struct Leg {
    /// East, North and Up in metres per second.
    velocity: Vector3<f64>,
    /// The norm of that.
    speed: f64,
    /// Time that it goes on so, in seconds: 0 at the goal.
    left_s: f64,
}

impl Kinematics {
    /// A body that stays at `pose` until it is sent elsewhere.
    fn new(limits: KinematicConfig, pose: Pose) -> Self {
        let goal = pose.position;
        let heading = pose.heading;
        let cruise = limits.speed_mps;
        let leg = Leg::default();
        Self { limits, cruise, pose, heading, rate: 0.0, goal, leg, rests: true, path_length: 0.0 }
    }

    #[inline]
    fn pose(&self) -> Pose {
        self.pose
    }

    /// Returns true if it is at its goal and does not turn.
    #[inline]
    fn rests(&self) -> bool {
        self.rests
    }

    /// The body's heading, a turn more being 2π more.
    fn heading(&self) -> f64 {
        self.heading
    }

    fn spin(&mut self, rate: f64) {
        self.rate = rate;
        self.rests = false;
    }

    /// Metres flown so far.
    fn path_length(&self) -> f64 {
        self.path_length
    }

    fn go_to(&mut self, goal: Vector3<f64>) -> Result<(), SimError> {
        // False for NaN, and for a distance that overflows.
        if !(goal - self.pose.position).norm().is_finite() {
            return Err(SimError::Goal { east: goal.x, north: goal.y, up: goal.z });
        }
        self.goal = goal;
        self.leg = self.straight_to_goal();
        self.rests = false;
        Ok(())
    }

    #[cfg(feature = "emulators")]
    fn put_down(&mut self) {
        self.pose.position.z = 0.0;
        self.goal = self.pose.position;
        self.leg = Leg::default();
        self.rests = false;
    }

    #[cfg(feature = "emulators")]
    fn cruise(&mut self, speed: f64) {
        self.cruise = speed.min(self.limits.speed_mps);
        self.leg = self.straight_to_goal();
    }

    /// The body's velocity, East, North and Up in metres per second.
    fn velocity(&self) -> Vector3<f64> {
        self.leg.velocity
    }

    /// The body's velocity, and for how many seconds it goes on so; `None` while it turns.
    fn steady_motion(&self) -> Option<(Vector3<f64>, f64)> {
        if self.rests {
            return Some((Vector3::zeros(), f64::INFINITY));
        }
        let Leg { velocity, left_s, .. } = self.leg;
        (left_s > 0.0 && self.rate.abs() <= 0.0).then_some((velocity, left_s))
    }

    /// Returns the straight line from the body's place: the slower of the two speeds sets the pace.
    fn straight_to_goal(&self) -> Leg {
        let way = self.goal - self.pose.position;
        let left_s = (way.xy().norm() / self.cruise).max(way.z.abs() / self.limits.climb_mps);
        if left_s > 0.0 {
            let velocity = way / left_s;
            Leg { velocity, speed: velocity.norm(), left_s }
        } else {
            Leg::default()
        }
    }

    /// Moves for `dt` seconds.
    fn advance(&mut self, dt: f64) {
        if self.rests {
            return;
        }
        let turns = self.rate.abs() > 0.0;
        if turns {
            self.heading += self.rate * dt;
            self.pose.heading = angle::wrap(self.heading);
        }
        let Leg { velocity, speed, left_s } = self.leg;
        if left_s <= 0.0 {
            self.rests = !turns;
        } else if left_s <= dt {
            self.pose.position = self.goal;
            self.path_length += speed * left_s;
            self.leg = Leg::default();
        } else {
            self.pose.position += velocity * dt;
            self.path_length += speed * dt;
            self.leg.left_s -= dt;
        }
    }
}

/// A body that something outside of the world flies.
#[cfg(feature = "emulators")]
#[derive(Clone, Copy, Debug)]
pub(crate) struct Carried {
    pose: Pose,
    /// The heading, not wrapped.
    heading: f64,
    path_length: f64,
}

#[cfg(feature = "emulators")]
impl Carried {
    /// A body at `pose`, whose nose has turned to `heading` and which has flown `path_length` m.
    fn new(pose: Pose, heading: f64, path_length: f64) -> Self {
        Self { pose, heading, path_length }
    }

    /// Puts it at a pose; its nose turned the short way.
    fn put(&mut self, pose: Pose) {
        self.heading += angle::wrap(pose.heading - self.heading);
        self.path_length += (pose.position - self.pose.position).norm();
        self.pose = pose;
    }

    fn pose(&self) -> Pose {
        self.pose
    }

    /// The body's heading, a turn more being 2π more.
    fn heading(&self) -> f64 {
        self.heading
    }

    /// The velocity of the last pose; zero if the pose has none.
    fn velocity(&self) -> Vector3<f64> {
        self.pose.velocity.unwrap_or_default()
    }

    /// Metres flown so far.
    fn path_length(&self) -> f64 {
        self.path_length
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    fn body() -> Kinematics {
        let limits =
            KinematicConfig { speed_mps: 2.0, climb_mps: 0.5, ..KinematicConfig::default() };
        Kinematics::new(limits, Pose { heading: 0.7, ..Pose::at(1.0, 2.0, 3.0) })
    }

    #[test]
    fn the_slower_of_speed_and_climb_sets_the_pace() {
        for (goal, seconds) in [
            (Vector3::new(4.0, 6.0, 3.0), 2.5), // 5 m over ground
            (Vector3::new(4.0, 6.0, 5.0), 4.0), // and 2 m up
            (Vector3::new(1.0, 2.0, 2.0), 2.0), // 1 m down
        ] {
            let mut body = body();
            let start = body.pose().position;
            body.go_to(goal).expect("a place");
            body.advance(0.5 * seconds);
            assert!((body.pose().position - 0.5 * (start + goal)).norm() < 1e-12);
            body.advance(0.5 * seconds - 1e-6);
            assert!((body.pose().position - goal).norm() > 1e-7);
            body.advance(2e-6);
            assert_eq!(body.pose(), Pose::level(goal, 0.7));
            assert_abs_diff_eq!(body.path_length(), (goal - start).norm(), epsilon = 1e-12);
        }
    }

    #[test]
    fn its_velocity_is_that_of_its_way() {
        let mut body = body();
        assert_eq!(body.velocity(), Vector3::zeros());
        body.go_to(Vector3::new(4.0, 6.0, 4.0)).expect("a place");
        let velocity = body.velocity();
        let before = body.pose().position;
        body.advance(0.5);
        assert!(((body.pose().position - before) / 0.5 - velocity).norm() < 1e-12);
        body.advance(10.0);
        assert_eq!(body.velocity(), Vector3::zeros());
    }

    #[test]
    fn it_turns_while_it_flies_and_holds_its_nose_after() {
        let mut body = body();
        body.go_to(Vector3::new(5.0, 2.0, 3.0)).expect("a place");
        body.spin(-2.0);
        body.advance(1.0);
        body.advance(1.0);
        assert_abs_diff_eq!(body.heading(), 0.7 - 4.0, epsilon = 1e-12);
        assert_abs_diff_eq!(body.pose().heading, angle::wrap(0.7 - 4.0), epsilon = 1e-12);
        assert_eq!(body.pose().position, Vector3::new(5.0, 2.0, 3.0));
        body.spin(0.0);
        body.advance(1.0);
        assert_abs_diff_eq!(body.heading(), 0.7 - 4.0, epsilon = 1e-12);
    }

    #[test]
    fn a_new_goal_replaces_the_old_one_and_no_place_does_not() {
        let mut body = body();
        body.go_to(Vector3::new(11.0, 2.0, 3.0)).expect("a place");
        body.advance(1.0);
        body.go_to(Vector3::new(3.0, 12.0, 3.0)).expect("a place");
        assert!(body.go_to(Vector3::new(f64::NAN, 0.0, 0.0)).is_err());
        assert!(body.go_to(Vector3::new(1e200, 0.0, 0.0)).is_err());
        body.advance(1.0);
        assert!((body.pose().position - Vector3::new(3.0, 4.0, 3.0)).norm() < 1e-12);
        assert_abs_diff_eq!(body.path_length(), 4.0, epsilon = 1e-12);
    }
}
