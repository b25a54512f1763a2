//! A target that is found: what the planners' tests fly against.

use foxhunt_core::{Decision, Estimate, FormationPlanner, Outcome, Pose, Station};
use nalgebra::Vector2;

/// More than any planner's cap.
const ENDLESS: u32 = 10_000;

/// A belief that halves its distance to the truth, and a fifth of its σ, with each turn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shrinking {
    truth: Vector2<f64>,
    estimate: Estimate<2>,
}

/// End of a search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct End {
    pub outcome: Outcome,
    pub positions: u32,
}

impl Shrinking {
    /// One that begins about the origin, with a σ of 30 m.
    pub(crate) fn towards(east: f64, north: f64) -> Self {
        let estimate = Estimate::isotropic(Vector2::zeros(), 30.0);
        Self { truth: Vector2::new(east, north), estimate }
    }

    pub(crate) fn estimate(&self) -> &Estimate<2> {
        &self.estimate
    }

    pub(crate) fn listen(&mut self) {
        self.estimate.mean += (self.truth - self.estimate.mean) * 0.5;
        self.estimate.covariance *= 0.64;
    }

    /// Flies a search to its end; every drone reaches its goals.
    pub(crate) fn search<P: FormationPlanner>(
        &mut self,
        planner: &mut P,
        stations: &mut [Station],
        mut each: impl FnMut(&Decision, &[Station]),
    ) -> End {
        planner.begin(stations).expect("there are drones");
        for positions in 1..ENDLESS {
            arrive(stations);
            self.listen();
            let decision = planner.plan(&self.estimate, stations).expect("a finite belief");
            each(&decision, stations);
            if let Decision::Finish(outcome) = decision {
                return End { outcome, positions };
            }
        }
        panic!("the search does not end");
    }
}

/// Every drone is where it shall be.
pub(crate) fn arrive(stations: &mut [Station]) {
    for station in stations {
        station.pose.position = station.goal.position;
    }
}

/// Drones on a row near the origin.
pub(crate) fn stations<const N: usize>() -> [Station; N] {
    core::array::from_fn(|drone| {
        Station::holding(Pose::at(3.0 * crate::shape::number(drone), 1.0, 2.0))
    })
}
