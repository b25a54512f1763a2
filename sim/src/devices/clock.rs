use std::{cell::RefCell, rc::Rc};

use foxhunt_core::Clock;

use crate::truth::Truth;

/// A simulated world's clock.
#[derive(Clone, Debug)]
pub struct SimClock(pub(crate) Rc<RefCell<Truth>>);

impl Clock for SimClock {
    #[inline]
    fn now(&self) -> f64 {
        self.0.borrow().time
    }
}
