use std::{error::Error, fmt};

use foxhunt_core::{BeaconId, PatternSource, Pose, Sweep, Vehicle, Waypoint};
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
    /// What it listens with.
    type Source: PatternSource;
    /// What flies.
    type Vehicle: Vehicle;

    /// Both of them.
    fn devices(&mut self) -> (&mut Self::Source, &mut Self::Vehicle);
}

/// A drone: what it listens with and what flies.
#[derive(Clone, Debug)]
pub struct Drone<S, V> {
    /// What it listens with.
    pub source: S,
    /// What flies.
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
        self.0.poll().map_err(DeviceError::new)
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
    let count = hunt.drone_count();
    let Some(drones) = drones.get_mut(..count) else {
        return Err(DriveError::Drones { devices: drones.len(), drones: count });
    };
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
    for (drone, devices) in drones.iter_mut().enumerate() {
        let (source, _) = devices.devices();
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
                    break;
                }
            }
        }
    }
    Ok(())
}

/// Why a hunt could not be driven on.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DriveError {
    /// The hunt itself cannot go on.
    #[error(transparent)]
    Hunt(#[from] HuntError),
    /// Not every drone has devices.
    #[error("there are devices of {devices} drones; the hunt has {drones}")]
    Drones {
        /// How many drones have devices.
        devices: usize,
        /// How many drones the hunt has.
        drones: usize,
    },
}
