//! Steppers under three drones, a particle filter, a triangle that follows the estimate.
//!
//! `cargo run --example particle_stepper_triangle`

#![expect(clippy::print_stdout, reason = "an example talks to whoever runs it")]

use std::{convert::Infallible, error::Error};

use foxhunt::{
    filters::ParticleFilter,
    formation::{FollowConfig, FollowEstimate},
    prelude::*,
    scenario::{Scenario, SimulationConfig},
    sensors::{LogDistance, Pritzl2018, RssBearing, StepperConfig},
    sim::World,
    simulation::fly,
};
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

fn main() -> Result<(), Box<dyn Error>> {
    let scenario = Scenario::find("pritzl-6.1")?;
    let world = World::new(&scenario.world, 1)?;
    let mut sources = (0..world.drone_count())
        .map(|drone| world.stepper(drone, StepperConfig::pritzl2018()))
        .collect::<Result<Vec<_>, _>>()?;

    let model = RssBearing::new(LogDistance::pritzl2018_field());
    let mut hunt = Hunt::new(
        Pritzl2018::default(),
        FollowEstimate::new(FollowConfig::pritzl2018())?,
        |prior: &Estimate<2>| {
            let rng = Xoshiro256PlusPlus::seed_from_u64(1);
            ParticleFilter::new(RandomWalk::uniform(0.02), model, *prior, 5000, rng)
        },
        scenario.beacon_names(),
        HuntConfig::default(),
        TrackConfig::default(),
    )?;
    fly(&mut hunt, &world, &mut sources, SimulationConfig::default(), |_event| {
        Ok::<_, Infallible>(())
    })?;

    for fix in hunt.fixes() {
        let truth = world.truth(fix.beacon).ok_or("the world has this beacon")?.xy();
        let error = (fix.estimate.mean - truth).norm();
        println!("{}: {error:.2} m off after {} steps, {}", fix.name, fix.steps, fix.outcome);
    }
    Ok(())
}
