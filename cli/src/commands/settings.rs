use foxhunt::{
    registry::{EstimatorEntry, Registry},
    scenario::Scenario,
};

use super::{calibration::Calibration, extraction::Extraction, overrides::Overrides};
use crate::error::CliError;

/// What a flown hunt has otherwise than its scenario, besides the planner.
#[derive(Debug, clap::Args)]
pub(super) struct Settings {
    #[command(flatten)]
    extraction: Extraction,
    #[command(flatten)]
    overrides: Overrides,
    #[command(flatten)]
    calibration: Calibration,
}

impl Settings {
    /// Sets calibration, bearings and extractor of a scenario.
    pub(super) fn apply_to(
        &self,
        scenario: &mut Scenario,
        registry: &Registry,
    ) -> Result<(), CliError> {
        self.calibration.read()?.apply_to(scenario);
        self.overrides.apply_to(scenario);
        scenario.extractor = self.extraction.config(registry, &scenario.extractor)?;
        self.overrides.warn_of_turned_patterns(scenario);
        Ok(())
    }

    /// The estimator with the settings of the command line.
    pub(super) fn estimator(&self, entry: &EstimatorEntry) -> Result<EstimatorEntry, CliError> {
        self.overrides.estimator(entry)
    }
}
