use foxhunt_core::parameter::ParameterError;

use super::Scenario;
use crate::{
    calibration::{BearingCalibration, BearingSection, CalibrationFile, StationSection},
    config::BoxedExtractor,
};

impl CalibrationFile {
    /// An extractor with what is known of bearings: that of the station if it is one, whose levels
    /// have the σ of the calibrated path loss, else `extractor` with its bearings corrected.
    ///
    /// # Errors
    ///
    /// Names the number that is out of its range.
    pub fn extractor(
        &self,
        station: Option<&StationSection>,
        extractor: BoxedExtractor,
    ) -> Result<BoxedExtractor, ParameterError> {
        match (station, &self.bearings) {
            (Some(station), _) => {
                let pattern = station.build()?;
                let law = self.path_loss.as_ref().and_then(|law| law.sigma_db);
                Ok(Box::new(match law {
                    Some(sigma_db) => pattern.with_level_sigma_db(sigma_db)?,
                    None => pattern,
                }))
            }
            (None, Some(bearings)) => Ok(Box::new(bearings.predictive().wrap(extractor)?)),
            (None, None) => Ok(extractor),
        }
    }

    /// Returns the correction of bearings; without bearings in the file, it changes nothing.
    #[must_use]
    pub fn bearing_calibration(&self) -> BearingCalibration {
        self.bearings.as_ref().map_or_else(<_>::default, BearingSection::predictive)
    }

    /// Sets what is known of a scenario's hunt: the path loss of its model, the errors of its
    /// bearings. The true values in it stay.
    pub fn apply_to(&self, scenario: &mut Scenario) {
        if let Some(path_loss) = &self.path_loss {
            scenario.model.reference_dbm = path_loss.p0_dbm;
            scenario.model.exponent = path_loss.exponent;
        }
        if let Some(bearings) = &self.bearings {
            scenario.bearings = Some(bearings.predictive());
        }
    }
}
