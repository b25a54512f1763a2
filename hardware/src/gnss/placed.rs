//! Vehicles whose place comes from a GNSS receiver.

use foxhunt_core::{Pose, Spinner, Vehicle, Waypoint};
use foxhunt_wire::geodesy::LocalFrame;
use nalgebra::Vector3;

use super::{GnssError, HeightOrigin, Positioning};
use crate::{Aircraft, AircraftState};

/// A vehicle whose place comes from a GNSS receiver on it, with its σ. Heading and attitude stay
/// as the vehicle reports them, and so does a reported velocity. Orders go to the vehicle
/// unchanged: its own frame has to equal this one. Before a fix has had a height, the pose is an
/// error ([`GnssError::NoHeight`]).
#[derive(Debug)]
pub struct Placed<V, G> {
    vehicle: V,
    gnss: G,
    frame: LocalFrame,
    /// Place of the antenna from the vehicle's middle: forward, left and up.
    antenna: Vector3<f64>,
    sigma: Option<Vector3<f64>>,
}

/// Error of a placed vehicle: its place is unknown, or it did not obey.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlacedError<E> {
    /// The vehicle failed.
    #[error(transparent)]
    Vehicle(E),
    /// The receiver failed.
    #[error(transparent)]
    Gnss(#[from] GnssError),
}

impl<V, G> Placed<V, G> {
    /// Places `vehicle` by `gnss`, whose antenna is at `antenna` from the vehicle's middle:
    /// forward, left and up in metres ([`GnssConfig::antenna`](super::GnssConfig::antenna)).
    /// `frame` is that of all poses.
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
        // Sea level would be a height far below a site in the mountains.
        if position.height == HeightOrigin::SeaLevel {
            return Err(GnssError::NoHeight.into());
        }
        self.sigma = Some(position.sigma_m);
        let antenna = to_world(&own, &self.antenna);
        Ok(Pose {
            position: self.frame.to_local(&position.place) - antenna,
            velocity: own.velocity.or(position.velocity_mps),
            ..own
        })
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

    fn clear_to_take_off(&mut self) {
        self.vehicle.clear_to_take_off();
    }

    fn photograph(&mut self) -> Result<(), Self::Error> {
        self.vehicle.photograph().map_err(PlacedError::Vehicle)
    }

    fn device_failure(&mut self) -> Option<Self::Error> {
        self.gnss
            .failure()
            .map(PlacedError::Gnss)
            .or_else(|| self.vehicle.device_failure().map(PlacedError::Vehicle))
    }

    fn picture_failure(&mut self) -> Option<Self::Error> {
        self.vehicle.picture_failure().map(PlacedError::Vehicle)
    }
}

/// A direction of the body, forward, left and up, in the world: the inverse of
/// [`Pose::to_body`], which is a rotation.
fn to_world(pose: &Pose, body: &Vector3<f64>) -> Vector3<f64> {
    let along = |axis: Vector3<f64>| pose.to_body(&axis).dot(body);
    Vector3::new(along(Vector3::x()), along(Vector3::y()), along(Vector3::z()))
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use std::{f64::consts::FRAC_PI_2, io};

    use foxhunt_wire::{FixQuality, geodesy::Geodetic};

    use super::*;
    use crate::GnssPosition;

    /// A receiver at a fixed place.
    struct Fixed(Geodetic, HeightOrigin);

    impl Positioning for Fixed {
        fn position(&mut self) -> Result<GnssPosition, GnssError> {
            let sigma_m = Vector3::new(1.0, 2.0, 3.0);
            let quality = FixQuality::Autonomous;
            let velocity_mps = Some(Vector3::new(0.5, 0.0, 0.0));
            Ok(GnssPosition {
                place: self.0,
                height: self.1,
                sigma_m,
                velocity_mps,
                heading: None,
                quality,
                age_s: 0.0,
            })
        }
    }

    /// A vehicle that thinks that it is somewhere else.
    struct Astray(Pose, Option<Waypoint>);

    impl Vehicle for Astray {
        type Error = io::Error;

        fn pose(&mut self) -> io::Result<Pose> {
            Ok(self.0)
        }

        fn go_to(&mut self, goal: &Waypoint) -> io::Result<()> {
            self.1 = Some(*goal);
            Ok(())
        }
    }

    #[test]
    fn a_placed_vehicle_is_placed_by_its_antenna() {
        let origin = Geodetic { lat_deg: 50.0, lon_deg: 14.0, alt_m: 200.0 };
        let frame = LocalFrame::new(origin).expect("on Earth");
        let antenna_at = Vector3::new(100.0, 50.0, 10.0);
        let gnss = || Fixed(frame.to_geodetic(&antenna_at), HeightOrigin::Fix);
        // The nose to the North, the antenna 1 m in front, 0.5 m to the left, 0.2 m above.
        let own = Pose { pitch: 0.0, ..Pose::level(Vector3::new(-5.0, 0.0, 0.0), FRAC_PI_2) };
        let arm = Vector3::new(1.0, 0.5, 0.2);
        let mut placed = Placed::new(Astray(own, None), gnss(), frame, arm);
        assert_eq!(placed.position_sigma(), None);
        let pose = placed.pose().expect("a fix");
        assert!(
            (pose.position - Vector3::new(100.5, 49.0, 9.8)).norm() < 1e-4,
            "{}",
            pose.position
        );
        assert_abs_diff_eq!(pose.heading, FRAC_PI_2, epsilon = 0.0);
        assert_eq!(placed.position_sigma(), Some(Vector3::new(1.0, 2.0, 3.0)));
        assert_eq!(pose.velocity, Some(Vector3::new(0.5, 0.0, 0.0)), "the receiver's");
        let moving = Pose { velocity: Some(Vector3::y()), ..own };
        let mut placed = Placed::new(Astray(moving, None), gnss(), frame, arm);
        let pose = placed.pose().expect("a fix");
        assert_eq!(pose.velocity, Some(Vector3::y()), "the vehicle's own");
        // The nose straight up: what was in front is above, what was above is behind.
        let steep = Pose { pitch: FRAC_PI_2, ..own };
        let mut placed = Placed::new(Astray(steep, None), gnss(), frame, arm);
        let pose = placed.pose().expect("a fix");
        assert!(
            (pose.position - Vector3::new(100.5, 50.2, 9.0)).norm() < 1e-4,
            "{}",
            pose.position
        );
        let goal = Waypoint { position: Vector3::new(1.0, 2.0, 3.0) };
        placed.go_to(&goal).expect("accepted");
        assert_eq!(placed.vehicle().1, Some(goal));
    }

    #[test]
    fn sea_level_is_no_height_of_a_flying_vehicle() {
        let origin = Geodetic { lat_deg: 50.0, lon_deg: 14.0, alt_m: 400.0 };
        let frame = LocalFrame::new(origin).expect("on Earth");
        let gnss = Fixed(Geodetic { alt_m: 45.0, ..origin }, HeightOrigin::Fix);
        let own = Astray(Pose::default(), None);
        let mut placed = Placed::new(own, gnss, frame, Vector3::zeros());
        for height in [HeightOrigin::Fix, HeightOrigin::Geoid, HeightOrigin::Earlier] {
            placed.gnss().1 = height;
            assert_abs_diff_eq!(
                placed.pose().expect("a height").position.z,
                -355.0,
                epsilon = 1e-6
            );
        }
        placed.gnss().1 = HeightOrigin::SeaLevel;
        let refused = placed.pose();
        assert!(matches!(refused, Err(PlacedError::Gnss(GnssError::NoHeight))), "{refused:?}");
        assert_eq!(placed.position_sigma(), None, "the last one is not that of this place");
    }
}
