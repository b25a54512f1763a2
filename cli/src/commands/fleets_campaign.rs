use foxhunt::{
    campaign::{CampaignError, FleetsReport, OWN, Violation, fleets_campaign},
    config::{NamedEstimator, NamedPlanner},
};

use super::choice;
use crate::{
    error::CliError,
    output::Output,
    progress::Progress,
    table::{list, number, table},
};

/// What `foxhunt campaign` calls hunts of random fleets.
pub(super) const NAME: &str = "fleets";

/// How many violations and failed hunts the tables hold; JSON has all.
const TOLD: usize = 20;

/// Flies random fleets and tells what they did that they must not.
pub(super) fn run(
    planner: Option<&NamedPlanner>,
    estimator: Option<&NamedEstimator>,
    runs: u32,
    seed: u64,
    jobs: usize,
    output: Output,
) -> Result<(), CliError> {
    let progress = Progress::new("hunts", u64::from(runs));
    let report = fleets_campaign(planner, estimator, runs, seed, jobs, &|| progress.step());
    progress.finish();
    let report = report.map_err(|error| match error {
        CampaignError::Simulation(error) => choice::simulation_error(error, NAME),
        error => CliError::failure(error),
    })?;
    output.result(&report, tables)?;
    judge(&report)
}

/// A failure where something happened that must not.
fn judge(report: &FleetsReport) -> Result<(), CliError> {
    match (report.violations.len(), report.errors.len()) {
        (0, 0) => Ok(()),
        (violations, errors) => Err(CliError::failure(format!(
            "{violations} violations, and {errors} hunts that could not go on"
        ))),
    }
}

/// The command that flies one of the hunts again.
fn again(report: &FleetsReport) -> String {
    let given = [("--planner", &report.planner), ("--estimator", &report.estimator)];
    let given = given.into_iter().filter(|(_, name)| *name != OWN);
    let flags: String = given.map(|(flag, name)| format!(" {flag} {name}")).collect();
    format!("`foxhunt hunt fleet-SEED --seed SEED{flags}` flies one of them again.")
}

fn tables(report: &FleetsReport) -> String {
    let mut ends = table(&["how it ended", "searches"]);
    for count in &report.outcomes {
        ends.add_row([count.outcome.to_string(), count.runs.to_string()]);
    }
    let mut figures = table(&["least spare", "", "all runs"]);
    let spares = [
        ("separation", "m", report.spare_separation_m, 3),
        ("fence and zones", "m", report.spare_airspace_m, 3),
        ("batteries", "s", report.spare_endurance_s, 1),
    ];
    for (what, unit, spare, decimals) in spares {
        figures.add_row([what.to_owned(), unit.to_owned(), number(spare, decimals)]);
    }
    let mut lines = vec![
        format!("{} random fleets, seeds from {}", report.runs, report.seed),
        ends.to_string(),
        figures.to_string(),
    ];
    if !report.errors.is_empty() {
        let mut errors = list(&["seed", "could not begin or go on"]);
        for failed in report.errors.iter().take(TOLD) {
            errors.add_row([failed.seed.to_string(), failed.reason.clone()]);
        }
        lines.push(format!("{} hunts failed. {}\n{errors}", report.errors.len(), again(report)));
    }
    if let Some(duration) = report.duration_s {
        lines.push(format!(
            "A hunt took {:.0} simulated seconds, a tenth of them more than {:.0}, the longest {:.0}.",
            duration.mean, duration.p90, duration.max
        ));
    }
    lines.push(format!(
        "{} drones were stuck or out of reach when they had to fly home.",
        report.stranded
    ));
    lines.push(violations(report));
    lines.join("\n")
}

fn violations(report: &FleetsReport) -> String {
    let violations: &[Violation] = &report.violations;
    if violations.is_empty() {
        return "No violation.".to_owned();
    }
    let mut told = table(&["violation", "seed", "at s", "drones", "is", "limit"]);
    for violation in violations.iter().take(TOLD) {
        let drones: Vec<String> =
            violation.drones.iter().map(|drone| (drone + 1).to_string()).collect();
        told.add_row([
            violation.breach.name().to_owned(),
            violation.seed.to_string(),
            number(violation.time_s, 1),
            drones.join(", "),
            number(violation.value, 3),
            number(violation.limit, 3),
        ]);
    }
    format!("{} violations. {}\n{told}", violations.len(), again(report))
}

#[cfg(test)]
mod tests {
    use foxhunt::{campaign::Breach, config::planner_named};

    use super::*;

    #[test]
    fn a_violation_is_a_failure_and_the_advice_flies_the_same_hunt() {
        let orbit = planner_named("orbit");
        let report = fleets_campaign(orbit.as_ref(), None, 0, 1, 1, &|| ());
        let mut report = report.expect("no hunt at all");
        assert!(judge(&report).is_ok());
        let violation = Violation {
            seed: 7,
            breach: Breach::Airspace,
            time_s: 1.0,
            drones: vec![0],
            value: -1.0,
            limit: 0.0,
        };
        report.violations.push(violation);
        let told = tables(&report);
        assert!(matches!(judge(&report), Err(CliError::Failure(_))));
        assert!(told.contains("`foxhunt hunt fleet-SEED --seed SEED --planner orbit`"), "{told}");
    }
}
