use foxhunt_core::{Quantity, parameter::ParameterError};
use foxhunt_sensors::Calibrated;
use nalgebra::Vector3;

use super::{EstimatorEntry, Field, Registry, RegistryError, TrackRequest, entries::beacon_seed};
use crate::{
    calibration::BearingCalibration,
    config::{
        BoxedExtractor, ExtractorConfig, ExtractorConfigError, ModelConfig, ModelError,
        PlannerConfigError,
    },
    hunt::{Hunt, HuntConfig, HuntError, Parts, Search},
};

/// An extractor that was chosen at run time, with the calibration of its bearings.
pub type HuntExtractor = Calibrated<BoxedExtractor>;

/// Parts of a hunt, as they stand in files.
#[derive(Clone, Debug)]
pub struct HuntParts<'a> {
    /// Registry of the names in it.
    pub registry: &'a Registry,
    /// Extractor of a level and a bearing from a turn.
    pub extractor: &'a ExtractorConfig,
    /// Errors of the bearings; no correction where absent.
    pub bearings: Option<BearingCalibration>,
    /// The planner and what it needs to know.
    pub field: Field,
    /// Law of propagation that the estimators assume.
    pub model: &'a ModelConfig,
    /// The estimator.
    pub estimator: &'a EstimatorEntry,
    /// Time-outs, tolerances, the prior.
    pub hunt: &'a HuntConfig,
    /// The beacons' names, in their order.
    pub beacons: Vec<String>,
    /// Quantities that the drones' sources measure besides level and bearing.
    pub quantities: Vec<Quantity>,
    /// The seed of estimators that draw random numbers.
    pub seed: u64,
}

impl HuntParts<'_> {
    /// Puts them together.
    ///
    /// # Errors
    ///
    /// [`PartsError`] names the part that cannot be built.
    pub fn build(self) -> Result<Hunt, PartsError> {
        let estimator = self.estimator.clone();
        estimator.require_stream()?;
        let several = estimator.settings().is_some_and(|settings| settings.several.is_some());
        if several && self.extractor.directions_compete() {
            let estimator = estimator.name.into_owned();
            return Err(PartsError::DirectionsCompete { estimator });
        }
        let model = self.model.build()?;
        let pulses = self.model.build_pulses()?;
        let reference = self.model.reference_m.map(Vector3::from);
        let seed = self.seed;
        let tracks = move |search: &Search<'_>| {
            let seed = beacon_seed(seed, search.beacon);
            let search = *search;
            let pulses = pulses.as_ref();
            let request = TrackRequest { search, model: &model, reference, pulses, seed };
            estimator.track(&request, false)
        };
        let planner = self.registry.build_planner(&self.field.planner, &self.field)?;
        let extractor = self.registry.hunt_extractor(self.extractor, self.bearings)?;
        let parts = Parts::new(extractor, planner, tracks).with_quantities(&self.quantities);
        Ok(Hunt::new(parts, self.beacons, self.hunt.clone())?)
    }
}

impl Registry {
    /// Builds the extractor of a hunt alone: for a drone that makes receptions of its own sweeps.
    ///
    /// # Errors
    ///
    /// [`PartsError`] names what is out of range.
    pub fn hunt_extractor(
        &self,
        extractor: &ExtractorConfig,
        bearings: Option<BearingCalibration>,
    ) -> Result<HuntExtractor, PartsError> {
        let extractor = self.build_extractor(extractor)?;
        bearings.unwrap_or_default().wrap(extractor).map_err(PartsError::Bearings)
    }
}

/// Reason why a hunt could not be put together.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PartsError {
    /// The estimator's law of propagation is out of range, or its antenna or terrain is invalid.
    #[error("the model: {0}")]
    Model(#[from] ModelError),
    /// The extractor cannot be built.
    #[error("the extractor: {0}")]
    Extractor(#[from] ExtractorConfigError),
    /// The calibration of bearings is out of range.
    #[error("the bearings: {0}")]
    Bearings(#[source] ParameterError),
    /// The estimator looks for several transmitters, and the directions of a turn are those that
    /// compete for one.
    #[error(
        "{estimator} takes each direction of a turn for a transmitter, and this extractor has \
         several for one; take the extractor maximum-likelihood-several, or another one that has a \
         single direction"
    )]
    DirectionsCompete {
        /// The estimator's name.
        estimator: String,
    },
    /// The planner cannot be built.
    #[error("the planner: {0}")]
    Planner(#[from] PlannerConfigError),
    /// A name is not known, or cannot be honoured.
    #[error(transparent)]
    Name(#[from] RegistryError),
    /// The hunt cannot be built.
    #[error(transparent)]
    Hunt(#[from] HuntError),
}
