use foxhunt_sensors::{LogDistance, ParameterError, RssBearing};
use serde::{Deserialize, Serialize};

/// What an estimator takes for the law of propagation: P(d) = P₀ − 10 γ log₁₀ d.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelConfig {
    /// P₀: the mean power over a turn at one metre, in dBm.
    pub reference_dbm: f64,
    /// γ: the path-loss exponent.
    pub exponent: f64,
    /// How high above the ground the beacons are taken to be, in metres; 0 unless given.
    #[serde(default)]
    pub target_up_m: f64,
}

impl ModelConfig {
    /// Builds the model of signal strength and bearing.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the field that is out of its range.
    pub fn build(&self) -> Result<RssBearing<LogDistance>, ParameterError> {
        RssBearing::new(LogDistance::new(self.reference_dbm, self.exponent)?)
            .with_target_up(self.target_up_m)
    }
}
