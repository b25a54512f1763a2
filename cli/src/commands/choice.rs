//! Scenarios, trials, estimators and extractors, as they are named on the command line and in
//! files.

use foxhunt::{
    campaign::CampaignError,
    config::{BoxedExtractor, ExtractorConfig},
    registry::{EstimatorEntry, ExtractorEntry, Registry, antenna_named},
    scenario::{Scenario, ScenarioError},
    simulation::SimulationError,
    trial::{Trial, TrialError, builtin_trials},
};

use crate::{
    error::{CliError, InFile},
    hints::{build, feature_of, retired_campaign},
};

/// The estimator of a name; `place` is where the name stands.
pub fn estimator<'a>(
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
pub fn estimators<'a>(
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
pub fn estimator_of<'a>(
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
pub fn estimators_of<'a>(
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
pub fn scenario(name_or_path: &str) -> Result<Scenario, CliError> {
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
pub fn trial(name_or_path: &str) -> Result<Trial, CliError> {
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
pub fn trial_error(error: TrialError) -> CliError {
    match error {
        TrialError::Threads(_) => CliError::failure(error),
        _ => CliError::input(error),
    }
}

/// Returns the error of a simulation that went wrong; wrong input if the scenario cannot be built.
pub fn simulation_error(error: SimulationError, file: &str) -> CliError {
    match error {
        SimulationError::Drive(_) | SimulationError::TooLong { .. } | SimulationError::Log(_) => {
            CliError::failure(error)
        }
        _ => CliError::input(InFile { file: file.to_owned(), source: Box::new(error) }),
    }
}

/// Returns the error of a campaign that went wrong.
pub fn campaign_error(error: CampaignError, file: &str) -> CliError {
    match error {
        CampaignError::Simulation(error) => simulation_error(error, file),
        error => CliError::failure(error),
    }
}

/// Extractor of bearings from turns, and the antenna that it knows.
#[derive(Debug, clap::Args)]
pub struct Extraction {
    /// The extractor of bearings from turns (`foxhunt list extractors` describes them)
    #[arg(long, value_name = "NAME")]
    extractor: Option<String>,
    /// The antenna that the extractor knows: reference-patch, isotropic, dipole, cardioid, patch,
    /// yagi, or a file (msi, pln, csv)
    #[arg(long, value_name = "NAME|FILE")]
    antenna: Option<String>,
}

/// Name of the default extractor.
const DEFAULT_EXTRACTOR: &str = "pritzl2018";

impl Extraction {
    /// The extractor of the command line, or else `own`, with the antenna of the command line.
    pub fn config(
        &self,
        registry: &Registry,
        own: &ExtractorConfig,
    ) -> Result<ExtractorConfig, CliError> {
        let config = match &self.extractor {
            Some(name) => registry.extractor(name).map_err(CliError::input)?.config(),
            None => own.clone(),
        };
        let Some(antenna) = &self.antenna else { return Ok(config) };
        config.with_antenna(&antenna_named(antenna)).ok_or_else(|| {
            CliError::input(
                "--antenna is for extractors that know it: cross-correlation and the likelihood \
                 ones",
            )
        })
    }

    /// Builds the extractor of the command line, or else the reference's.
    pub fn build(&self, registry: &Registry) -> Result<BoxedExtractor, CliError> {
        let config = self.config(registry, &ExtractorConfig::default())?;
        registry.build_extractor(&config).map_err(CliError::input)
    }

    /// Builds every extractor; with the command line's antenna if the extractor takes one.
    pub fn all<'a>(
        &self,
        registry: &'a Registry,
    ) -> Result<Vec<(&'a str, BoxedExtractor)>, CliError> {
        let antenna = self.antenna.as_deref().map(antenna_named);
        let build = |entry: &'a ExtractorEntry| {
            let config = entry.config();
            let known = antenna.as_ref().and_then(|a| config.clone().with_antenna(a));
            let built = registry.build_extractor(&known.unwrap_or(config));
            Ok((entry.name.as_ref(), built.map_err(CliError::input)?))
        };
        registry.extractors().iter().map(build).collect()
    }

    /// Returns true if the command line has an extractor or an antenna.
    pub fn is_given(&self) -> bool {
        self.extractor.is_some() || self.antenna.is_some()
    }

    /// The name of the extractor that [`build`](Self::build) makes.
    pub fn name(&self) -> &str {
        self.extractor.as_deref().unwrap_or(DEFAULT_EXTRACTOR)
    }
}
