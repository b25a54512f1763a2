//! Scenarios and estimators, as they are named on the command line.

use clap::builder::PossibleValuesParser;
use foxhunt::{
    config::{NamedEstimator, estimator_named, estimators},
    scenario::{Scenario, ScenarioError},
    simulation::SimulationError,
    trial::{Trial, TrialError, TrialEstimator, trial_estimator_named, trial_estimators},
};

use crate::error::{CliError, InFile};

/// Takes the name of an estimator; what is unknown is refused with the names that are known.
pub(super) fn estimator_parser() -> PossibleValuesParser {
    PossibleValuesParser::new(estimators().into_iter().map(|known| known.name))
}

/// The trial of a built-in name or of a file; `None` where it is none.
pub(super) fn trial(name_or_path: &str) -> Result<Option<Trial>, CliError> {
    Trial::find(name_or_path).map_err(CliError::input)
}

/// The trial's estimator of a name that the command line or a file holds.
pub(super) fn trial_estimator(name: &str, place: &str) -> Result<TrialEstimator, CliError> {
    trial_estimator_named(name).ok_or_else(|| {
        let known: Vec<_> = trial_estimators().iter().map(|known| known.name).collect();
        let known = known.join(", ");
        CliError::input(format!("{place} is {name:?}, no estimator of trials; those are {known}"))
    })
}

/// Whether a trial that went wrong is the fault of what was asked for.
pub(super) fn trial_error(error: TrialError) -> CliError {
    match error {
        TrialError::Threads { .. } => CliError::failure(error),
        _ => CliError::input(error),
    }
}

/// The estimator of a name that the command line or a file holds; `place` says where it stands.
pub(super) fn estimator(name: &str, place: &str) -> Result<NamedEstimator, CliError> {
    estimator_named(name).ok_or_else(|| {
        let known: Vec<_> = estimators().into_iter().map(|known| known.name).collect();
        let known = known.join(", ");
        CliError::input(format!("{place} is {name:?}, no estimator; those are {known}"))
    })
}

/// The scenario of a built-in name or of a file.
pub(super) fn scenario(name_or_path: &str) -> Result<Scenario, CliError> {
    Scenario::find(name_or_path).map_err(|error: ScenarioError| CliError::input(error))
}

/// The estimator that was asked for, or else the scenario's own.
pub(super) fn estimator_of(
    asked: Option<&str>,
    scenario: &Scenario,
    file: &str,
) -> Result<NamedEstimator, CliError> {
    match asked {
        Some(name) => estimator(name, "--estimator"),
        None => estimator(&scenario.estimator, &format!("{file}: estimator")),
    }
}

/// Whether a simulation that went wrong is the fault of what the scenario's file says.
pub(super) fn simulation_error(error: SimulationError, file: &str) -> CliError {
    match error {
        SimulationError::Drive(_) | SimulationError::TooLong { .. } | SimulationError::Log(_) => {
            CliError::failure(error)
        }
        _ => CliError::input(InFile { file: file.to_owned(), source: Box::new(error) }),
    }
}
