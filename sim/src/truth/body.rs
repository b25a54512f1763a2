use foxhunt_core::Pose;
use nalgebra::Vector3;
use rand::rngs::Xoshiro256PlusPlus;

#[cfg(feature = "emulators")]
use super::carried::Carried;
use super::kinematics::Kinematics;
use crate::{Quadrotor, SimError, VehicleConfig};

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

    pub(crate) fn go_to(&mut self, goal: Vector3<f64>) -> Result<(), SimError> {
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

    /// Puts it on the ground below, an Up of 0, where it stays.
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
    pub(crate) fn carry(&mut self, pose: Pose) {
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
