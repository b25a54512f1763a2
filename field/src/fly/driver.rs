use std::io;

use foxhunt_core::{
    BeaconId, Clock, Pose, Radio, Rotator, Spinner, SteadyMotion, Vehicle, Waypoint,
};
use foxhunt_hardware::{
    Aircraft, AircraftState, ArDrone, CarriedVehicle, Finding, FirmataStepper, GnssDecoder,
    GnssReceiver, KrakenSource, Mark, MavlinkVehicle, Placed, RtlTcpRadio, SikRadio, XbeeRadio,
};
use foxhunt_hunt::hunt::DeviceError;
use foxhunt_wire::ByteStream;
use nalgebra::Vector3;

/// A device that can be examined: whether it answers, how it is set up, what is wrong with it.
///
/// ```
/// use foxhunt_field::fly::Examine;
/// use foxhunt_hardware::Finding;
///
/// struct Thermometer {
///     celsius: f64,
/// }
///
/// impl Examine for Thermometer {
///     fn examine(&mut self, _pause: &mut dyn FnMut()) -> Vec<Finding> {
///         let reading = format!("{} °C", self.celsius);
///         if self.celsius < 60.0 {
///             vec![Finding::good("temperature", reading)]
///         } else {
///             vec![Finding::bad("temperature", reading, "let it cool down")]
///         }
///     }
/// }
///
/// assert!(Thermometer { celsius: 21.0 }.examine(&mut || ())[0].is_good());
/// ```
pub trait Examine {
    /// Examines it for some seconds at most; `pause` is called while it waits.
    fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding>;
}

/// An aircraft that can be examined.
pub trait ExaminedAircraft: Aircraft + Examine {}

impl<D: Aircraft + Examine> ExaminedAircraft for D {}

/// A radio that can be examined.
pub trait ExaminedRadio: Radio + Examine {}

impl<D: Radio + Examine> ExaminedRadio for D {}

/// A rotator that can be examined.
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

impl<S: ByteStream, C: Clock, D: GnssDecoder> Examine for CarriedVehicle<GnssReceiver<S, C, D>> {
    fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding> {
        self.gnss().examine(pause)
    }
}

impl Examine for CarriedVehicle<Mark> {
    fn examine(&mut self, _pause: &mut dyn FnMut()) -> Vec<Finding> {
        vec![Finding::good("place", "that of launch_m")]
    }
}

impl<D: ?Sized + Examine> Examine for Box<D> {
    fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding> {
        (**self).examine(pause)
    }
}

/// A driver whose type of error is hidden: the erasure of `foxhunt_hunt` for the traits of devices
/// that it does not know. Neither that type nor [`Aircraft`] is this crate's own, so the orphan
/// rule requires another type here; the error is the same.
#[derive(Debug)]
pub(super) struct Driver<D>(pub D);

impl<D: Examine> Examine for Driver<D> {
    fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding> {
        self.0.examine(pause)
    }
}

impl<D: Radio> Radio for Driver<D> {
    type Error = DeviceError;

    fn request(&mut self, beacon: BeaconId) -> Result<(), DeviceError> {
        self.0.request(beacon).map_err(DeviceError::new)
    }

    fn poll(&mut self) -> Result<Option<f64>, DeviceError> {
        self.0.poll().map_err(DeviceError::new)
    }

    fn measured_at(&self) -> Option<f64> {
        self.0.measured_at()
    }

    fn next_event(&self) -> Option<f64> {
        self.0.next_event()
    }
}

impl<D: Rotator> Rotator for Driver<D> {
    type Error = DeviceError;

    fn turn_to(&mut self, angle: f64) -> Result<(), DeviceError> {
        self.0.turn_to(angle).map_err(DeviceError::new)
    }

    fn poll(&mut self) -> Result<Option<f64>, DeviceError> {
        self.0.poll().map_err(DeviceError::new)
    }

    fn next_event(&self) -> Option<f64> {
        self.0.next_event()
    }
}

impl<D: Vehicle> Vehicle for Driver<D> {
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

impl<D: Spinner> Spinner for Driver<D> {
    fn spin(&mut self, rate: Option<f64>) -> Result<(), DeviceError> {
        self.0.spin(rate).map_err(DeviceError::new)
    }
}

impl<D: Aircraft> Aircraft for Driver<D> {
    fn state(&mut self) -> Result<AircraftState, DeviceError> {
        self.0.state().map_err(DeviceError::new)
    }

    fn take_off(&mut self, up_m: f64) -> Result<(), DeviceError> {
        self.0.take_off(up_m).map_err(DeviceError::new)
    }

    fn take_over(&mut self) -> Result<(), DeviceError> {
        self.0.take_over().map_err(DeviceError::new)
    }

    fn return_to_launch(&mut self) -> Result<(), DeviceError> {
        self.0.return_to_launch().map_err(DeviceError::new)
    }

    fn clear_to_take_off(&mut self) {
        self.0.clear_to_take_off();
    }

    fn photograph(&mut self) -> Result<(), DeviceError> {
        self.0.photograph().map_err(DeviceError::new)
    }

    fn device_failure(&mut self) -> Option<DeviceError> {
        self.0.device_failure().map(DeviceError::new)
    }

    fn picture_failure(&mut self) -> Option<DeviceError> {
        self.0.picture_failure().map(DeviceError::new)
    }
}
