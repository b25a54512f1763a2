use foxhunt_core::{Pose, Receptions};
use foxhunt_estimators::PulseLevelConfig;
use foxhunt_sensors::{
    AntennaConfig, ElevationPattern, ParameterError, SharedTerrain, TerrainLoss,
    WithElevationPattern,
};
use foxhunt_sim::{ReliefConfig, ReliefError};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Frequency for the loss over terrain where nothing else is known, in MHz.
pub const FREQUENCY_MHZ: f64 = 2440.0;

/// Settings for locating a transmitter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LocateConfig {
    /// Knowledge of the transmitter's power.
    pub power: Power,
    /// Assumed height of the transmitter above the ground of the local frame, in metres.
    pub target_up_m: f64,
    /// Knowledge of that height.
    #[serde(default)]
    pub height: Height,
    /// Gain of the antennas on the way over the elevation of the transmitter; where absent, the
    /// estimators take the antennas for isotropic, and `shadowing-grid` infers them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pattern: Option<ElevationPattern>,
    /// The receiver's directional antenna, for estimators that take the samples of its turns one by
    /// one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub antenna: Option<AntennaConfig>,
    /// Errors of single pulses, for estimators that take the samples one by one.
    #[serde(default)]
    pub pulses: PulseLevelConfig,
    /// The terrain whose loss comes off the levels, for estimators of levels one after the other;
    /// every Up is then a height above the ground below. Level ground where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub terrain: Option<ReliefConfig>,
    /// Distance beyond the area of the receivers in which a transmitter is looked for, in metres;
    /// the grids begin there, and go farther where they have to.
    pub margin_m: f64,
    /// Number of bearings that the knowledge of their σ is worth, for estimators that take it for
    /// known up to a factor.
    pub bearing_freedom: f64,
    /// Assumed σ in radians of bearings without one of their own; absent where every bearing has
    /// one, or where it was learned.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub assumed_bearing_sigma: Option<f64>,
    /// Seconds by which the clock of the measurements is behind that of the receiver's places: each
    /// was made where the receiver was that much later. Where absent, it is looked for by the
    /// levels and taken off where they show it well.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub clock_offset_s: Option<f64>,
    /// True if the receptions have times in seconds, false if they are only in order.
    #[serde(default = "yes")]
    pub is_timed: bool,
    /// Place of the reference receiver of range and level differences: East, North and Up in
    /// metres.
    pub reference_m: Option<Vector3<f64>>,
    /// The seed of estimators that draw random numbers.
    pub seed: u64,
}

fn yes() -> bool {
    true
}

/// Knowledge of a transmitter's height.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Height {
    /// The assumed one, [`LocateConfig::target_up_m`].
    #[default]
    Known,
    /// Estimated along with the place: 1, 6, 15, 35 or 70 m, none above the highest receiver but
    /// for the first two. Estimators that cannot do so refuse.
    Free,
    /// Estimated where the estimator can do so and a receiver is 10 m up or more: from there
    /// levels right above the transmitter depend on it. Else [`LocateConfig::target_up_m`].
    FreeInFlight,
}

/// Height of a receiver from which on it flies, in metres.
const FLIGHT_M: f64 = 10.0;

/// Knowledge of a transmitter's power.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Power {
    /// Nothing: the reference power is estimated along with the place. The exponent is, too, where
    /// the estimator can; else it is 2.3.
    Free,
    /// The exponent alone: the reference power is estimated along with the place.
    FreeReference {
        /// γ.
        exponent: f64,
    },
    /// P(d) = P₀ − 10 γ log₁₀ d.
    Known {
        /// P₀ in dBm.
        reference_dbm: f64,
        /// γ.
        exponent: f64,
    },
    /// The law that a calibration fitted, known as well as its points tell.
    Calibrated(CalibratedPower),
}

/// A log-distance law fitted to levels from known places, with its uncertainty.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibratedPower {
    /// P₀ in dBm.
    pub reference_dbm: f64,
    /// γ.
    pub exponent: f64,
    /// Covariance of P₀ and γ, in dB² and dB.
    pub covariance: [[f64; 2]; 2],
    /// σ of levels about the law, in dB.
    pub sigma_db: f64,
    /// Number of points that the law was fitted to.
    pub points: usize,
}

/// Law of the level at the centroid of a calibration, where its error is independent of γ's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Centroid {
    /// −10 log₁₀ of the distance in metres.
    pub loss: f64,
    /// Level there in dBm.
    pub level_dbm: f64,
    /// Variance of its error, in dB².
    pub variance: f64,
    /// γ with the prior that all estimators have of it.
    pub exponent: f64,
    /// σ of that.
    pub exponent_sigma: f64,
}

/// Exponent where it is not known: between free space and clutter, the median of the VHF recordings
/// that the project is tested on.
const FREE_EXPONENT: f64 = 2.3;

/// Prior of γ: mean and σ (Rappaport 2002, table 4.2).
const EXPONENT_PRIOR: (f64, f64) = (FREE_EXPONENT, 0.5);

/// Distance near a receiver, in metres.
const NEAR_M: f64 = 10.0;

/// σ of γ below which γ is known.
const KNOWN_EXPONENT: f64 = 0.01;

impl CalibratedPower {
    /// Returns the law at the centroid of the calibration.
    pub fn centroid(&self) -> Centroid {
        let [[level, shared], [_, slope]] = self.covariance;
        let sigma = slope.max(0.0).sqrt();
        if sigma < KNOWN_EXPONENT {
            let Self { reference_dbm: level_dbm, exponent, .. } = *self;
            let variance = level.max(0.0);
            return Centroid { loss: 0.0, level_dbm, variance, exponent, exponent_sigma: 0.0 };
        }
        let loss = -shared / slope;
        let (prior, prior_sigma) = EXPONENT_PRIOR;
        let weights = [1.0 / slope, 1.0 / (prior_sigma * prior_sigma)];
        let precision = weights[0] + weights[1];
        Centroid {
            loss,
            level_dbm: self.reference_dbm + self.exponent * loss,
            variance: (level - shared * shared / slope).max(0.0),
            exponent: (weights[0] * self.exponent + weights[1] * prior) / precision,
            exponent_sigma: precision.sqrt().recip(),
        }
    }
}

impl Centroid {
    /// Reference power of the law with an exponent, in dBm.
    pub(crate) fn reference_dbm(&self, exponent: f64) -> f64 {
        self.level_dbm - exponent * self.loss
    }

    /// Largest σ in dB of the levels that the law predicts near a receiver and over a side of the
    /// area; farther away a transmitter would rarely be heard.
    pub fn most_sigma_db(&self, side_m: f64) -> f64 {
        self.sigma_db(NEAR_M).max(self.sigma_db(side_m))
    }

    /// σ in dB of the level that the law predicts at a distance, without the levels' own.
    pub(crate) fn sigma_db(&self, range_m: f64) -> f64 {
        let apart = -10.0 * libm::log10(range_m.max(1.0)) - self.loss;
        libm::hypot(self.variance.sqrt(), apart * self.exponent_sigma)
    }
}

impl LocateConfig {
    /// Returns the settings with the height either known or free.
    pub fn decided(&self, can_estimate: bool, receptions: &Receptions) -> Self {
        let mut places = receptions.places();
        let height = match self.height {
            Height::FreeInFlight if can_estimate && places.any(|place| place.z >= FLIGHT_M) => {
                Height::Free
            }
            Height::FreeInFlight => Height::Known,
            decided => decided,
        };
        Self { height, ..self.clone() }
    }

    /// A model of level and bearing through the antennas on the way.
    pub fn through_antennas<H>(&self, model: H) -> Result<WithElevationPattern<H>, ParameterError> {
        match &self.pattern {
            Some(pattern) => WithElevationPattern::new(model, pattern.clone()),
            None => model.into(),
        }
        .with_target_up(self.target_up_m)
    }

    /// Builds the loss that the terrain takes off the levels; `None` without terrain.
    pub fn terrain_loss(&self) -> Result<Option<TerrainLoss<SharedTerrain>>, ReliefError> {
        self.terrain.as_ref().map(|terrain| terrain.build(FREQUENCY_MHZ)).transpose()
    }
}

impl Power {
    /// The exponent, for estimators that do not estimate it.
    pub fn exponent(self) -> f64 {
        match self {
            Self::Free => FREE_EXPONENT,
            Self::FreeReference { exponent } | Self::Known { exponent, .. } => exponent,
            Self::Calibrated(calibrated) => calibrated.centroid().exponent,
        }
    }

    /// Returns P₀ in dBm and γ where they are known, if only to within an error.
    pub fn law(self) -> Option<(f64, f64)> {
        match self {
            Self::Free | Self::FreeReference { .. } => None,
            Self::Known { reference_dbm, exponent } => Some((reference_dbm, exponent)),
            Self::Calibrated(calibrated) => {
                let centroid = calibrated.centroid();
                Some((centroid.reference_dbm(centroid.exponent), centroid.exponent))
            }
        }
    }

    /// Returns a calibrated law at its centroid; `None` where nothing was calibrated.
    pub fn centroid(self) -> Option<Centroid> {
        match self {
            Self::Calibrated(calibrated) => Some(calibrated.centroid()),
            Self::Free | Self::FreeReference { .. } | Self::Known { .. } => None,
        }
    }
}

impl Default for LocateConfig {
    /// Free power, a transmitter on level ground, unknown antennas, pulses as in
    /// [`PulseLevelConfig::default`], 200 m beyond the area of the receivers, two degrees of
    /// freedom for the bearings' σ, every one with its own, seed 1.
    fn default() -> Self {
        Self {
            power: Power::Free,
            target_up_m: 0.0,
            height: Height::Known,
            pattern: None,
            antenna: None,
            pulses: PulseLevelConfig::default(),
            terrain: None,
            margin_m: 200.0,
            bearing_freedom: 2.0,
            assumed_bearing_sigma: None,
            clock_offset_s: None,
            is_timed: true,
            reference_m: None,
            seed: 1,
        }
    }
}

/// A receiver that listens in one place for some time: what it does not receive counts too.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Listener {
    /// Pose of the receiver.
    pub receiver: Pose,
    /// The times between which it listens, in seconds.
    pub from: f64,
    /// See [`from`](Self::from).
    pub until: f64,
    /// The level below which it receives nothing, in dBm.
    pub floor_dbm: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    /// Levels of a law at a range have the variance of the covariance's quadratic form, and the
    /// prior of γ makes them no less certain than the calibration alone.
    #[test]
    fn the_centroid_has_the_law_of_the_calibration() {
        let calibrated = CalibratedPower {
            reference_dbm: -30.0,
            exponent: 2.3,
            covariance: [[25.0, 1.2], [1.2, 0.06]],
            sigma_db: 6.0,
            points: 20,
        };
        let centroid = calibrated.centroid();
        assert_abs_diff_eq!(centroid.loss, -20.0, epsilon = 1e-12);
        assert_abs_diff_eq!(centroid.reference_dbm(2.3), -30.0, epsilon = 1e-12);
        assert_abs_diff_eq!(centroid.variance, 1.0, epsilon = 1e-12);
        // 1/0.06 + 1/0.25.
        let sigma = (1.0_f64 / (1.0 / 0.06 + 4.0)).sqrt();
        assert_abs_diff_eq!(centroid.exponent_sigma, sigma, epsilon = 1e-12);
        assert_abs_diff_eq!(centroid.exponent, 2.3, epsilon = 1e-12);
        let at = |range: f64| centroid.sigma_db(range).powi(2);
        assert_abs_diff_eq!(at(100.0), 1.0, epsilon = 1e-12);
        assert_abs_diff_eq!(at(1e4) - 1.0, 400.0 * sigma * sigma, epsilon = 1e-9);
        let steep = CalibratedPower { exponent: 0.8, ..calibrated }.centroid();
        assert!(steep.exponent > 0.8 && steep.exponent < 1.2, "{steep:?}");
        let bound = CalibratedPower { covariance: [[4.0, 0.0], [0.0, 0.0]], ..calibrated };
        let Centroid { exponent, exponent_sigma, variance, .. } = bound.centroid();
        assert!(exponent.to_bits() == 2.3_f64.to_bits() && exponent_sigma <= 0.0, "{exponent}");
        assert_abs_diff_eq!(variance, 4.0, epsilon = 1e-12);
    }
}
