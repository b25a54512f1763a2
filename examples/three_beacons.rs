//! Three beacons that every turn listens for, a planner that weighs them, and one that shows up
//! later.
//!
//! `cargo run --example three_beacons`

#![expect(clippy::print_stdout, reason = "an example talks to whoever runs it")]

use std::{convert::Infallible, error::Error};

use foxhunt::{
    config::{estimator_named, planner_named},
    hunt::Event,
    scenario::Scenario,
    simulation::simulate,
};

fn main() -> Result<(), Box<dyn Error>> {
    let mut scenario = Scenario::find("three-beacons")?;
    let estimator = estimator_named("particle").ok_or("it is built in")?;
    for name in ["pritzl2018", "information"] {
        scenario.planner = planner_named(name).ok_or("it is built in")?.config(&scenario);
        println!("{name}:");
        let hunt = simulate(&scenario, &estimator, 1, |event| {
            match event {
                Event::BeaconStarted { time, name, .. } => {
                    println!("{time:6.0} s  {name} is taken in")
                }
                Event::Planned { time, reason, .. } => println!("{time:6.0} s  {reason}"),
                _ => {}
            }
            Ok::<_, Infallible>(())
        })?;
        for found in &hunt.found {
            let (fix, error) = (&found.fix, found.error_m());
            println!("{}: {error:.2} m off after {} steps, {}", fix.name, fix.steps, fix.outcome);
        }
        println!("{:.0} s, {:.0} m\n", hunt.duration_s, hunt.path_m.iter().sum::<f64>());
    }
    Ok(())
}
