//! Planners of one's own, a closure and a struct, each in a small simulated hunt: three drones with
//! steppers and a grid look for two beacons.
//!
//! `cargo run --example custom_planner`

#![expect(clippy::print_stdout, reason = "an example talks to whoever runs it")]

use std::{convert::Infallible, error::Error, fmt};

use foxhunt::{
    core::{Outcome, PlanError, planner_fn},
    filters::{GridConfig, GridFilter},
    formation::{Line, Shape},
    prelude::*,
    scenario::{Scenario, SimulationConfig},
    sensors::{LogDistance, Pritzl2018, RssBearing},
    sim::World,
    simulation::fly,
};

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
        (self.radius, self.turns) = ((2.0 * sigma).clamp(5.0, 30.0), self.turns + 1);
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

fn main() -> Result<(), Box<dyn Error>> {
    // A line of drones that goes half way to the estimate with every turn, ten times.
    let (line, mut moves) = (Line::new(8.0)?, 0_u32);
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
fn hunt(name: &str, planner: impl FormationPlanner) -> Result<(), Box<dyn Error>> {
    let scenario = Scenario::find("pritzl-6.1")?;
    let world = World::new(&scenario.world, 1)?;
    let model = RssBearing::new(LogDistance::pritzl2018_field());
    let mut hunt = Hunt::new(
        Pritzl2018::default(),
        planner,
        |prior: &Estimate<2>| {
            GridFilter::new(RandomWalk::uniform(0.02), model, *prior, GridConfig::default())
        },
        scenario.beacon_names(),
        HuntConfig::default(),
        TrackConfig::default(),
    )?;
    let mut sources = scenario.sources(&world)?;
    fly(&mut hunt, &world, &mut sources, SimulationConfig::default(), |_event| {
        Ok::<_, Infallible>(())
    })?;
    for fix in hunt.fixes() {
        let truth = world.truth(fix.beacon).ok_or("the world has this beacon")?.xy();
        let error = (fix.estimate.mean - truth).norm();
        println!("{name}, {}: {error:.2} m off after {} steps", fix.name, fix.steps);
    }
    Ok(())
}
