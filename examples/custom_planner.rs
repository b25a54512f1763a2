//! Your own planners, a closure and a struct, each in a small simulated hunt: three drones with
//! steppers and a grid search for two beacons.
//!
//! `cargo run --example custom_planner`

#![expect(clippy::print_stdout, reason = "an example shows what it found")]

use std::{convert::Infallible, error::Error, fmt};

use foxhunt::{
    core::planner_fn,
    filters::{GridConfig, GridFilter},
    formation::{Line, Shape},
    prelude::*,
    scenario::SimulationConfig,
    sensors::{LogDistance, Pritzl2018, RssBearing},
    sim::World,
    simulation::fly,
};

// ANCHOR: planner
/// A ring about the estimate, twice as wide as the belief, until that is small.
#[derive(Default)]
struct Ring {
    radius: f64,
    turns: u32,
}

impl FormationPlanner for Ring {
    fn plan(
        &mut self,
        belief: &dyn Belief,
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        let target = belief.position();
        let sigma = target.covariance.trace().sqrt();
        if !sigma.is_finite() {
            return Err(PlanError::NoPlace);
        }
        self.radius = (2.0 * sigma).clamp(5.0, 30.0);
        self.turns += 1;
        let ring = foxhunt::formation::Polygon { circumradius: self.radius };
        let count = stations.len();
        for (index, station) in stations.iter_mut().enumerate() {
            station.goal = ring.goal(&target.mean, f64::from(self.turns), 4.0, index, count);
        }
        let found = sigma < 1.5 || self.turns.is_multiple_of(40);
        Ok(if found {
            Decision::Finish(Outcome::Converged)
        } else {
            Decision::Listen(Stage::Searching)
        })
    }

    fn explain(&self, to: &mut dyn fmt::Write) -> fmt::Result {
        write!(to, "a ring of {:.1} m", self.radius)
    }
}
// ANCHOR_END: planner

fn main() -> Result<(), Box<dyn Error>> {
    // A line of drones that goes half way to the estimate with every turn, ten times.
    let line = Line::new(8.0)?;
    let mut moves = 0_u32;
    let half_way = planner_fn(move |belief: &dyn Belief, stations: &mut [Station]| {
        moves += 1;
        let count = stations.len();
        for (index, station) in stations.iter_mut().enumerate() {
            let here = station.pose.position.xy();
            let centre = (here + belief.position().mean) * 0.5;
            station.goal = line.goal(&centre, f64::from(moves), 4.0, index, count);
        }
        let done = moves.is_multiple_of(10);
        Ok(if done {
            Decision::Finish(Outcome::PathDone)
        } else {
            Decision::Listen(Stage::Searching)
        })
    });
    hunt("a closure", half_way)?;
    hunt("a struct", Ring::default())
}

/// Flies the reference's simulation with any planner.
fn hunt(name: &str, planner: impl FormationPlanner + 'static) -> Result<(), Box<dyn Error>> {
    let scenario = Scenario::find("pritzl-6.1")?;
    let world = World::new(&scenario.world, 1)?;
    let model = RssBearing::new(LogDistance::pritzl2018_field());
    let tracks = move |search: &Search<'_>| {
        let walk = RandomWalk::uniform(0.02);
        let grid = GridFilter::new(walk, model, search.prior, GridConfig::default())?;
        Ok(Track::new::<2, 2>(grid, TrackConfig::default()))
    };
    let parts = Parts::new(Pritzl2018::default(), planner, tracks);
    let mut hunt = Hunt::new(parts, scenario.beacon_names(), HuntConfig::default())?;
    let sources = scenario.sources(&Registry::builtin(), &world)?;
    let mut drones = Vec::new();
    for (drone, source) in sources.into_iter().enumerate() {
        drones.push(Drone { source, vehicle: world.vehicle(drone)? });
    }
    let config = SimulationConfig::default();
    let flown = fly(&mut hunt, &world, &mut drones, config, |_event| Ok::<_, Infallible>(()))?;
    for found in &flown.found {
        let fix = &found.fix;
        let error = found.error_m();
        println!("{name}, {}: {error:.2} m off after {} steps", fix.name, fix.steps);
    }
    Ok(())
}
