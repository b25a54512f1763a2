//! Two kinds of sources in one hunt: two drones turn a directional antenna, the third one has a rod
//! and measures levels alone.
//!
//! `cargo run --example two_sources`

#![expect(clippy::print_stdout, reason = "an example shows what it found")]

use std::{convert::Infallible, error::Error};

use foxhunt::{config::SourceConfig, prelude::*};

fn main() -> Result<(), Box<dyn Error>> {
    let registry = Registry::builtin();
    let mut scenario = Scenario::find("pritzl-6.1")?;
    scenario.sources = vec![
        SourceConfig::Stepper(Default::default()),
        SourceConfig::RotatingBody(Default::default()),
        SourceConfig::Omnidirectional(Default::default()),
    ];
    let estimator = registry.estimator("grid")?;
    let setup = Setup { scenario: &scenario, estimator, registry: &registry };
    let mut bearings = [0; 3];
    let mut levels = [0; 3];
    let hunt = setup.simulate(1, |event| {
        if let Event::Received { drone, reception, .. } = event {
            bearings[*drone] += u32::from(reception.has_bearing());
            levels[*drone] += u32::from(reception.level.is_some());
        }
        Ok::<_, Infallible>(())
    })?;
    for (drone, (bearings, levels)) in bearings.iter().zip(levels).enumerate() {
        println!("drone {}: {levels} levels, {bearings} bearings", drone + 1);
    }
    for found in &hunt.found {
        println!("{}: {:.2} m off", found.fix.name, found.error_m());
    }
    Ok(())
}
