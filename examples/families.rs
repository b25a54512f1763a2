//! Every family of estimators, on a stepper and on a body that turns, with the reference's triangle
//! and with a planner of your own: one table of hunts.
//!
//! `cargo run --example families`

#![expect(clippy::print_stdout, reason = "an example shows what it found")]

use std::{convert::Infallible, error::Error};

use foxhunt::{
    config::SourceConfig,
    prelude::*,
    registry::PlannerEntry,
    sensors::{BodyConfig, StepperConfig},
};

/// One name of each family; `foxhunt list estimators` has them all.
const FAMILIES: [&str; 5] = ["ekf", "ukf", "particle", "gaussian-sum", "grid"];

/// Goes half way to the estimate with every turn, spread over a line, until the belief is small.
struct HalfWay;

impl FormationPlanner for HalfWay {
    fn plan(
        &mut self,
        belief: &dyn Belief,
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        let target = belief.position();
        for (offset, station) in [-6.0, 0.0, 6.0].into_iter().zip(stations) {
            let half_way = (station.pose.position.xy() + target.mean) * 0.5;
            station.goal.position = half_way.push(4.0);
            station.goal.position.x += offset;
        }
        Ok(if target.covariance.trace().sqrt() < 1.5 {
            Decision::Finish(Outcome::Converged)
        } else {
            Decision::Listen(Stage::Searching)
        })
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let half_way =
        PlannerEntry::own("half-way", "half way to the estimate", "own", |_| Box::new(HalfWay));
    let registry = Registry::builtin().with_planner(half_way);
    let sources = [
        ("stepper", SourceConfig::Stepper(StepperConfig::pritzl2018())),
        ("body", SourceConfig::RotatingBody(BodyConfig::pritzl2018())),
    ];
    println!("estimator       source   planner      beacon 1, beacon 2");
    for family in FAMILIES {
        for (source_name, source) in &sources {
            for planner in ["pritzl2018", "half-way"] {
                let mut scenario = Scenario::find("pritzl-6.1")?;
                scenario.source = source.clone();
                scenario.planner = registry.planner(planner)?.config(&scenario.field());
                let estimator = registry.estimator(family)?;
                let setup = Setup { scenario: &scenario, estimator, registry: &registry };
                let hunt = setup.simulate(1, |_event| Ok::<_, Infallible>(()))?;
                let errors: Vec<String> =
                    hunt.found.iter().map(|found| format!("{:.2} m", found.error_m())).collect();
                println!("{family:15} {source_name:8} {planner:12} {}", errors.join(", "));
            }
        }
    }
    Ok(())
}
