use foxhunt_core::{Pose, angle};
use nalgebra::Vector3;

/// A body that something outside of the world flies.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Carried {
    pose: Pose,
    /// The heading, not wrapped.
    heading: f64,
    path_length: f64,
}

impl Carried {
    /// A body at `pose`, whose nose has turned to `heading` and which has flown `path_length` m.
    pub(super) fn new(pose: Pose, heading: f64, path_length: f64) -> Self {
        Self { pose, heading, path_length }
    }

    /// Puts it at a pose; its nose turned the short way.
    pub(super) fn put(&mut self, pose: Pose) {
        self.heading += angle::wrap(pose.heading - self.heading);
        self.path_length += (pose.position - self.pose.position).norm();
        self.pose = pose;
    }

    pub(super) fn pose(&self) -> Pose {
        self.pose
    }

    /// The body's heading, a turn more being 2π more.
    pub(super) fn heading(&self) -> f64 {
        self.heading
    }

    /// The velocity of the last pose; zero if the pose has none.
    pub(super) fn velocity(&self) -> Vector3<f64> {
        self.pose.velocity.unwrap_or_default()
    }

    /// Metres flown so far.
    pub(super) fn path_length(&self) -> f64 {
        self.path_length
    }
}
