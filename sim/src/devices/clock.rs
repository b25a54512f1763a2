use std::{cell::RefCell, rc::Rc};

use foxhunt_core::Clock;

use crate::truth::Truth;

/// A simulated world's clock, or that of one of its drones, which may [go ahead](Clock::go_ahead)
/// as far as the world [allows](crate::World::allow_ahead).
#[derive(Clone, Debug)]
pub struct SimClock {
    pub(crate) truth: Rc<RefCell<Truth>>,
    pub(crate) drone: Option<usize>,
}

impl Clock for SimClock {
    #[inline]
    fn now(&self) -> f64 {
        let truth = self.truth.borrow();
        self.drone.map_or(truth.time, |drone| truth.drones[drone].time(truth.time))
    }

    fn go_ahead(&self, event: f64) -> bool {
        let truth = &mut *self.truth.borrow_mut();
        self.drone.is_some_and(|drone| truth.drones[drone].go_ahead(event, truth.time, truth.free))
    }

    #[inline]
    fn is_ahead(&self) -> bool {
        let truth = self.truth.borrow();
        self.drone.is_some_and(|drone| truth.drones[drone].time(truth.time) > truth.time)
    }
}
