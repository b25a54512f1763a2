//! Three quadrotors that turn as a whole, the unscented Kalman filter, a triangle that follows the
//! estimate.
//!
//! `cargo run --example ukf_body_triangle`

#![expect(clippy::print_stdout, reason = "an example talks to whoever runs it")]

use std::{convert::Infallible, error::Error};

use foxhunt::{
    filters::Ukf,
    formation::{FollowConfig, FollowEstimate},
    prelude::*,
    scenario::{Scenario, SimulationConfig},
    sensors::{BodyConfig, LogDistance, Pritzl2018, RssBearing},
    sim::{QuadrotorConfig, VehicleConfig, World},
    simulation::fly,
};

fn main() -> Result<(), Box<dyn Error>> {
    let mut scenario = Scenario::find("pritzl-6.1")?;
    scenario.world.vehicle = VehicleConfig::Quadrotor(QuadrotorConfig::default());
    let world = World::new(&scenario.world, 1)?;
    let mut sources = (0..world.drone_count())
        .map(|drone| world.body(drone, BodyConfig::isaacs2014()))
        .collect::<Result<Vec<_>, _>>()?;

    let model = RssBearing::new(LogDistance::pritzl2018_field());
    let mut hunt = Hunt::new(
        Pritzl2018::default(),
        FollowEstimate::new(FollowConfig::pritzl2018())?,
        |prior: &Estimate<2>| Ukf::new(RandomWalk::uniform(0.02), model, *prior),
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
