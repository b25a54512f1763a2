use foxhunt_core::{BeaconId, Estimate, EstimatorError, FormationPlanner};
use foxhunt_sensors::{AntennaError, Calibrated, ParameterError};

use super::{Hunt, HuntConfig, HuntError};
use crate::{
    calibration::BearingCalibration,
    config::{
        BoxedEstimator, BoxedExtractor, EstimatorConfig, ExtractorConfig, ExtractorConfigError,
        ModelConfig, PlannerConfig, PlannerConfigError, beacon_seed,
    },
};

/// An extractor that was chosen at run time, with the calibration of its bearings.
pub type HuntExtractor = Calibrated<BoxedExtractor>;

/// A hunt whose parts were chosen at run time.
pub type BoxedHunt = Hunt<
    HuntExtractor,
    Box<dyn FormationPlanner>,
    Box<dyn FnMut(&Estimate<2>) -> Result<BoxedEstimator<2, 2>, EstimatorError>>,
    BoxedEstimator<2, 2>,
    2,
    2,
>;

/// What a hunt is made of, as it stands in files.
#[derive(Clone, Debug)]
pub struct HuntParts<'a> {
    /// What makes a level and a bearing of a turn.
    pub extractor: &'a ExtractorConfig,
    /// How the bearings err; as they are where absent.
    pub bearings: Option<BearingCalibration>,
    /// What decides where to listen.
    pub planner: &'a PlannerConfig,
    /// What the estimators take for the law of propagation.
    pub model: &'a ModelConfig,
    /// What is believed with.
    pub estimator: EstimatorConfig,
    /// Time-outs, tolerances, the prior.
    pub hunt: &'a HuntConfig,
    /// The beacons' names, in their order.
    pub beacons: Vec<String>,
    /// The seed of estimators that draw random numbers.
    pub seed: u64,
}

impl HuntParts<'_> {
    /// Puts them together.
    ///
    /// # Errors
    ///
    /// [`PartsError`] names the part that cannot be built.
    pub fn build(self) -> Result<BoxedHunt, PartsError> {
        let model = self.model.build()?;
        let (estimator, seed) = (self.estimator, self.seed);
        let mut next_beacon = 0;
        let estimators = move |prior: &Estimate<2>| {
            let seed = beacon_seed(seed, BeaconId(next_beacon));
            next_beacon += 1;
            estimator.build(model.clone(), prior, seed)
        };
        Ok(Hunt::new(
            hunt_extractor(self.extractor, self.bearings)?,
            self.planner.build()?,
            Box::new(estimators) as _,
            self.beacons,
            self.hunt.clone(),
            estimator.track,
        )?)
    }
}

/// The extractor alone: for a drone that makes receptions of its own sweeps.
///
/// # Errors
///
/// [`PartsError`] names what is out of range.
pub fn hunt_extractor(
    extractor: &ExtractorConfig,
    bearings: Option<BearingCalibration>,
) -> Result<HuntExtractor, PartsError> {
    bearings.unwrap_or_default().wrap(extractor.build()?).map_err(PartsError::Bearings)
}

/// Why a hunt could not be put together.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PartsError {
    /// The estimator's law of propagation is out of range.
    #[error("the model: {0}")]
    Model(#[from] AntennaError),
    /// The extractor cannot be built.
    #[error("the extractor: {0}")]
    Extractor(#[from] ExtractorConfigError),
    /// The calibration of bearings is out of range.
    #[error("the bearings: {0}")]
    Bearings(#[source] ParameterError),
    /// The planner cannot be built.
    #[error("the planner: {0}")]
    Planner(#[from] PlannerConfigError),
    /// The hunt cannot be built.
    #[error(transparent)]
    Hunt(#[from] HuntError),
}
