use foxhunt_core::Pose;
use foxhunt_sensors::{
    AntennaConfig, ElevationPattern, ParameterError, SharedTerrain, TerrainLoss,
    WithElevationPattern,
};
use foxhunt_sim::{ReliefConfig, ReliefError};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::area::FREE_EXPONENT;
use crate::config::{FREQUENCY_MHZ, PulseLevelConfig};

/// Settings for locating a transmitter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LocateConfig {
    /// Knowledge of the transmitter's power.
    pub power: Power,
    /// Assumed height of the transmitter above the ground of the local frame, in metres.
    pub target_up_m: f64,
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
    /// Place of the reference receiver of range and level differences: East, North and Up in
    /// metres.
    pub reference_m: Option<Vector3<f64>>,
    /// The seed of estimators that draw random numbers.
    pub seed: u64,
}

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
}

impl LocateConfig {
    /// A model of level and bearing through the antennas on the way.
    pub(crate) fn through_antennas<H>(
        &self,
        model: H,
    ) -> Result<WithElevationPattern<H>, ParameterError> {
        match &self.pattern {
            Some(pattern) => WithElevationPattern::new(model, pattern.clone()),
            None => model.into(),
        }
        .with_target_up(self.target_up_m)
    }

    /// Builds the loss that the terrain takes off the levels; `None` without terrain.
    pub(crate) fn terrain_loss(&self) -> Result<Option<TerrainLoss<SharedTerrain>>, ReliefError> {
        self.terrain.as_ref().map(|terrain| terrain.build(FREQUENCY_MHZ)).transpose()
    }
}

impl Power {
    /// The exponent, for estimators that do not estimate it.
    pub(crate) fn exponent(self) -> f64 {
        match self {
            Self::Free => FREE_EXPONENT,
            Self::FreeReference { exponent } | Self::Known { exponent, .. } => exponent,
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
            pattern: None,
            antenna: None,
            pulses: PulseLevelConfig::default(),
            terrain: None,
            margin_m: 200.0,
            bearing_freedom: 2.0,
            assumed_bearing_sigma: None,
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
