use nalgebra::Vector3;

/// How a transmitter is located.
#[derive(Clone, Debug, PartialEq)]
pub struct LocateConfig {
    /// What is known of the transmitter's power.
    pub power: Power,
    /// How high above the ground of the local frame the transmitter is taken to be, in metres.
    pub target_up_m: f64,
    /// How far the transmitter may lie beyond the area of the receivers, in metres.
    pub margin_m: f64,
    /// Where the reference receiver of range and level differences is: East, North and Up in
    /// metres.
    pub reference_m: Option<Vector3<f64>>,
    /// The seed of estimators that draw random numbers.
    pub seed: u64,
}

/// What is known of a transmitter's power.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Power {
    /// Nothing: the reference power is estimated along with the place. The exponent is, too, where
    /// the estimator can; else it is 2.3.
    Free,
    /// P(d) = P₀ − 10 γ log₁₀ d.
    Known {
        /// P₀ in dBm.
        reference_dbm: f64,
        /// γ.
        exponent: f64,
    },
}

impl Default for LocateConfig {
    /// Free power, a transmitter on the ground, 200 m beyond the area of the receivers, seed 1.
    fn default() -> Self {
        Self { power: Power::Free, target_up_m: 0.0, margin_m: 200.0, reference_m: None, seed: 1 }
    }
}
