use std::{cell::RefCell, rc::Rc};

use foxhunt_core::{Fleet, Station};

use crate::{SimError, truth::Truth};

/// All drones of a simulated world, in their order.
#[derive(Clone, Debug)]
pub struct SimFleet(pub(crate) Rc<RefCell<Truth>>);

impl Fleet for SimFleet {
    type Error = SimError;

    /// # Errors
    ///
    /// [`SimError::Drone`] for a station more than there are drones, after the others were
    /// served.
    fn locate(&mut self, stations: &mut [Station]) -> Result<(), SimError> {
        let truth = self.0.borrow();
        for (drone, station) in truth.drones.iter().zip(&mut *stations) {
            station.pose = drone.body.pose();
        }
        manned(stations.len(), truth.drones.len())
    }

    /// # Errors
    ///
    /// The first drone's [`SimError::Goal`], or [`SimError::Drone`] for a station more than there
    /// are drones, after the others were served.
    fn command(&mut self, stations: &[Station]) -> Result<(), SimError> {
        let drones = &mut self.0.borrow_mut().drones;
        let mut outcome = Ok(());
        for (drone, station) in drones.iter_mut().zip(stations) {
            outcome = outcome.and(drone.body.go_to(station.goal.position));
        }
        outcome.and(manned(stations.len(), drones.len()))
    }
}

/// Whether there is a drone for every station.
fn manned(stations: usize, drones: usize) -> Result<(), SimError> {
    if stations > drones { Err(SimError::Drone { drone: drones, drones }) } else { Ok(()) }
}
