use std::{cell::RefCell, rc::Rc};

use foxhunt_core::{Pose, Spinner, Vehicle, Waypoint};
use nalgebra::Vector3;

/// An aircraft that is flown from the ground up: what a hunt on real devices needs besides going
/// somewhere and turning.
///
/// Nothing waits: what takes a while is begun by one call, goes on whenever the aircraft is asked for
/// anything, and is followed through [`state`](Self::state).
pub trait Aircraft: Spinner {
    /// What it is doing, as of what it has said until now. To be asked several times a second: this is
    /// when its link is served.
    ///
    /// # Errors
    ///
    /// Whatever the link says.
    fn state(&mut self) -> Result<AircraftState, Self::Error>;

    /// Gets it into the air: waits for a good position, sets the mode that takes orders, arms, and
    /// climbs to `up_m` metres above where it stands. Begun once; asked for again in the air it does
    /// nothing.
    ///
    /// # Errors
    ///
    /// Whatever the link or the autopilot says, and what is in the way.
    fn take_off(&mut self, up_m: f64) -> Result<(), Self::Error>;

    /// Has it take our orders again, after a lost link or after the pilot had it and gave it back. It
    /// stays where it is until it is sent somewhere. Without effect while it takes them.
    ///
    /// # Errors
    ///
    /// While the pilot has it, or nothing is heard of it.
    fn take_over(&mut self) -> Result<(), Self::Error>;

    /// Has it come back and land by its autopilot's own rules.
    ///
    /// # Errors
    ///
    /// Whatever the link or the autopilot says.
    fn return_to_launch(&mut self) -> Result<(), Self::Error>;
}

/// What an aircraft is doing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AircraftState {
    /// How long ago it was last heard, in seconds; infinite before that.
    pub silent_s: f64,
    /// What it calls its mode.
    pub mode: String,
    /// Whether its motors run.
    pub armed: bool,
    /// Whether it is in the air.
    pub airborne: bool,
    /// Whether it takes orders from us now: it is up where it was sent at take-off, and neither the
    /// pilot nor a lost link has taken it from us.
    pub commanded: bool,
    /// Why it takes no orders, or what keeps it on the ground; empty where nothing does.
    pub hindrance: String,
    /// What is left in the battery, from 0 to 1, where it says so.
    pub battery: Option<f64>,
}

/// One aircraft for several owners: the fleet that sends it, and the source that turns it and asks
/// where it is.
#[derive(Debug)]
pub struct Shared<V>(Rc<RefCell<V>>);

impl<V> Shared<V> {
    /// Shares an aircraft.
    pub fn new(vehicle: V) -> Self {
        Self(Rc::new(RefCell::new(vehicle)))
    }

    /// Does something with it.
    pub fn with<T>(&self, act: impl FnOnce(&mut V) -> T) -> T {
        act(&mut self.0.borrow_mut())
    }
}

impl<V> Clone for Shared<V> {
    fn clone(&self) -> Self {
        Self(Rc::clone(&self.0))
    }
}

impl<V: Vehicle> Vehicle for Shared<V> {
    type Error = V::Error;

    fn pose(&mut self) -> Result<Pose, V::Error> {
        self.0.borrow_mut().pose()
    }

    fn position_sigma(&self) -> Option<Vector3<f64>> {
        self.0.borrow().position_sigma()
    }

    fn go_to(&mut self, goal: &Waypoint) -> Result<(), V::Error> {
        self.0.borrow_mut().go_to(goal)
    }

    fn land(&mut self) -> Result<(), V::Error> {
        self.0.borrow_mut().land()
    }
}

impl<V: Spinner> Spinner for Shared<V> {
    fn spin(&mut self, rate: Option<f64>) -> Result<(), V::Error> {
        self.0.borrow_mut().spin(rate)
    }
}

impl<V: ?Sized + Aircraft> Aircraft for Box<V> {
    fn state(&mut self) -> Result<AircraftState, V::Error> {
        (**self).state()
    }

    fn take_off(&mut self, up_m: f64) -> Result<(), V::Error> {
        (**self).take_off(up_m)
    }

    fn take_over(&mut self) -> Result<(), V::Error> {
        (**self).take_over()
    }

    fn return_to_launch(&mut self) -> Result<(), V::Error> {
        (**self).return_to_launch()
    }
}

impl<V: Aircraft> Aircraft for Shared<V> {
    fn state(&mut self) -> Result<AircraftState, V::Error> {
        self.0.borrow_mut().state()
    }

    fn take_off(&mut self, up_m: f64) -> Result<(), V::Error> {
        self.0.borrow_mut().take_off(up_m)
    }

    fn take_over(&mut self) -> Result<(), V::Error> {
        self.0.borrow_mut().take_over()
    }

    fn return_to_launch(&mut self) -> Result<(), V::Error> {
        self.0.borrow_mut().return_to_launch()
    }
}
