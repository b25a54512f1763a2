use std::{cell::RefCell, rc::Rc};

use crate::{
    SimClock, SimError,
    truth::{Drone, Truth},
};

/// Something that sits on one drone of a world.
#[derive(Clone, Debug)]
pub(crate) struct OnBoard {
    truth: Rc<RefCell<Truth>>,
    /// Below the number of drones, which never falls.
    drone: usize,
}

impl OnBoard {
    pub(crate) fn new(truth: &Rc<RefCell<Truth>>, drone: usize) -> Result<Self, SimError> {
        let drones = truth.borrow().drones.len();
        if drone >= drones {
            return Err(SimError::Drone { drone, drones });
        }
        Ok(Self { truth: Rc::clone(truth), drone })
    }

    /// The drone at the present time of its devices.
    #[inline]
    pub(crate) fn with<T>(&self, act: impl FnOnce(&mut Drone, f64) -> T) -> T {
        let truth = &mut *self.truth.borrow_mut();
        let drone = &mut truth.drones[self.drone];
        let now = drone.time(truth.time);
        act(drone, now)
    }

    /// The drone at the present time, over its link.
    ///
    /// # Errors
    ///
    /// [`SimError::Link`] while there is no link.
    #[inline]
    pub(super) fn over_link<T>(
        &self,
        act: impl FnOnce(&mut Drone, f64) -> T,
    ) -> Result<T, SimError> {
        self.with(|drone, now| {
            if drone.is_linked(now) {
                Ok(act(drone, now))
            } else {
                Err(SimError::Link { drone: self.drone })
            }
        })
    }

    /// Its clock, which may go ahead of the world's.
    pub(crate) fn clock(&self) -> SimClock {
        SimClock { truth: Rc::clone(&self.truth), drone: Some(self.drone) }
    }

    /// The drone in its world.
    pub(crate) fn with_truth<T>(&self, act: impl FnOnce(&mut Truth, usize) -> T) -> T {
        act(&mut self.truth.borrow_mut(), self.drone)
    }
}
