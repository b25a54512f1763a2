use foxhunt::campaign::{FleetsReport, OWN, Violation, fleets_campaign};

use super::{
    choice,
    settings::{Planning, Runs},
};
use crate::{
    error::CliError,
    output::Context,
    table::{list, number, table},
};

/// Fly random fleets and check the rules of the air
///
/// Flies hunts with fleets of one to eight drones in which everything that may go wrong is drawn at
/// random. Checks that no drone came nearer to another than its separation, left the fence or the
/// band of altitudes, or flew with empty batteries, and counts how searches ended. The exit code is
/// 1 if a rule was broken or a hunt failed. `fleet-` and a seed is the scenario of one of the
/// hunts.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  foxhunt fleets --runs 10000\n  \
                        foxhunt fleets --runs 1000 --planner orbit\n  \
                        foxhunt hunt fleet-7 --seed 7")]
pub struct Args {
    #[command(flatten)]
    runs: Runs,
    #[command(flatten)]
    planning: Planning,
    /// The estimator [default: the scenarios' own]
    #[arg(long, value_name = "NAME")]
    estimator: Option<String>,
}

/// Maximum number of violations and of failed hunts in the tables; JSON has all.
const MOST_ROWS: usize = 20;

pub fn run(args: &Args, context: Context<'_>) -> Result<(), CliError> {
    let Context { output, registry, .. } = context;
    let planner = args.planning.entry(registry)?;
    let estimator = args.estimator.as_deref();
    let estimator = estimator.map(|name| choice::estimator(registry, name, "--estimator"));
    let estimator = estimator.transpose()?;
    let report = args.runs.with_progress(output, "hunts", 1, |repetition| {
        fleets_campaign(registry, planner, estimator, repetition)
    });
    let report = report.map_err(|error| choice::campaign_error(error, "fleets"))?;
    output.result(&report, tables)?;
    judge(&report)
}

/// Returns a failure if a rule was broken or a hunt failed.
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
        for failed in report.errors.iter().take(MOST_ROWS) {
            errors.add_row([failed.seed.to_string(), failed.reason.clone()]);
        }
        lines.push(format!("{} hunts failed. {}\n{errors}", report.errors.len(), again(report)));
    }
    if let Some(duration) = report.duration_s {
        lines.push(format!(
            "A hunt took {:.0} simulated seconds, a tenth of them more than {:.0}, the longest \
             {:.0}.",
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
    let mut rows = table(&["violation", "seed", "at s", "drones", "is", "limit"]).named_by(2);
    for violation in violations.iter().take(MOST_ROWS) {
        let drones: Vec<String> =
            violation.drones.iter().map(|drone| (drone + 1).to_string()).collect();
        rows.add_row([
            violation.breach.name().to_owned(),
            violation.seed.to_string(),
            number(violation.time_s, 1),
            drones.join(", "),
            number(violation.value, 3),
            number(violation.limit, 3),
        ]);
    }
    format!("{} violations. {}\n{rows}", violations.len(), again(report))
}

#[cfg(test)]
mod tests {
    use foxhunt::{
        campaign::{Breach, Repetition},
        registry::Registry,
    };

    use super::*;

    #[test]
    fn a_violation_is_a_failure_and_the_command_flies_the_same_hunt() {
        let registry = Registry::builtin();
        let orbit = registry.planner("orbit").expect("it is built in");
        let report = fleets_campaign(&registry, Some(orbit), None, &Repetition::new(0));
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
        let printed = tables(&report);
        assert!(matches!(judge(&report), Err(CliError::Failure(_))));
        let command = "`foxhunt hunt fleet-SEED --seed SEED --planner orbit`";
        assert!(printed.contains(command), "{printed}");
    }
}
