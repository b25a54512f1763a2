//! Three drones of which one is lost and comes back, and one falls silent: the formation closes up
//! and the hunt goes on.
//!
//! `cargo run --example drone_lost`

#![expect(clippy::print_stdout, reason = "an example shows what it found")]

use std::{convert::Infallible, error::Error};

use foxhunt::{prelude::*, sim::Interval};

fn main() -> Result<(), Box<dyn Error>> {
    let mut scenario = Scenario::find("pritzl-6.1")?;
    // The second drone neither answers nor obeys for a minute, the third receives nothing any more.
    scenario.world.drones[1].lost = vec![Interval { from_s: 20.0, to_s: Some(80.0) }];
    scenario.world.drones[2].silent_after_s = Some(60.0);
    scenario.hunt.turn_timeout_s = 20.0;

    let registry = Registry::builtin();
    let estimator = registry.estimator("particle")?;
    let setup = Setup { scenario: &scenario, estimator, registry: &registry };
    let hunt = setup.simulate(1, |event| {
        match event {
            Event::DutyChanged { time, drone, duty } => {
                println!("{time:6.1} s  drone {}: {duty}", drone + 1);
            }
            Event::Missing { time, drone, waited_s } => {
                println!("{time:6.1} s  drone {}: nothing in {waited_s:.0} s", drone + 1);
            }
            _ => {}
        }
        Ok::<_, Infallible>(())
    })?;
    for found in &hunt.found {
        let fix = &found.fix;
        let error = found.error_m();
        println!("{}: {error:.2} m off after {} steps, {}", fix.name, fix.steps, fix.outcome);
    }
    Ok(())
}
