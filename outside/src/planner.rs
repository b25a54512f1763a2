//! Your own planner: a triangle about the estimate, as wide as the belief, that turns at each
//! step.

use std::fmt;

use foxhunt::nalgebra::Vector2;
use foxhunt::prelude::*;

/// The triangle.
#[derive(Clone, Copy, Debug, Default)]
pub struct TurningTriangle {
    steps: u32,
    radius_m: f64,
}

impl FormationPlanner for TurningTriangle {
    fn plan(
        &mut self,
        belief: &dyn Belief,
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        let target = belief.position();
        let sigma = target.covariance.trace().max(0.0).sqrt();
        if !(sigma.is_finite() && target.mean.iter().all(|place| place.is_finite())) {
            return Err(PlanError::NoPlace);
        }
        self.steps += 1;
        self.radius_m = (2.0 * sigma).clamp(6.0, 30.0);
        let count = stations.iter().map(|_| 1.0).sum::<f64>();
        for (number, station) in (0_u32..).zip(stations) {
            let share = f64::from(number) / count + 0.15 * f64::from(self.steps);
            let (sin, cos) = (share * std::f64::consts::TAU).sin_cos();
            let place = target.mean + Vector2::new(cos, sin) * self.radius_m;
            station.goal = Waypoint { position: place.push(4.0) };
        }
        Ok(if sigma < 1.2 || self.steps >= 25 {
            Decision::Finish(Outcome::Converged)
        } else {
            Decision::Listen(Stage::Searching)
        })
    }

    fn explain(&self, to: &mut dyn fmt::Write) -> fmt::Result {
        write!(to, "step {} on a triangle of {:.1} m", self.steps, self.radius_m)
    }
}
