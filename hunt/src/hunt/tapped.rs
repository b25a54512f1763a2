use std::{cell::RefCell, fmt, rc::Rc};

use foxhunt_core::{BeaconId, PatternSource, Sweep};

/// A function that is called with every sweep, and the drone's number, before the hunt takes it.
pub type Tap = Rc<RefCell<dyn FnMut(usize, &Sweep<'_>)>>;

/// A source whose sweeps are passed to a [`Tap`] on their way, so that the raw samples can be kept.
pub struct Tapped<S> {
    source: S,
    drone: usize,
    tap: Tap,
}

impl<S: fmt::Debug> fmt::Debug for Tapped<S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Tapped")
            .field("source", &self.source)
            .field("drone", &self.drone)
            .finish_non_exhaustive()
    }
}

impl<S> Tapped<S> {
    /// Passes the sweeps of a drone's source to `tap`.
    pub fn new(source: S, drone: usize, tap: Tap) -> Self {
        Self { source, drone, tap }
    }
}

impl<S: PatternSource> PatternSource for Tapped<S> {
    type Error = S::Error;

    fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), S::Error> {
        self.source.begin(beacons)
    }

    fn poll(&mut self) -> Result<Option<Sweep<'_>>, S::Error> {
        let sweep = self.source.poll()?;
        if let Some(sweep) = &sweep {
            (self.tap.borrow_mut())(self.drone, sweep);
        }
        Ok(sweep)
    }

    fn next_event(&self) -> Option<f64> {
        self.source.next_event()
    }
}
