use foxhunt_core::parameter::ParameterError;

use super::{StationAntenna, StationPattern};

/// The pattern that stations of one make have in common, and how far single ones differ from it.
///
/// It stands for a station of which nothing but the recorded boresights is known: these are
/// wrong by N(0, κ²), and the gains of the antennas differ by N(0, τ²).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StationModel {
    /// The half-power beamwidth of each antenna, in radians.
    pub beamwidth: f64,
    /// Attenuation of each antenna from behind, in dB.
    pub front_to_back_db: f64,
    /// The scale of the residuals at a station that was not fitted, in dB.
    pub residual_db: f64,
    /// The receivers' floor in dBm and its width in dB, where it is known.
    pub floor: Option<[f64; 2]>,
    /// κ: standard deviation of the recorded boresights' errors, in radians.
    pub boresight_sigma: f64,
    /// τ: standard deviation of the antennas' gains, in dB.
    pub gain_sigma_db: f64,
}

impl StationModel {
    /// Returns the pattern of a station with antennas of these recorded boresights, in radians.
    ///
    /// # Errors
    ///
    /// Names the parameter that is out of its range.
    pub fn pattern(&self, recorded: &[f64]) -> Result<StationPattern, ParameterError> {
        let antenna = |boresight: &f64| StationAntenna {
            boresight_sigma: self.boresight_sigma,
            gain_sigma_db: self.gain_sigma_db,
            ..StationAntenna::as_recorded(*boresight)
        };
        let antennas = recorded.iter().map(antenna).collect();
        let pattern = StationPattern::new(antennas, self.beamwidth, self.front_to_back_db)?
            .with_residual_db(self.residual_db)?;
        match self.floor {
            Some([floor_dbm, width_db]) => pattern.with_floor(floor_dbm, width_db),
            None => Ok(pattern),
        }
    }
}
