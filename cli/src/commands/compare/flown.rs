use foxhunt::{
    campaign::{CampaignError, Repetition},
    registry::EstimatorEntry,
    scenario::{DEFAULT_SCENARIO, Scenario},
};

use crate::{
    commands::{choice, planning::Planning, repetition::Runs, settings::Settings},
    context::Context,
    error::CliError,
};

/// A scenario that every setup and estimator flies on the same seeds.
#[derive(Debug, clap::Args)]
pub(super) struct Flown {
    /// A built-in scenario (`foxhunt list scenarios`) or a TOML file
    #[arg(default_value = DEFAULT_SCENARIO)]
    scenario: String,
    #[command(flatten)]
    runs: Runs,
    /// An estimator; may be repeated [default: the scenario's own]
    #[arg(long, value_name = "NAME")]
    estimator: Vec<String>,
    #[command(flatten)]
    planning: Planning,
    #[command(flatten)]
    settings: Settings,
}

impl Flown {
    /// Flies the scenario with each estimator in a number of `setups`, and shows progress.
    pub(super) fn campaign<R>(
        &self,
        context: Context<'_>,
        setups: usize,
        fly: impl FnOnce(&Scenario, &[EstimatorEntry], &Repetition<'_>) -> Result<R, CampaignError>,
    ) -> Result<R, CliError> {
        let Context { output, registry, .. } = context;
        let mut scenario = choice::scenario(&self.scenario)?;
        self.settings.apply_to(&mut scenario, registry)?;
        self.planning.apply_to(&mut scenario, registry)?;
        let chosen = choice::estimators_of(registry, &self.estimator, &scenario, &self.scenario)?;
        let settled = chosen.into_iter().map(|entry| self.settings.estimator(entry));
        let estimators: Vec<EstimatorEntry> = settled.collect::<Result<_, _>>()?;
        let contenders = estimators.len() * setups;
        let report = self.runs.with_progress(output, "hunts", contenders, |repetition| {
            fly(&scenario, &estimators, repetition)
        });
        report.map_err(|error| choice::campaign_error(error, &self.scenario))
    }
}
