use foxhunt_sensors::{
    AntennaConfig, AntennaError, ElevationPattern, LogDistance, RssBearing, WithElevationPattern,
};
use serde::{Deserialize, Serialize};

use super::{PulseLevelConfig, PulseModel};

/// What an estimator takes for the law of propagation, P(d) = P₀ − 10 γ log₁₀ d, and for the
/// antenna's vertical pattern.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelConfig {
    /// P₀: the mean power over a level turn at one metre, in dBm.
    pub reference_dbm: f64,
    /// γ: the path-loss exponent.
    pub exponent: f64,
    /// How high above the ground the beacons are taken to be, in metres; 0 unless given.
    #[serde(default)]
    pub target_up_m: f64,
    /// The antenna whose vertical pattern the level follows; where absent, the level is taken for
    /// the same at every elevation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub antenna: Option<AntennaConfig>,
    /// Where the reference receiver of range and level differences is: East, North and Up in
    /// metres; only estimators of differences need it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference_m: Option<[f64; 3]>,
    /// How single pulses err, for the estimator `pulses`; as in [`PulseLevelConfig::default`] unless
    /// given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pulses: Option<PulseLevelConfig>,
}

/// A model of signal strength and bearing, as hunts have it.
pub type ReceiverModel = WithElevationPattern<RssBearing<LogDistance>>;

impl ModelConfig {
    /// Builds the model of signal strength and bearing.
    ///
    /// # Errors
    ///
    /// [`AntennaError`] names the field that is out of its range, or the antenna's file.
    pub fn build(&self) -> Result<ReceiverModel, AntennaError> {
        let model = RssBearing::new(LogDistance::new(self.reference_dbm, self.exponent)?)
            .with_target_up(self.target_up_m)?;
        let Some(antenna) = &self.antenna else { return Ok(model.into()) };
        let pattern = ElevationPattern::of(&antenna.build()?);
        Ok(WithElevationPattern::new(model, pattern).with_target_up(self.target_up_m)?)
    }

    /// Builds the model of single pulses, where the antenna is known.
    ///
    /// # Errors
    ///
    /// [`AntennaError`] names the field that is out of its range, or the antenna's file.
    pub fn build_pulses(&self) -> Result<Option<PulseModel>, AntennaError> {
        let Some(antenna) = &self.antenna else { return Ok(None) };
        let law = LogDistance::new(self.reference_dbm, self.exponent)?;
        let config = self.pulses.unwrap_or_default();
        Ok(Some(PulseModel::new(law, antenna.build()?, self.target_up_m, config)?))
    }
}

#[cfg(test)]
mod tests {
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
            assert!((difference - gain).abs() < 1e-6, "{difference}, not {gain} dB");
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
