//! The information-driven planner against the reference's, on the same seeds with the same
//! estimator.
//!
//! `cargo run --release --example information_planner`

#![expect(clippy::print_stdout, reason = "an example talks to whoever runs it")]

use std::error::Error;

use foxhunt::{
    campaign::planners_campaign,
    config::{estimator_named, planner_named},
    formation::{Information, InformationConfig},
    prelude::*,
    scenario::Scenario,
};
use nalgebra::Vector2;

fn main() -> Result<(), Box<dyn Error>> {
    // One plan by itself: three drones, and a target that is believed to be some 60 m to the East.
    let mut planner = Information::new(InformationConfig::default())?;
    let drone = |east, north| Station::holding(Pose::at(east, north, 4.0));
    let mut stations = [drone(0.0, 0.0), drone(5.0, 0.0), drone(0.0, 5.0)];
    let belief = Estimate::isotropic(Vector2::new(60.0, 10.0), 12.0);
    planner.plan(&belief, &mut stations)?;
    let mut why = String::new();
    planner.explain(&mut why)?;
    println!("the first decision: {why}");

    // Twenty hunts with each planner.
    let scenario = Scenario::find("pritzl-6.1")?;
    let estimator = estimator_named("grid").ok_or("it has a name")?;
    let planners = ["pritzl2018", "information"]
        .map(|name| planner_named(name).ok_or(format!("there is no planner {name}")));
    let planners = planners.into_iter().collect::<Result<Vec<_>, _>>()?;
    let report = planners_campaign(&scenario, &estimator, &planners, 20, 1, 2, &|| ())?;
    for planner in &report.planners {
        for beacon in &planner.beacons {
            let figures = &beacon.figures;
            let steps = figures.steps_to_3m.as_ref().and_then(|steps| steps.p50);
            let (Some(steps), Some(error)) = (steps, figures.error_m) else { continue };
            let name = &planner.planner;
            println!("{name}, {}: 3 m after {steps} steps, {:.2} m rms", figures.name, error.rms);
        }
    }
    Ok(())
}
