use foxhunt_core::{Pose, Spinner, SteadyMotion, Vehicle, Waypoint};

use super::OnBoard;
use crate::SimError;

/// A simulated drone as a vehicle, which can turn while it flies. Its pose and every order fail
/// with [`SimError::Link`] while nobody has a link to it.
#[derive(Clone, Debug)]
pub struct SimVehicle(pub(crate) OnBoard);

impl Vehicle for SimVehicle {
    type Error = SimError;

    #[inline]
    fn pose(&mut self) -> Result<Pose, SimError> {
        self.0.over_link(|drone, _| drone.reported_pose())
    }

    /// # Errors
    ///
    /// [`SimError::Goal`] for a goal that is not finite; the older goal stays then.
    fn go_to(&mut self, goal: &Waypoint) -> Result<(), SimError> {
        self.0.over_link(|drone, now| drone.go_to(goal.position, now))?
    }

    fn steady_motion(&self) -> Option<SteadyMotion> {
        self.0.with(|drone, now| drone.steady_motion(now))
    }
}

impl Spinner for SimVehicle {
    /// # Errors
    ///
    /// [`SimError::SpinRate`] for a rate that is not finite; it goes on as before then.
    fn spin(&mut self, rate: Option<f64>) -> Result<(), SimError> {
        self.0.over_link(|drone, _| drone.body.spin(rate))?
    }
}
