use std::path::Path;

use foxhunt_core::parameter::{FieldError, ParameterError};
use foxhunt_sensors::{
    AntennaConfig, AntennaError, ElevationPattern, LogDistance, OverTerrain, RssBearing,
    SharedTerrain, TerrainLoss, WithElevationPattern,
};
use foxhunt_sim::{ReliefConfig, ReliefError};
use serde::{Deserialize, Serialize};

use super::{FREQUENCY_MHZ, ModelTerrain, PulseLevelConfig, PulseModel, ReceiverModel};

/// Law of propagation that an estimator assumes, P(d) = P₀ − 10 γ log₁₀ d, with the antenna's
/// vertical pattern and the terrain.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelConfig {
    /// P₀: the mean power over a level turn at one metre, in dBm.
    pub reference_dbm: f64,
    /// γ: the path-loss exponent.
    pub exponent: f64,
    /// Assumed height of the beacons above the ground, in metres; 0 unless given.
    #[serde(default)]
    pub target_up_m: f64,
    /// The antenna whose vertical pattern the level follows; where absent, the level is taken for
    /// the same at every elevation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub antenna: Option<AntennaConfig>,
    /// Place of the reference receiver of range and level differences: East, North and Up in
    /// metres; only estimators of differences need it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference_m: Option<[f64; 3]>,
    /// Errors of single pulses, for the estimator `pulses`; as in [`PulseLevelConfig::default`]
    /// unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pulses: Option<PulseLevelConfig>,
    /// The terrain whose loss comes off the level; level ground where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub terrain: Option<ModelTerrain>,
}

/// Reason why there is no such model.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// A field is out of its range, or the antenna's file.
    #[error(transparent)]
    Antenna(#[from] AntennaError),
    /// There is no such terrain.
    #[error("terrain: {0}")]
    Terrain(#[from] ReliefError),
    /// The model takes the terrain of a world or a flight without terrain.
    #[error(transparent)]
    NoTerrain(FieldError),
}

impl From<ParameterError> for ModelError {
    fn from(error: ParameterError) -> Self {
        Self::Antenna(error.into())
    }
}

impl ModelConfig {
    /// Builds the model of signal strength and bearing.
    ///
    /// # Errors
    ///
    /// [`ModelError`] names the field that is out of its range, the antenna's file, or the tile.
    pub fn build(&self) -> Result<ReceiverModel, ModelError> {
        let model = RssBearing::new(LogDistance::new(self.reference_dbm, self.exponent)?)
            .with_target_up(self.target_up_m)?;
        let model = match &self.antenna {
            Some(antenna) => {
                let pattern = ElevationPattern::of(&antenna.build()?);
                WithElevationPattern::new(model, pattern).with_target_up(self.target_up_m)?
            }
            None => model.into(),
        };
        let Some(loss) = self.terrain_loss()? else { return Ok(model.into()) };
        Ok(OverTerrain::new(model, loss).with_target_up(self.target_up_m)?)
    }

    /// Returns the loss over its terrain, if it has one.
    fn terrain_loss(&self) -> Result<Option<TerrainLoss<SharedTerrain>>, ModelError> {
        match &self.terrain {
            None => Ok(None),
            Some(ModelTerrain::Own(terrain)) => Ok(Some(terrain.build(FREQUENCY_MHZ)?)),
            Some(ModelTerrain::AsThere) => Err(ModelError::NoTerrain(no_terrain())),
        }
    }

    /// Builds the model of single pulses, where the antenna is known.
    ///
    /// # Errors
    ///
    /// [`ModelError`] names the field that is out of its range, the antenna's file, or the tile.
    pub fn build_pulses(&self) -> Result<Option<PulseModel>, ModelError> {
        let Some(antenna) = &self.antenna else { return Ok(None) };
        let law = LogDistance::new(self.reference_dbm, self.exponent)?;
        let config = self.pulses.unwrap_or_default();
        let model = PulseModel::new(law, antenna.build()?, self.target_up_m, config)?;
        Ok(Some(match self.terrain_loss()? {
            Some(loss) => model.over_terrain(loss),
            None => model,
        }))
    }

    /// Puts the terrain that there is, if there is one, in the place of `terrain = true`.
    ///
    /// # Errors
    ///
    /// [`FieldError`] if `there` gives no terrain.
    pub fn resolve_terrain(
        &mut self,
        there: impl FnOnce() -> Option<ReliefConfig>,
    ) -> Result<(), FieldError> {
        if self.terrain == Some(ModelTerrain::AsThere) {
            self.terrain = Some(ModelTerrain::Own(there().ok_or_else(no_terrain)?));
        }
        Ok(())
    }

    /// Makes a folder of tiles relative to `base`, such as the folder of the file that names it.
    #[must_use]
    pub fn in_folder(self, base: &Path) -> Self {
        let terrain = self.terrain.map(|terrain| match terrain {
            ModelTerrain::Own(terrain) => ModelTerrain::Own(terrain.in_folder(base)),
            ModelTerrain::AsThere => ModelTerrain::AsThere,
        });
        Self { terrain, ..self }
    }
}

fn no_terrain() -> FieldError {
    FieldError::new("terrain", true, "a table, or left out, where nothing else has a terrain")
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use foxhunt_core::{MeasurementModel, Pose};
    use foxhunt_sensors::{Antenna, Dipole};
    use nalgebra::Vector2;

    use super::*;

    fn read(text: &str) -> Result<ModelConfig, toml::de::Error> {
        toml::from_str(&format!("reference_dbm = -30.0\nexponent = 2.0\n{text}"))
    }

    #[test]
    fn the_antenna_of_a_file_bends_the_level() {
        let level = |text: &str, drone: &Pose| {
            let model = read(text).expect("in order").build().expect("in range");
            let expected: Vector2<f64> = model.expected(&Vector2::new(50.0, 0.0), drone);
            expected[0]
        };
        for (drone, elevation) in [
            (Pose::at(0.0, 0.0, 2.0), 0.0),
            (Pose::at(0.0, 0.0, 52.0), std::f64::consts::FRAC_PI_4),
        ] {
            let up = "target_up_m = 2.0\n";
            let dipole = format!("{up}antenna = \"dipole\"");
            let gain = Dipole.gain_dbi(0.0, elevation) - Dipole.gain_dbi(0.0, 0.0);
            let difference = level(&dipole, &drone) - level(up, &drone);
            assert_abs_diff_eq!(difference, gain, epsilon = 1e-6);
        }
    }

    #[test]
    fn an_antenna_that_is_none_is_refused() {
        assert!(read("antenna = \"horn\"").is_err());
        let broken = read("antenna = { yagi = { elements = 1 } }").expect("a number");
        let error = broken.build().expect_err("no array").to_string();
        assert!(error.contains("elements is 1"), "{error}");
        let written = toml::to_string(&broken).expect("plain fields");
        assert_eq!(toml::from_str::<ModelConfig>(&written).expect("as written"), broken);
    }
}
