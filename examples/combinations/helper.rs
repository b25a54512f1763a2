//! The hunt of all combinations: the world of `pritzl-6.1` with an estimator, a source and a
//! planner.

#![expect(dead_code, reason = "each combination uses one source and one planner")]
#![expect(clippy::print_stdout, reason = "an example shows what it found")]

use std::convert::Infallible;

pub(crate) use std::error::Error;

use foxhunt::{
    config::SourceConfig,
    formation::{FollowConfig, FollowEstimate},
    prelude::*,
    registry::PlannerEntry,
    sensors::{BodyConfig, StepperConfig},
};

/// Antenna on a stepper motor.
pub(crate) fn stepper() -> SourceConfig {
    SourceConfig::Stepper(StepperConfig::pritzl2018())
}

/// Antenna that is fixed to a drone, which turns as a whole.
pub(crate) fn rotating_body() -> SourceConfig {
    SourceConfig::RotatingBody(BodyConfig::pritzl2018())
}

/// The triangle of the reference, which follows the estimate.
pub(crate) fn triangle() -> PlannerEntry {
    PlannerEntry::own("triangle", "follows the estimate", "Pritzl 2018, §5.2", |_| {
        let reference = FollowConfig::pritzl2018();
        Box::new(FollowEstimate::new(reference).expect("the reference's parameters are in range"))
    })
}

/// A custom planner: on a line half way to the estimate, until that is small.
pub(crate) fn custom() -> PlannerEntry {
    PlannerEntry::own("custom", "half way to the estimate", "own", |_| Box::new(HalfWay::default()))
}

#[derive(Default)]
struct HalfWay {
    turns: u32,
}

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
        self.turns += 1;
        Ok(if target.covariance.trace().sqrt() < 2.5 {
            Decision::Finish(Outcome::Converged)
        } else if self.turns.is_multiple_of(40) {
            Decision::Finish(Outcome::MoveLimit)
        } else {
            Decision::Listen(Stage::Searching)
        })
    }
}

/// Flies the hunt, and prints how far off each beacon was found.
pub(crate) fn hunt(
    estimator: &str,
    source: SourceConfig,
    planner: PlannerEntry,
) -> Result<(), Box<dyn Error>> {
    let mut scenario = Scenario::find("pritzl-6.1")?;
    scenario.source = source;
    let name = planner.name.clone();
    let registry = Registry::builtin().with_planner(planner);
    scenario.planner = registry.planner(&name)?.config(&scenario.field());
    let estimator = registry.estimator(estimator)?;
    let setup = Setup { scenario: &scenario, estimator, registry: &registry };
    for found in setup.simulate(1, |_event| Ok::<_, Infallible>(()))?.found {
        let fix = &found.fix;
        println!("{}: {:.2} m off, {}", fix.name, found.error_m(), fix.outcome);
    }
    Ok(())
}
