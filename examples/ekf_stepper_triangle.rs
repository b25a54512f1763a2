//! The reference system put together by hand: steppers under three drones, the extended Kalman
//! filter, a triangle that follows the estimate (Pritzl 2018).
//!
//! `cargo run --example ekf_stepper_triangle`

#![expect(clippy::print_stdout, reason = "an example talks to whoever runs it")]

use std::{convert::Infallible, error::Error};

use foxhunt::{
    filters::Ekf,
    formation::{FollowConfig, FollowEstimate},
    hunt::Event,
    prelude::*,
    scenario::{Scenario, SimulationConfig},
    sensors::{LogDistance, Pritzl2018, RssBearing},
    sim::World,
    simulation::fly,
};

fn main() -> Result<(), Box<dyn Error>> {
    let scenario = Scenario::find("pritzl-6.1")?;
    let world = World::new(&scenario.world, 1)?;

    let model = RssBearing::new(LogDistance::pritzl2018_field());
    let mut hunt = Hunt::new(
        Pritzl2018::default(),
        FollowEstimate::new(FollowConfig::pritzl2018())?,
        |prior: &Estimate<2>| Ekf::pritzl2018(model, *prior),
        scenario.beacon_names(),
        // The reference filter starts from the reference prior (Pritzl 2018, §4.4).
        HuntConfig { prior_sigma_m: 70.0_f64.sqrt(), ..HuntConfig::default() },
        TrackConfig::pritzl2018(),
    )?;
    let mut sources = scenario.sources(&world)?;
    fly(&mut hunt, &world, &mut sources, SimulationConfig::default(), |event| {
        if let Event::PhaseChanged { time, phase } = event {
            println!("{time:7.1} s  {phase}");
        }
        Ok::<_, Infallible>(())
    })?;

    for fix in hunt.fixes() {
        let truth = world.truth(fix.beacon).ok_or("the world has this beacon")?.xy();
        let error = (fix.estimate.mean - truth).norm();
        println!("{}: {error:.2} m off after {} steps", fix.name, fix.steps);
    }
    Ok(())
}
