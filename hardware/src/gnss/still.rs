use foxhunt_core::{Pose, Vehicle, Waypoint};
use foxhunt_wire::geodesy::LocalFrame;
use nalgebra::Vector3;

use super::{GnssError, Positioning};

/// A receiver that nothing flies: on a tripod, on a parked car, or in the hands of a person. A GNSS
/// receiver alone has a place and no attitude.
///
/// It goes nowhere by itself. An order is kept as its [`goal`](Self::goal), which is shown to the
/// person who walks there, or does not.
#[derive(Debug)]
pub struct StillVehicle<G> {
    gnss: G,
    frame: LocalFrame,
    heading: f64,
    goal: Option<Waypoint>,
    sigma: Option<Vector3<f64>>,
}

impl<G> StillVehicle<G> {
    /// Something with its nose to the East.
    pub fn new(gnss: G, frame: LocalFrame) -> Self {
        Self { gnss, frame, heading: 0.0, goal: None, sigma: None }
    }

    /// Something whose nose is at `heading`, in radians counter-clockwise from East.
    #[must_use]
    pub fn with_heading(self, heading: f64) -> Self {
        Self { heading, ..self }
    }

    /// Sets the direction of its nose from now on, in radians counter-clockwise from East; a
    /// compass knows.
    pub fn set_heading(&mut self, heading: f64) {
        self.heading = heading;
    }

    /// The last goal.
    pub fn goal(&self) -> Option<Waypoint> {
        self.goal
    }

    /// The receiver.
    pub fn gnss(&mut self) -> &mut G {
        &mut self.gnss
    }
}

impl<G: Positioning> Vehicle for StillVehicle<G> {
    type Error = GnssError;

    fn pose(&mut self) -> Result<Pose, GnssError> {
        self.sigma = None;
        let position = self.gnss.position()?;
        self.sigma = Some(position.sigma_m);
        let level = Pose::level(self.frame.to_local(&position.place), self.heading);
        Ok(Pose { velocity: position.velocity_mps, ..level })
    }

    fn position_sigma(&self) -> Option<Vector3<f64>> {
        self.sigma
    }

    fn go_to(&mut self, goal: &Waypoint) -> Result<(), GnssError> {
        self.goal = Some(*goal);
        Ok(())
    }

    /// It is on the ground; there is nowhere to go any more.
    fn land(&mut self) -> Result<(), GnssError> {
        self.goal = None;
        Ok(())
    }
}
