//! Scenarios, trials and estimators, as they are named on the command line and in files.

use foxhunt::{
    campaign::CampaignError,
    registry::{EstimatorEntry, Registry},
    scenario::{Scenario, ScenarioError},
    simulation::SimulationError,
    trial::{Trial, TrialError, builtin_trials},
};

use crate::{
    error::{CliError, InFile},
    hints::{build, feature_of, retired_campaign},
};

/// The estimator of a name; `place` is where the name stands.
pub(super) fn estimator<'a>(
    registry: &'a Registry,
    name: &str,
    place: &str,
) -> Result<&'a EstimatorEntry, CliError> {
    registry.estimator(name).map_err(|error| {
        let hint = feature_of(name).map_or_else(String::new, |feature| {
            format!("; it needs a build with the feature {feature}: {}", build(feature))
        });
        CliError::input(format!("{place}: {error}{hint}"))
    })
}

/// The estimators of names, each once.
pub(super) fn estimators<'a>(
    registry: &'a Registry,
    names: &[String],
) -> Result<Vec<&'a EstimatorEntry>, CliError> {
    let mut entries: Vec<&EstimatorEntry> = Vec::new();
    for name in names {
        if !entries.iter().any(|entry| entry.name == *name) {
            entries.push(estimator(registry, name, "--estimator")?);
        }
    }
    Ok(entries)
}

/// The estimator of the command line, or else the scenario's own.
pub(super) fn estimator_of<'a>(
    registry: &'a Registry,
    given: Option<&str>,
    scenario: &Scenario,
    file: &str,
) -> Result<&'a EstimatorEntry, CliError> {
    match given {
        Some(name) => estimator(registry, name, "--estimator"),
        None => estimator(registry, &scenario.estimator, &format!("{file}: estimator")),
    }
}

/// The estimators of the command line, or else the scenario's own.
pub(super) fn estimators_of<'a>(
    registry: &'a Registry,
    given: &[String],
    scenario: &Scenario,
    file: &str,
) -> Result<Vec<&'a EstimatorEntry>, CliError> {
    if given.is_empty() {
        return Ok(vec![estimator_of(registry, None, scenario, file)?]);
    }
    estimators(registry, given)
}

/// The scenario of a built-in name or of a file.
pub(super) fn scenario(name_or_path: &str) -> Result<Scenario, CliError> {
    Scenario::find(name_or_path).map_err(|error: ScenarioError| {
        match retired_campaign(name_or_path) {
            Some(command) => {
                CliError::input(format!("{name_or_path} is not a scenario: `{command}`"))
            }
            None => CliError::input(error),
        }
    })
}

/// The trial of a built-in name or of a file.
pub(super) fn trial(name_or_path: &str) -> Result<Trial, CliError> {
    let trial = Trial::find(name_or_path).map_err(CliError::input)?;
    trial.ok_or_else(|| {
        if Scenario::find(name_or_path).is_ok() {
            return CliError::input(format!(
                "{name_or_path} is a scenario, not a trial: `foxhunt campaign {name_or_path}`"
            ));
        }
        let known: Vec<String> = builtin_trials().into_iter().map(|trial| trial.name).collect();
        CliError::input(format!(
            "{name_or_path:?} is neither a built-in trial ({}) nor a file of one",
            known.join(", ")
        ))
    })
}

/// Returns the error of a trial that went wrong.
pub(super) fn trial_error(error: TrialError) -> CliError {
    match error {
        TrialError::Threads(_) => CliError::failure(error),
        _ => CliError::input(error),
    }
}

/// Returns the error of a simulation that went wrong; wrong input if the scenario cannot be built.
pub(super) fn simulation_error(error: SimulationError, file: &str) -> CliError {
    match error {
        SimulationError::Drive(_) | SimulationError::TooLong { .. } | SimulationError::Log(_) => {
            CliError::failure(error)
        }
        _ => CliError::input(InFile { file: file.to_owned(), source: Box::new(error) }),
    }
}

/// Returns the error of a campaign that went wrong.
pub(super) fn campaign_error(error: CampaignError, file: &str) -> CliError {
    match error {
        CampaignError::Simulation(error) => simulation_error(error, file),
        error => CliError::failure(error),
    }
}
