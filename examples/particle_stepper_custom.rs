//! A particle filter and a planner of one's own, a closure: after each turn the three drones go
//! half way to the estimate, spread over a line, until the cloud is small.
//!
//! `cargo run --example particle_stepper_custom`

#![expect(clippy::print_stdout, reason = "an example talks to whoever runs it")]

use std::{convert::Infallible, error::Error};

use foxhunt::{
    core::{Outcome, planner_fn},
    filters::ParticleFilter,
    prelude::*,
    scenario::{Scenario, SimulationConfig},
    sensors::{LogDistance, Pritzl2018, RssBearing},
    sim::World,
    simulation::fly,
};
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

fn main() -> Result<(), Box<dyn Error>> {
    let scenario = Scenario::find("pritzl-6.1")?;
    let world = World::new(&scenario.world, 1)?;

    let planner = planner_fn(|belief: &dyn Belief, stations: &mut [Station]| {
        let target = belief.position();
        for (offset, station) in [-6.0, 0.0, 6.0].into_iter().zip(stations) {
            let here = station.pose.position.xy();
            let half_way = (here + target.mean) * 0.5;
            station.goal.position = half_way.push(4.0);
            station.goal.position.x += offset;
        }
        let sigma = target.covariance.trace().sqrt();
        Ok(if sigma < 1.5 {
            Decision::Finish(Outcome::Converged)
        } else {
            Decision::Listen(Stage::Searching)
        })
    });
    let model = RssBearing::new(LogDistance::pritzl2018_field());
    let mut hunt = Hunt::new(
        Pritzl2018::default(),
        planner,
        |prior: &Estimate<2>| {
            let rng = Xoshiro256PlusPlus::seed_from_u64(1);
            ParticleFilter::new(RandomWalk::uniform(0.02), model, *prior, 5000, rng)
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
        println!("{}: {error:.2} m off after {} steps", fix.name, fix.steps);
    }
    Ok(())
}
