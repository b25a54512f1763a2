use foxhunt_core::{Station, angle};
use nalgebra::Vector2;

use super::{altitude::AltitudeRule, places::nearest_direction};
use crate::shape::{Polygon, arrange};

/// Drones evenly around a place, who go round it step by step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Circle {
    /// The direction of the first drone from the place, in radians; none before the first step.
    pub(super) direction: Option<f64>,
}

impl Circle {
    /// Sets the goals of the next step, of `step_rad` radians; of the first, from where the nearest
    /// drone is.
    pub(super) fn advance(
        &mut self,
        centre: &Vector2<f64>,
        radius_m: f64,
        step_rad: f64,
        rule: &AltitudeRule,
        stations: &mut [Station],
    ) {
        let direction = match self.direction {
            Some(direction) => angle::wrap(direction + step_rad),
            None => nearest_direction(centre, stations),
        };
        self.direction = Some(direction);
        let ring = Polygon { circumradius: radius_m };
        arrange(&ring, centre, direction, rule.altitude(radius_m), stations);
    }
}
