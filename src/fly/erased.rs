use std::{error::Error, fmt, io};

use foxhunt_core::{BeaconId, Clock, Pose, Radio, Rotator, Spinner, Vehicle, Waypoint};
use foxhunt_hardware::{
    Aircraft, AircraftState, ArDrone, Finding, FirmataStepper, GnssDecoder, GnssReceiver,
    KrakenSource, MavlinkVehicle, Placed, RtlTcpRadio, SikRadio, XbeeRadio,
};
use foxhunt_wire::ByteStream;
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

/// A device that can be asked how it is.
pub trait Examine {
    /// Looks at it for some seconds at most; `pause` is called while it waits.
    fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding>;
}

/// An aircraft that can be asked how it is.
pub trait ExaminedAircraft: Aircraft + Examine {}

impl<D: Aircraft + Examine> ExaminedAircraft for D {}

/// A radio that can be asked how it is.
pub trait ExaminedRadio: Radio + Examine {}

impl<D: Radio + Examine> ExaminedRadio for D {}

/// A rotator that can be asked how it is.
pub trait ExaminedRotator: Rotator + Examine {}

impl<D: Rotator + Examine> ExaminedRotator for D {}

/// An aircraft that was chosen at run time.
pub type BoxedAircraft = Box<dyn ExaminedAircraft<Error = DeviceError>>;

/// A radio that was chosen at run time.
pub type BoxedRadio = Box<dyn ExaminedRadio<Error = DeviceError>>;

/// A rotator that was chosen at run time.
pub type BoxedRotator = Box<dyn ExaminedRotator<Error = DeviceError>>;

macro_rules! examine {
    ($($driver:ident),+) => {$(
        impl<S: ByteStream, C: Clock> Examine for $driver<S, C> {
            fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding> {
                $driver::examine(self, pause)
            }
        }
    )+};
}

examine!(FirmataStepper, MavlinkVehicle, RtlTcpRadio, XbeeRadio);

impl<A: ByteStream, N: ByteStream, C: Clock> Examine for ArDrone<A, N, C> {
    fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding> {
        ArDrone::examine(self, pause)
    }
}

impl Examine for SikRadio {
    fn examine(&mut self, _pause: &mut dyn FnMut()) -> Vec<Finding> {
        SikRadio::examine(self)
    }
}

impl<S, O, V, C> Examine for KrakenSource<S, O, V, C>
where
    S: ByteStream,
    O: FnMut() -> io::Result<S>,
    V: Vehicle,
    C: Clock,
{
    fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding> {
        KrakenSource::examine(self, pause)
    }
}

impl<S: ByteStream, C: Clock, D: GnssDecoder> Examine for GnssReceiver<S, C, D> {
    fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding> {
        GnssReceiver::examine(self, pause)
    }
}

impl<V: Examine, S: ByteStream, C: Clock, D: GnssDecoder> Examine
    for Placed<V, GnssReceiver<S, C, D>>
{
    fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding> {
        let mut findings = self.vehicle().examine(pause);
        findings.extend(self.gnss().examine(pause));
        findings
    }
}

impl<D: ?Sized + Examine> Examine for Box<D> {
    fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding> {
        (**self).examine(pause)
    }
}

impl<D: Examine> Examine for Erased<D> {
    fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding> {
        self.0.examine(pause)
    }
}

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
