//! Three beacons in shared turns, a planner that weighs them, and one that shows up later.
//!
//! `cargo run --example three_beacons`

#![expect(clippy::print_stdout, reason = "an example shows what it found")]

use std::{convert::Infallible, error::Error};

use foxhunt::prelude::*;

fn main() -> Result<(), Box<dyn Error>> {
    let mut scenario = Scenario::find("three-beacons")?;
    let registry = Registry::builtin();
    let estimator = registry.estimator("particle")?;
    for name in ["pritzl2018", "information"] {
        scenario.planner = registry.planner(name)?.config(&scenario.field());
        println!("{name}:");
        let setup = Setup { scenario: &scenario, estimator, registry: &registry };
        let hunt = setup.simulate(1, |event| {
            match event {
                Event::BeaconStarted { time, name, .. } => {
                    println!("{time:6.0} s  {name} is searched for")
                }
                Event::Planned { time, reason, .. } => println!("{time:6.0} s  {reason}"),
                _ => {}
            }
            Ok::<_, Infallible>(())
        })?;
        for found in &hunt.found {
            let fix = &found.fix;
            let error = found.error_m();
            println!("{}: {error:.2} m off after {} steps, {}", fix.name, fix.steps, fix.outcome);
        }
        println!("{:.0} s, {:.0} m\n", hunt.duration_s, hunt.path_m.iter().sum::<f64>());
    }
    Ok(())
}
