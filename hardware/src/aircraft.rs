use std::{cell::RefCell, rc::Rc};

use foxhunt_core::{HeightAboveGround, Pose, Spinner, SteadyMotion, Vehicle, Waypoint};
use nalgebra::Vector3;

/// An aircraft that is flown from the ground up: what a hunt on real devices needs besides going
/// somewhere and turning.
///
/// Nothing waits: what takes a while is begun by one call, goes on whenever the aircraft is called
/// for anything, and is followed through [`state`](Self::state).
///
/// An aircraft without inertia, for tests of what flies it:
///
/// ```
/// use std::convert::Infallible;
///
/// use foxhunt_core::{Pose, Spinner, Vehicle, Waypoint};
/// use foxhunt_hardware::{Aircraft, AircraftState};
///
/// #[derive(Default)]
/// struct Ideal {
///     pose: Pose,
/// }
///
/// impl Vehicle for Ideal {
///     type Error = Infallible;
///
///     fn pose(&mut self) -> Result<Pose, Infallible> {
///         Ok(self.pose)
///     }
///
///     fn go_to(&mut self, goal: &Waypoint) -> Result<(), Infallible> {
///         self.pose.position = goal.position;
///         Ok(())
///     }
/// }
///
/// impl Spinner for Ideal {
///     fn spin(&mut self, _rate: Option<f64>) -> Result<(), Infallible> {
///         Ok(())
///     }
/// }
///
/// impl Aircraft for Ideal {
///     fn state(&mut self) -> Result<AircraftState, Infallible> {
///         let airborne = self.pose.position.z > 0.0;
///         Ok(AircraftState {
///             mode: "ideal".to_owned(),
///             armed: airborne,
///             airborne,
///             commanded: airborne,
///             ..AircraftState::default()
///         })
///     }
///
///     fn take_off(&mut self, up_m: f64) -> Result<(), Infallible> {
///         self.pose.position.z = up_m;
///         Ok(())
///     }
///
///     fn take_over(&mut self) -> Result<(), Infallible> {
///         Ok(())
///     }
///
///     fn return_to_launch(&mut self) -> Result<(), Infallible> {
///         self.pose = Pose::default();
///         Ok(())
///     }
/// }
///
/// let mut aircraft = Ideal::default();
/// aircraft.take_off(10.0)?;
/// assert!(aircraft.state()?.commanded);
/// aircraft.return_to_launch()?;
/// assert!(!aircraft.state()?.airborne);
/// # Ok::<(), Infallible>(())
/// ```
pub trait Aircraft: Spinner {
    /// Returns the aircraft's state, as of its reports until now. To be called several times a
    /// second: this is when its link is served.
    ///
    /// # Errors
    ///
    /// Any error of the link.
    fn state(&mut self) -> Result<AircraftState, Self::Error>;

    /// Takes the aircraft into the air: waits for a good position, sets the mode that takes orders,
    /// arms, and climbs to `up_m` metres above the place of the take-off. Begun once; a call in the
    /// air does nothing.
    ///
    /// # Errors
    ///
    /// Any error of the link or the autopilot, and what is in the way.
    fn take_off(&mut self, up_m: f64) -> Result<(), Self::Error>;

    /// Has the aircraft take our orders again, after a lost link or after the pilot had it and gave
    /// it back. The aircraft hovers until the next goal. Without effect while it takes orders.
    ///
    /// # Errors
    ///
    /// While the pilot has it, or nothing is received of it.
    fn take_over(&mut self) -> Result<(), Self::Error>;

    /// Has it come back and land by its autopilot's own rules.
    ///
    /// # Errors
    ///
    /// Any error of the link or the autopilot.
    fn return_to_launch(&mut self) -> Result<(), Self::Error>;

    /// Passes on the pilot's word that it may take off again after it came down without our order.
    /// Unless overridden nothing is waited for.
    fn clear_to_take_off(&mut self) {}

    /// Has the aircraft's own camera take one picture; returns when the order is on its way. Unless
    /// overridden the aircraft has no camera, and nothing happens.
    ///
    /// # Errors
    ///
    /// Any error of the link, and while it takes no orders.
    fn photograph(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }

    /// Returns once why a device beside its autopilot has failed without keeping it from flying,
    /// such as the link of its corrections; `None` if no failure is new. Unless overridden there
    /// is no such device.
    fn device_failure(&mut self) -> Option<Self::Error> {
        None
    }

    /// Returns once why the picture that was ordered last was not taken; `None` if no failure is
    /// known.
    fn picture_failure(&mut self) -> Option<Self::Error> {
        None
    }
}

/// State of an aircraft.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AircraftState {
    /// Seconds since its last message; infinite before the first.
    pub silent_s: f64,
    /// Name of its mode, in its own words.
    pub mode: String,
    /// True if its motors run.
    pub armed: bool,
    /// True if it is in the air.
    pub airborne: bool,
    /// True if the aircraft takes orders from us now: it has reached the height of its take-off,
    /// and neither the pilot nor a lost link has taken it from us.
    pub commanded: bool,
    /// True if it is in the air and not ours, in a mode in which it may be [taken
    /// over](Aircraft::take_over), if it is known that nobody else flies it.
    pub offered: bool,
    /// Holder of the aircraft: who flies it.
    pub hands: Hands,
    /// True if it never goes anywhere: a station at a fixed place.
    pub rooted: bool,
    /// Reason why it takes no orders, or stays on the ground; empty without one.
    pub hindrance: String,
    /// Charge of the battery, from 0 to 1, if it reports that.
    pub battery: Option<f64>,
    /// Height above the ground by its own devices, if it has any.
    pub above_ground: Option<ReportedHeight>,
}

/// Holder of an aircraft: who flies it, as far as its driver knows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Hands {
    /// Nobody whom the driver knows of: it stands on the ground, or was in the air before.
    #[default]
    Nobody,
    /// It takes off, flies or comes down by our orders.
    Ours,
    /// Nothing is heard of it. Nothing is ordered until a heartbeat shows whose it is.
    Unheard,
    /// The pilot, in a mode that was not ordered.
    Pilot,
    /// The autopilot, which returns or lands without our order.
    Autopilot,
    /// Nobody: its own failsafe holds it in place.
    Stopped,
    /// Another station, in the mode of our orders.
    Station,
    /// Nobody: its pilot has given it back, or its link is back. It may be [taken
    /// over](Aircraft::take_over).
    GivenBack,
    /// Nobody: it came down without our order, and stays down until its pilot [clears
    /// it](Aircraft::clear_to_take_off).
    Grounded,
}

/// A height above the ground that an aircraft has reported.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReportedHeight {
    /// The height.
    pub height: HeightAboveGround,
    /// Age of the report in seconds.
    pub age_s: f64,
}

/// One aircraft for several owners: the fleet that sends it, and the source that turns it and reads
/// its pose.
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

    fn steady_motion(&self) -> Option<SteadyMotion> {
        self.0.borrow().steady_motion()
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

    fn clear_to_take_off(&mut self) {
        (**self).clear_to_take_off();
    }

    fn photograph(&mut self) -> Result<(), V::Error> {
        (**self).photograph()
    }

    fn device_failure(&mut self) -> Option<V::Error> {
        (**self).device_failure()
    }

    fn picture_failure(&mut self) -> Option<V::Error> {
        (**self).picture_failure()
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

    fn clear_to_take_off(&mut self) {
        self.0.borrow_mut().clear_to_take_off();
    }

    fn photograph(&mut self) -> Result<(), V::Error> {
        self.0.borrow_mut().photograph()
    }

    fn device_failure(&mut self) -> Option<V::Error> {
        self.0.borrow_mut().device_failure()
    }

    fn picture_failure(&mut self) -> Option<V::Error> {
        self.0.borrow_mut().picture_failure()
    }
}
