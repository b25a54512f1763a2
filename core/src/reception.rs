use nalgebra::{Matrix2, SMatrix, SVector, Vector2, Vector3};

use crate::{BeaconId, Bearing, BearingModes, Observation, ObservationError, Pose, Reading, Sweep};

/// What one receiver learned from one sweep: the datum that is logged and replayed.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Reception {
    /// Whose signal it was.
    pub beacon: BeaconId,
    /// When, in seconds.
    pub time: f64,
    /// Where the receiver was.
    pub receiver: Pose,
    /// The received power in dBm.
    pub rss_dbm: f64,
    /// Its standard deviation in dB.
    pub rss_sigma_db: f64,
    /// The direction of arrival, if the sweep had one.
    pub bearing: Option<Bearing>,
    /// The covariance of level and bearing, in dB rad.
    pub covariance: f64,
    /// The directions that compete for the bearing, where there is more than one.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "BearingModes::is_empty"))]
    pub modes: BearingModes,
    /// How uncertain the receiver's own place is: σ of East, North and Up in metres; known where
    /// absent.
    #[cfg_attr(feature = "serde", serde(default, skip_serializing_if = "Option::is_none"))]
    pub receiver_sigma_m: Option<Vector3<f64>>,
}

impl Reception {
    /// What a sweep said according to an extractor's reading of it.
    #[must_use]
    pub fn new(sweep: &Sweep<'_>, reading: &Reading) -> Self {
        Self {
            beacon: sweep.beacon,
            time: sweep.time,
            receiver: sweep.receiver,
            rss_dbm: reading.rss_dbm,
            rss_sigma_db: reading.rss_sigma_db,
            bearing: reading.bearing.ok(),
            covariance: reading.covariance,
            modes: reading.modes,
            receiver_sigma_m: sweep.receiver_sigma_m,
        }
    }
}

impl Reception {
    /// Whether it tells of a direction: a bearing, or several that compete for one, which may be too
    /// far apart to have a common one.
    #[must_use]
    pub fn has_bearing(&self) -> bool {
        self.bearing.is_some() || !self.modes.is_empty()
    }

    /// The observation by a receiver that knows its place as well as this one.
    fn placed<const M: usize>(
        &self,
        observation: Observation<M>,
    ) -> Result<Observation<M>, ObservationError> {
        match self.receiver_sigma_m {
            Some(sigma) => observation.with_receiver_sigma(sigma),
            None => Ok(observation),
        }
    }
}

/// The stand-in for a bearing that is missing; an observation strikes it out again.
const NO_BEARING: Bearing = Bearing { angle: 0.0, sigma: 1.0, confidence: 0.0 };

/// The bearing alone.
impl TryFrom<&Reception> for Observation<1> {
    type Error = ObservationError;

    fn try_from(r: &Reception) -> Result<Self, ObservationError> {
        let bearing = r.bearing.unwrap_or(NO_BEARING);
        let variance = SMatrix::<f64, 1, 1>::new(bearing.sigma * bearing.sigma);
        let whole = Self::new(r.time, r.receiver, SVector::<f64, 1>::new(bearing.angle), variance)?;
        r.placed(if r.has_bearing() {
            whole.with_bearing_modes(0, r.modes)
        } else {
            whole.without(0)
        })
    }
}

/// Signal strength, then bearing.
impl TryFrom<&Reception> for Observation<2> {
    type Error = ObservationError;

    fn try_from(r: &Reception) -> Result<Self, ObservationError> {
        let bearing = r.bearing.unwrap_or(NO_BEARING);
        let coupling = if r.bearing.is_some() { r.covariance } else { 0.0 };
        let noise = Matrix2::new(
            r.rss_sigma_db * r.rss_sigma_db,
            coupling,
            coupling,
            bearing.sigma * bearing.sigma,
        );
        let whole = Self::new(r.time, r.receiver, Vector2::new(r.rss_dbm, bearing.angle), noise)?;
        r.placed(if r.has_bearing() {
            whole.with_bearing_modes(1, r.modes)
        } else {
            whole.without(1)
        })
    }
}
