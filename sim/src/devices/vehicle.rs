use foxhunt_core::{Pose, Vehicle, Waypoint};

use super::OnBoard;
use crate::SimError;

/// A simulated drone as a vehicle: straight to its goal at constant speed.
#[derive(Clone, Debug)]
pub struct SimVehicle(pub(crate) OnBoard);

impl Vehicle for SimVehicle {
    type Error = SimError;

    fn pose(&mut self) -> Result<Pose, SimError> {
        Ok(self.0.with(|drone, _| drone.body.pose()))
    }

    /// # Errors
    ///
    /// [`SimError::Goal`] for a goal that is not finite; the older goal stays then.
    fn go_to(&mut self, goal: &Waypoint) -> Result<(), SimError> {
        self.0.with(|drone, _| drone.body.go_to(goal.position))
    }
}
