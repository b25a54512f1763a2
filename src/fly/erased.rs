use std::{error::Error, fmt};

use foxhunt_core::{BeaconId, Pose, Radio, Rotator, Spinner, Vehicle, Waypoint};
use foxhunt_hardware::{Aircraft, AircraftState};
use nalgebra::Vector3;

/// What went wrong with a device of any kind.
#[derive(Debug)]
pub struct DeviceError(Box<dyn Error>);

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

/// An aircraft that was chosen at run time.
pub type BoxedAircraft = Box<dyn Aircraft<Error = DeviceError>>;

/// A radio that was chosen at run time.
pub type BoxedRadio = Box<dyn Radio<Error = DeviceError>>;

/// A device that does not tell its kind.
#[derive(Debug)]
pub(super) struct Erased<D>(pub(super) D);

fn erased<E: Error + 'static>(error: E) -> DeviceError {
    DeviceError(Box::new(error))
}

impl<D: Radio> Radio for Erased<D> {
    type Error = DeviceError;

    fn request(&mut self, beacon: BeaconId) -> Result<(), DeviceError> {
        self.0.request(beacon).map_err(erased)
    }

    fn poll(&mut self) -> Result<Option<f64>, DeviceError> {
        self.0.poll().map_err(erased)
    }
}

impl<D: Rotator> Rotator for Erased<D> {
    type Error = DeviceError;

    fn turn_to(&mut self, angle: f64) -> Result<(), DeviceError> {
        self.0.turn_to(angle).map_err(erased)
    }

    fn poll(&mut self) -> Result<Option<f64>, DeviceError> {
        self.0.poll().map_err(erased)
    }
}

impl<D: Vehicle> Vehicle for Erased<D> {
    type Error = DeviceError;

    fn pose(&mut self) -> Result<Pose, DeviceError> {
        self.0.pose().map_err(erased)
    }

    fn position_sigma(&self) -> Option<Vector3<f64>> {
        self.0.position_sigma()
    }

    fn go_to(&mut self, goal: &Waypoint) -> Result<(), DeviceError> {
        self.0.go_to(goal).map_err(erased)
    }

    fn land(&mut self) -> Result<(), DeviceError> {
        self.0.land().map_err(erased)
    }
}

impl<D: Spinner> Spinner for Erased<D> {
    fn spin(&mut self, rate: Option<f64>) -> Result<(), DeviceError> {
        self.0.spin(rate).map_err(erased)
    }
}

impl<D: Aircraft> Aircraft for Erased<D> {
    fn state(&mut self) -> Result<AircraftState, DeviceError> {
        self.0.state().map_err(erased)
    }

    fn take_off(&mut self, up_m: f64) -> Result<(), DeviceError> {
        self.0.take_off(up_m).map_err(erased)
    }

    fn return_to_launch(&mut self) -> Result<(), DeviceError> {
        self.0.return_to_launch().map_err(erased)
    }
}
