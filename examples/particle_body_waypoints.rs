//! Three quadrotors that turn as a whole over six places, a particle filter.
//!
//! `cargo run --example particle_body_waypoints`

#![expect(clippy::print_stdout, reason = "an example talks to whoever runs it")]

use std::{convert::Infallible, error::Error};

use foxhunt::{
    filters::ParticleFilter,
    formation::{Polygon, Waypoints},
    prelude::*,
    scenario::{Scenario, SimulationConfig},
    sensors::{BodyConfig, LogDistance, Pritzl2018, RssBearing},
    sim::{QuadrotorConfig, VehicleConfig, World},
    simulation::fly,
};
use nalgebra::Vector2;
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

fn main() -> Result<(), Box<dyn Error>> {
    let mut scenario = Scenario::find("pritzl-7.4")?;
    scenario.world.vehicle = VehicleConfig::Quadrotor(QuadrotorConfig::default());
    let world = World::new(&scenario.world, 1)?;
    let mut sources = (0..world.drone_count())
        .map(|drone| world.body(drone, BodyConfig::isaacs2014()))
        .collect::<Result<Vec<_>, _>>()?;

    let model = RssBearing::new(LogDistance::pritzl2018_field());
    let places =
        [[12.0, 12.0], [48.0, 12.0], [48.0, 38.0], [12.0, 38.0], [22.0, 20.0], [38.0, 30.0]];
    let places = places.map(Vector2::from).to_vec();
    let mut hunt = Hunt::new(
        Pritzl2018::default(),
        Waypoints::new(places, Polygon { circumradius: 6.0 }, 0.0, 4.0)?,
        |prior: &Estimate<2>| {
            let rng = Xoshiro256PlusPlus::seed_from_u64(1);
            ParticleFilter::new(RandomWalk::uniform(0.02), model, *prior, 5000, rng)
        },
        scenario.beacon_names(),
        HuntConfig {
            prior_centre_m: Some([30.0, 25.0]),
            prior_sigma_m: 20.0,
            ..HuntConfig::default()
        },
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
