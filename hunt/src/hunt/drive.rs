//! The devices of a hunt, the loop that drives them, and sources whose sweeps can be tapped.

use std::{cell::RefCell, error::Error, fmt, rc::Rc};

use foxhunt_core::{BeaconId, PatternSource, Pose, SteadyMotion, Sweep, Vehicle, Waypoint};
use nalgebra::Vector3;

use super::{Command, Hunt, HuntError};

/// The devices of one drone, for [`drive`]: implemented by [`Drone`] and by whatever holds more
/// than these of a drone.
///
/// ```
/// use foxhunt_core::{PatternSource, Vehicle};
/// use foxhunt_hunt::hunt::Devices;
///
/// struct Hexacopter<S, V> {
///     name: String,
///     antenna: S,
///     autopilot: V,
/// }
///
/// impl<S: PatternSource, V: Vehicle> Devices for Hexacopter<S, V> {
///     type Source = S;
///     type Vehicle = V;
///
///     fn devices(&mut self) -> (&mut S, &mut V) {
///         (&mut self.antenna, &mut self.autopilot)
///     }
/// }
/// ```
pub trait Devices {
    /// Type of the source with which it listens.
    type Source: PatternSource;
    /// Type of the vehicle that flies.
    type Vehicle: Vehicle;

    /// Both of them.
    fn devices(&mut self) -> (&mut Self::Source, &mut Self::Vehicle);
}

/// A drone: its source and its vehicle.
#[derive(Clone, Debug)]
pub struct Drone<S, V> {
    /// Source with which it listens.
    pub source: S,
    /// Vehicle that flies.
    pub vehicle: V,
}

impl<S: PatternSource, V: Vehicle> Devices for Drone<S, V> {
    type Source = S;
    type Vehicle = V;

    fn devices(&mut self) -> (&mut S, &mut V) {
        (&mut self.source, &mut self.vehicle)
    }
}

/// A pattern source of any kind.
pub type BoxedSource = Box<dyn PatternSource<Error = DeviceError>>;

/// A vehicle of any kind.
pub type BoxedVehicle = Box<dyn Vehicle<Error = DeviceError>>;

/// A drone of any kind, so that one hunt may fly several.
pub type BoxedDrone = Drone<BoxedSource, BoxedVehicle>;

impl BoxedDrone {
    /// A drone whose kind is hidden.
    pub fn boxed(source: impl PatternSource + 'static, vehicle: impl Vehicle + 'static) -> Self {
        Self { source: Box::new(Erased(source)), vehicle: Box::new(Erased(vehicle)) }
    }
}

/// Hides the kind of a pattern source.
pub fn boxed_source(source: impl PatternSource + 'static) -> BoxedSource {
    Box::new(Erased(source))
}

/// The failure of a device of any kind.
#[derive(Debug)]
pub struct DeviceError(Box<dyn Error>);

impl DeviceError {
    /// Hides the type of an error.
    pub fn new(error: impl Error + 'static) -> Self {
        Self(Box::new(error))
    }
}

impl fmt::Display for DeviceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

impl Error for DeviceError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.0.source()
    }
}

/// A device whose type of error is hidden: drivers add their own traits to it.
#[derive(Clone, Debug)]
pub struct Erased<D>(pub D);

impl<S: PatternSource> PatternSource for Erased<S> {
    type Error = DeviceError;

    fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), DeviceError> {
        self.0.begin(beacons).map_err(DeviceError::new)
    }

    fn poll(&mut self) -> Result<Option<Sweep<'_>>, DeviceError> {
        // Not `map_err`, which moves a sweep's bytes even where there is none.
        match self.0.poll() {
            Ok(None) => Ok(None),
            Ok(Some(sweep)) => Ok(Some(sweep)),
            Err(error) => Err(DeviceError::new(error)),
        }
    }

    fn next_event(&self) -> Option<f64> {
        self.0.next_event()
    }
}

impl<V: Vehicle> Vehicle for Erased<V> {
    type Error = DeviceError;

    fn pose(&mut self) -> Result<Pose, DeviceError> {
        self.0.pose().map_err(DeviceError::new)
    }

    fn position_sigma(&self) -> Option<Vector3<f64>> {
        self.0.position_sigma()
    }

    fn go_to(&mut self, goal: &Waypoint) -> Result<(), DeviceError> {
        self.0.go_to(goal).map_err(DeviceError::new)
    }

    fn land(&mut self) -> Result<(), DeviceError> {
        self.0.land().map_err(DeviceError::new)
    }

    fn steady_motion(&self) -> Option<SteadyMotion> {
        self.0.steady_motion()
    }
}

/// Moves data once between a hunt and its drones: reads where they are, lets time pass, carries out
/// commands, and takes the sweeps that are ready. Call it until the hunt is finished; it never
/// blocks.
///
/// A device that fails is noted in the hunt and tried again next time, so one broken drone does not
/// stop the others; where a place is not finite, the drone is taken to be where it was.
///
/// # Errors
///
/// [`DriveError`] when the hunt cannot go on, or there are fewer drones than it began with.
pub fn drive<D: Devices>(hunt: &mut Hunt, drones: &mut [D], time: f64) -> Result<(), DriveError> {
    let drones = devices_of(hunt, drones)?;
    drive_flight(hunt, drones, time)?;
    for (drone, devices) in drones.iter_mut().enumerate() {
        take_sweeps(hunt, drone, devices.devices().0, time);
    }
    Ok(())
}

/// Schedule of the next work of [`drive`], for loops that own the time: a simulation goes from one
/// event to the next instead of looking at everything at every step.
///
/// Devices that know nothing of their [next event](PatternSource::next_event) or of [how they go
/// on](Vehicle::steady_motion) are polled at every call. The hunt is the same as with [`drive`] at
/// every step.
#[derive(Clone, Debug)]
pub struct Agenda {
    /// From one possible call to the next, in seconds.
    step_s: f64,
    /// Time of the next look at the hunt and the vehicles; absent for at once.
    flight: Option<f64>,
    /// Time of the next look at each drone's source; absent for at once.
    sources: Vec<Option<f64>>,
}

/// Time before an event from which on it counts as due, in seconds: times are sums of steps, and to
/// poll a device too early changes nothing.
const EARLY_S: f64 = 1e-6;

impl Agenda {
    /// Creates the schedule of a loop in steps of `step_s` seconds, which leaves out steps at which
    /// nothing is due.
    #[must_use]
    pub fn new(step_s: f64) -> Self {
        Self { step_s, flight: None, sources: Vec::new() }
    }

    /// Does what is due at `time`; to be called again at [`next_event`](Self::next_event).
    ///
    /// # Errors
    ///
    /// The errors of [`drive`].
    pub fn drive<D: Devices>(
        &mut self,
        hunt: &mut Hunt,
        drones: &mut [D],
        time: f64,
    ) -> Result<(), DriveError> {
        let drones = devices_of(hunt, drones)?;
        let is_due = |event: Option<f64>| event.is_none_or(|event| time + EARLY_S >= event);
        if is_due(self.look_at_flight()) {
            drive_flight(hunt, drones, time)?;
            self.flight = None;
            // It may have had them begin a turn.
            self.sources.clear();
            self.sources.resize(drones.len(), None);
        }
        let mut polled = false;
        for (drone, (devices, event)) in drones.iter_mut().zip(&mut self.sources).enumerate() {
            if !is_due(*event) {
                continue;
            }
            *event = Some(f64::INFINITY);
            if hunt.awaits(drone) {
                let (source, _) = devices.devices();
                polled |= take_sweeps(hunt, drone, source, time);
                *event = source.next_event();
            }
        }
        if polled {
            self.flight = None;
        } else if self.flight.is_none() {
            let motions = drones.iter_mut().map(|devices| devices.devices().1.steady_motion());
            let motions: Option<Vec<_>> = motions.collect();
            self.flight = motions.and_then(|motions| hunt.next_event(time, &motions));
        }
        Ok(())
    }

    /// Returns the time of the next call at the latest, in seconds; `None` for at once.
    #[must_use]
    pub fn next_event(&self) -> Option<f64> {
        self.sources.iter().copied().try_fold(self.look_at_flight()?, earlier)
    }

    /// Returns the time until which nothing but their sweeps can make the hunt have its drones do
    /// anything, and no drone before its own sweep is delivered; `None` if that is not known.
    #[must_use]
    pub fn undisturbed_until(&self, hunt: &Hunt) -> Option<f64> {
        let look_at = self.look_at_flight().filter(|_| hunt.waits_for_all());
        look_at.map(|event| event - 2.0 * EARLY_S)
    }

    /// Returns the time of the next look at the drones: one step before anything happens to them,
    /// too, so that the hunt knows that they were well until then.
    fn look_at_flight(&self) -> Option<f64> {
        self.flight.map(|event| event - self.step_s)
    }
}

/// The earlier of two events; absent where the second is at once.
fn earlier(one: f64, other: Option<f64>) -> Option<f64> {
    Some(one.min(other?))
}

/// The devices of a hunt's drones.
fn devices_of<'a, D>(hunt: &Hunt, drones: &'a mut [D]) -> Result<&'a mut [D], DriveError> {
    let devices = drones.len();
    let count = hunt.drone_count();
    drones.get_mut(..count).ok_or(DriveError::Drones { devices, drones: count })
}

/// Reads where the drones are, lets time pass and carries out commands.
fn drive_flight<D: Devices>(
    hunt: &mut Hunt,
    drones: &mut [D],
    time: f64,
) -> Result<(), DriveError> {
    for (drone, devices) in drones.iter_mut().enumerate() {
        match devices.devices().1.pose() {
            Ok(pose) if pose.is_finite() => hunt.located(time, drone, pose),
            Ok(pose) => {
                let reason = format!("its place is not finite: {pose:?}");
                hunt.device_failed(time, Some(drone), reason);
            }
            Err(error) => hunt.device_failed(time, Some(drone), error.to_string()),
        }
    }
    hunt.advance(time)?;
    while let Some(command) = hunt.poll_command() {
        match command {
            Command::GoTo { drone, goal } => {
                if let Err(error) = drones[drone].devices().1.go_to(&goal) {
                    hunt.not_sent(time, drone, error.to_string());
                }
            }
            Command::Land { drone } => {
                if let Err(error) = drones[drone].devices().1.land() {
                    hunt.not_landed(time, drone, error.to_string());
                }
            }
            Command::Listen { drone, beacons } => {
                if let Err(error) = drones[drone].devices().0.begin(&beacons) {
                    hunt.device_failed(time, Some(drone), error.to_string());
                }
            }
        }
    }
    Ok(())
}

/// Takes the sweeps that a drone's source has ready; whether there was one, or it failed.
fn take_sweeps(hunt: &mut Hunt, drone: usize, source: &mut impl PatternSource, time: f64) -> bool {
    let mut happened = false;
    // A turn that is over lends a sweep for each beacon; a source that lends without end is not
    // polled any further.
    for _ in 0..hunt.beacon_count() {
        if !hunt.awaits(drone) {
            break;
        }
        match source.poll() {
            Ok(Some(sweep)) => hunt.sweep(time, drone, &sweep),
            Ok(None) => break,
            Err(error) => {
                hunt.device_failed(time, Some(drone), error.to_string());
                return true;
            }
        }
        happened = true;
    }
    happened
}

/// Reason why a hunt could not be driven on.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DriveError {
    /// The hunt itself cannot go on.
    #[error(transparent)]
    Hunt(#[from] HuntError),
    /// Not every drone has devices.
    #[error("there are devices of {devices} drones; the hunt has {drones}")]
    Drones {
        /// Number of drones that have devices.
        devices: usize,
        /// Number of drones of the hunt.
        drones: usize,
    },
}

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
