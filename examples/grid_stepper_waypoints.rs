//! Steppers under three drones over six places, recursive Bayes over a grid.
//!
//! `cargo run --example grid_stepper_waypoints`

#![expect(clippy::print_stdout, reason = "an example talks to whoever runs it")]

use std::{convert::Infallible, error::Error};

use foxhunt::{
    filters::{GridConfig, GridFilter},
    formation::{Polygon, Waypoints},
    prelude::*,
    scenario::{Scenario, SimulationConfig},
    sensors::{LogDistance, Pritzl2018, RssBearing, StepperConfig},
    sim::World,
    simulation::fly,
};
use nalgebra::Vector2;

fn main() -> Result<(), Box<dyn Error>> {
    let scenario = Scenario::find("pritzl-7.4")?;
    let world = World::new(&scenario.world, 1)?;
    let mut sources = (0..world.drone_count())
        .map(|drone| world.stepper(drone, StepperConfig::pritzl2018()))
        .collect::<Result<Vec<_>, _>>()?;

    let model = RssBearing::new(LogDistance::pritzl2018_field());
    let places =
        [[12.0, 12.0], [48.0, 12.0], [48.0, 38.0], [12.0, 38.0], [22.0, 20.0], [38.0, 30.0]];
    let places = places.map(Vector2::from).to_vec();
    let mut hunt = Hunt::new(
        Pritzl2018::default(),
        Waypoints::new(places, Polygon { circumradius: 6.0 }, 0.0, 4.0)?,
        |prior: &Estimate<2>| {
            GridFilter::new(RandomWalk::uniform(0.02), model, *prior, GridConfig::default())
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
