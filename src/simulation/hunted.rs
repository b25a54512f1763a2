use foxhunt_core::{BeaconId, Estimate, EstimatorError, FormationPlanner};
use foxhunt_sensors::Calibrated;

use super::SimulationError;
use crate::{
    config::{BoxedEstimator, BoxedExtractor, NamedEstimator, beacon_seed},
    hunt::Hunt,
    scenario::Scenario,
};

/// What makes receptions of sweeps in a scenario, its calibration of bearings included.
pub type ScenarioExtractor = Calibrated<BoxedExtractor>;

/// The extractor that a scenario describes.
///
/// # Errors
///
/// [`SimulationError`] names the number that is out of its range.
pub fn scenario_extractor(scenario: &Scenario) -> Result<ScenarioExtractor, SimulationError> {
    let bearings = scenario.bearings.unwrap_or_default();
    bearings.wrap(scenario.extractor.build()?).map_err(SimulationError::Bearings)
}

/// The hunt that a scenario describes, which has not begun: its extractor, planner and rules, and an
/// estimator for each beacon, in their order, with its share of the seed.
///
/// # Errors
///
/// [`SimulationError`] when a part of the scenario cannot be built.
#[expect(clippy::type_complexity, reason = "the closure has no name")]
pub fn scenario_hunt(
    scenario: &Scenario,
    estimator: &NamedEstimator,
    seed: u64,
) -> Result<
    Hunt<
        ScenarioExtractor,
        Box<dyn FormationPlanner>,
        impl FnMut(&Estimate<2>) -> Result<BoxedEstimator<2, 2>, EstimatorError> + use<>,
        BoxedEstimator<2, 2>,
        2,
        2,
    >,
    SimulationError,
> {
    let model = scenario.model.build()?;
    let config = estimator.config;
    let mut next_beacon = 0;
    let estimators = move |prior: &Estimate<2>| {
        let seed = beacon_seed(seed, BeaconId(next_beacon));
        next_beacon += 1;
        config.build(model.clone(), prior, seed)
    };
    Ok(Hunt::new(
        scenario_extractor(scenario)?,
        scenario.planner.build()?,
        estimators,
        scenario.beacon_names(),
        scenario.hunt.clone(),
        config.track,
    )?)
}
