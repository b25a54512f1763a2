use foxhunt_core::{Pose, Spinner, Vehicle, Waypoint};
use foxhunt_wire::geodesy::LocalFrame;
use nalgebra::Vector3;

use super::{GnssError, Positioning};
use crate::{Aircraft, AircraftState};

/// A vehicle whose place comes from a GNSS receiver on it, with its σ. Heading and attitude stay those
/// that the vehicle tells, and orders go to it as they are: its own frame has to be the same one.
#[derive(Debug)]
pub struct Placed<V, G> {
    vehicle: V,
    gnss: G,
    frame: LocalFrame,
    /// Where the antenna is from the vehicle's middle: forward, left and up.
    antenna: Vector3<f64>,
    sigma: Option<Vector3<f64>>,
}

/// Why it is not known where a vehicle is, or why it did not do what it was told.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlacedError<E> {
    /// The vehicle said so.
    #[error(transparent)]
    Vehicle(E),
    /// The receiver said so.
    #[error(transparent)]
    Gnss(#[from] GnssError),
}

impl<V, G> Placed<V, G> {
    /// Places `vehicle` by `gnss`, whose antenna is at `antenna` from the vehicle's middle: forward,
    /// left and up in metres ([`GnssConfig::antenna`](super::GnssConfig::antenna)). `frame` is that of
    /// all poses.
    pub fn new(vehicle: V, gnss: G, frame: LocalFrame, antenna: Vector3<f64>) -> Self {
        Self { vehicle, gnss, frame, antenna, sigma: None }
    }

    /// The vehicle.
    pub fn vehicle(&mut self) -> &mut V {
        &mut self.vehicle
    }

    /// The receiver.
    pub fn gnss(&mut self) -> &mut G {
        &mut self.gnss
    }
}

impl<V: Vehicle, G: Positioning> Vehicle for Placed<V, G> {
    type Error = PlacedError<V::Error>;

    fn pose(&mut self) -> Result<Pose, Self::Error> {
        self.sigma = None;
        let own = self.vehicle.pose().map_err(PlacedError::Vehicle)?;
        let position = self.gnss.position()?;
        self.sigma = Some(position.sigma_m);
        let antenna = to_world(&own, &self.antenna);
        Ok(Pose { position: self.frame.to_local(&position.place) - antenna, ..own })
    }

    fn position_sigma(&self) -> Option<Vector3<f64>> {
        self.sigma
    }

    fn go_to(&mut self, goal: &Waypoint) -> Result<(), Self::Error> {
        self.vehicle.go_to(goal).map_err(PlacedError::Vehicle)
    }

    fn land(&mut self) -> Result<(), Self::Error> {
        self.vehicle.land().map_err(PlacedError::Vehicle)
    }
}

impl<V: Spinner, G: Positioning> Spinner for Placed<V, G> {
    fn spin(&mut self, rate: Option<f64>) -> Result<(), Self::Error> {
        self.vehicle.spin(rate).map_err(PlacedError::Vehicle)
    }
}

impl<V: Aircraft, G: Positioning> Aircraft for Placed<V, G> {
    fn state(&mut self) -> Result<AircraftState, Self::Error> {
        self.vehicle.state().map_err(PlacedError::Vehicle)
    }

    fn take_off(&mut self, up_m: f64) -> Result<(), Self::Error> {
        self.vehicle.take_off(up_m).map_err(PlacedError::Vehicle)
    }

    fn take_over(&mut self) -> Result<(), Self::Error> {
        self.vehicle.take_over().map_err(PlacedError::Vehicle)
    }

    fn return_to_launch(&mut self) -> Result<(), Self::Error> {
        self.vehicle.return_to_launch().map_err(PlacedError::Vehicle)
    }
}

/// A direction of the body, forward, left and up, in the world: the inverse of
/// [`Pose::to_body`], which is a rotation.
fn to_world(pose: &Pose, body: &Vector3<f64>) -> Vector3<f64> {
    let along = |axis: Vector3<f64>| pose.to_body(&axis).dot(body);
    Vector3::new(along(Vector3::x()), along(Vector3::y()), along(Vector3::z()))
}
