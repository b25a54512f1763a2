use serde::{Deserialize, Serialize};

/// A beacon that is to be found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlownBeacon {
    /// Its name.
    pub name: String,
    /// Its XBee address: 16 hexadecimal digits, or 4.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub address: Option<String>,
    /// The frequency that a receiver is tuned to, in MHz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frequency_mhz: Option<f64>,
}
