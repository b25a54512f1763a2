use std::{cell::RefCell, rc::Rc};

use foxhunt_core::{Fleet, Pose, Vehicle, Waypoint};

use super::{OnBoard, SimVehicle};
use crate::{SimError, truth::Truth};

/// All drones of a simulated world, in their order.
#[derive(Clone, Debug)]
pub struct SimFleet(pub(crate) Rc<RefCell<Truth>>);

impl SimFleet {
    fn drone(&self, drone: usize) -> Result<SimVehicle, SimError> {
        OnBoard::new(&self.0, drone).map(SimVehicle)
    }
}

/// Errors are those of [`SimVehicle`], and [`SimError::Drone`] where there is no such drone.
impl Fleet for SimFleet {
    type Error = SimError;

    fn locate(&mut self, drone: usize) -> Result<Pose, SimError> {
        self.drone(drone)?.pose()
    }

    fn send(&mut self, drone: usize, goal: &Waypoint) -> Result<(), SimError> {
        self.drone(drone)?.go_to(goal)
    }

    fn land(&mut self, drone: usize) -> Result<(), SimError> {
        self.drone(drone)?.land()
    }
}
