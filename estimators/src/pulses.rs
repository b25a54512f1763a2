use foxhunt_core::{
    Pose, Sample,
    parameter::{ParameterError, in_range, positive},
};
use foxhunt_filters::DirectionalGridConfig;
use foxhunt_sensors::{DirectionalLevel, LogDistance, SharedAntenna, SharedTerrain, TerrainLoss};
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

/// Properties of a tag's pulses that the estimator `pulses` takes for known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PulseLevelConfig {
    /// σ of a pulse about the level that the antenna's pattern has at its boresight, in dB.
    pub sigma_db: f64,
    /// σ in dB of the error that all pulses at one site have in common.
    pub site_sigma_db: f64,
    /// σ in degrees by which a site turns the antenna's pattern.
    pub site_sigma_deg: f64,
    /// σ in dB of the tag's power about the model's `reference_dbm`.
    pub power_sigma_db: f64,
    /// The probability that a pulse above the receiver's floor is missed all the same.
    pub lost_probability: f64,
    /// The share of pulses that are not the tag's.
    pub false_share: f64,
}

impl Default for PulseLevelConfig {
    /// 2 dB a pulse and 6° a site; the rest as in the default of [`DirectionalGridConfig`].
    fn default() -> Self {
        let grid = DirectionalGridConfig::default();
        Self {
            sigma_db: Sample::SIGMA_DB,
            site_sigma_db: grid.site_sigma_db,
            site_sigma_deg: 6.0,
            power_sigma_db: grid.power_sigma_db,
            lost_probability: grid.lost_probability,
            false_share: grid.false_share,
        }
    }
}

/// The level of a pulse through an antenna whose pattern is known, and how it errs.
#[derive(Clone, Debug)]
pub struct PulseModel {
    level: DirectionalLevel<LogDistance, SharedAntenna>,
    terrain: Option<TerrainLoss<SharedTerrain>>,
    target_up: f64,
    config: PulseLevelConfig,
}

impl PulseModel {
    /// The model of a target `target_up` metres above the ground.
    ///
    /// # Errors
    ///
    /// If the height is not finite, or a σ of the configuration out of range.
    pub fn new(
        law: LogDistance,
        antenna: SharedAntenna,
        target_up: f64,
        config: PulseLevelConfig,
    ) -> Result<Self, ParameterError> {
        positive("pulses.sigma_db", config.sigma_db)?;
        let name = "pulses.site_sigma_deg";
        let deg = config.site_sigma_deg;
        in_range(name, deg, 0.0..=90.0, "from 0 to 90")?;
        let level = DirectionalLevel::new(law, antenna).with_target_up(target_up)?;
        Ok(Self { level, terrain: None, target_up, config })
    }

    /// Sets the terrain whose loss comes off.
    pub fn over_terrain(self, loss: TerrainLoss<SharedTerrain>) -> Self {
        Self { terrain: Some(loss), ..self }
    }

    /// σ of a pulse, in dB.
    pub fn sigma_db(&self) -> f64 {
        self.config.sigma_db
    }

    /// Returns its settings for a grid.
    pub fn grid_config(&self) -> DirectionalGridConfig {
        let PulseLevelConfig { site_sigma_db, site_sigma_deg, power_sigma_db, .. } = self.config;
        DirectionalGridConfig {
            power_sigma_db,
            site_sigma_db,
            site_sigma: site_sigma_deg.to_radians(),
            lost_probability: self.config.lost_probability,
            false_share: self.config.false_share,
            ..DirectionalGridConfig::default()
        }
    }

    /// The levels in dBm at a place, for some turns of the pattern in radians.
    pub fn levels_dbm(
        &self,
        place: &Vector2<f64>,
        receiver: &Pose,
        boresight: f64,
        turns: &[f64],
        levels: &mut [f64],
    ) {
        self.level.levels_dbm(place, receiver, boresight, turns, levels);
        if let Some(terrain) = &self.terrain {
            let loss = terrain.loss_db(&receiver.position, &place.push(self.target_up));
            levels.iter_mut().for_each(|level| *level -= loss);
        }
    }
}
