use serde::{Deserialize, Serialize};

use super::NetworkError;

/// How a drone's computer talks to the one that fuses.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DroneNodeConfig {
    /// Where it is and how it is are told this often, in seconds.
    pub report_every_s: f64,
    /// What was heard is told again after so many seconds, until it is known to be taken in.
    pub repeat_every_s: f64,
    /// What a device did not take is tried again after so many seconds.
    pub retry_after_s: f64,
    /// So many deliveries are kept while nobody takes them in; the oldest are given up.
    pub most_kept: usize,
}

impl Default for DroneNodeConfig {
    /// Five reports a second, a delivery and an order again after a second, 1000 deliveries kept.
    fn default() -> Self {
        Self { report_every_s: 0.2, repeat_every_s: 1.0, retry_after_s: 1.0, most_kept: 1000 }
    }
}

impl DroneNodeConfig {
    pub(super) fn check(&self) -> Result<(), NetworkError> {
        positive("report_every_s", self.report_every_s)?;
        positive("repeat_every_s", self.repeat_every_s)?;
        positive("retry_after_s", self.retry_after_s)?;
        positive("most_kept", if self.most_kept > 0 { 1.0 } else { 0.0 })
    }
}

/// How the computer that fuses talks to the drones' and judges what they say.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FusionNodeConfig {
    /// Orders are said again this often, in seconds.
    pub order_every_s: f64,
    /// What is believed is shown this often, in seconds.
    pub show_every_s: f64,
    /// How far the clocks of two computers may be apart, in seconds: a reception from farther in the
    /// future is refused.
    pub clock_tolerance_s: f64,
    /// A drone that was not heard for so many seconds is not waited for at the end.
    pub silent_after_s: f64,
    /// A hunt that goes on from its log waits so long for its drones to show up, in seconds.
    pub assemble_s: f64,
    /// So many places are kept of each drone's path, to be shown.
    pub path_places: usize,
}

impl Default for FusionNodeConfig {
    /// Five orders a second, a view each second, clocks within a second, drones that are silent for
    /// 10 s not waited for, 30 s to assemble, 1000 places of each path.
    fn default() -> Self {
        Self {
            order_every_s: 0.2,
            show_every_s: 1.0,
            clock_tolerance_s: 1.0,
            silent_after_s: 10.0,
            assemble_s: 30.0,
            path_places: 1000,
        }
    }
}

impl FusionNodeConfig {
    pub(super) fn check(&self) -> Result<(), NetworkError> {
        positive("order_every_s", self.order_every_s)?;
        positive("show_every_s", self.show_every_s)?;
        positive("clock_tolerance_s", self.clock_tolerance_s)?;
        positive("silent_after_s", self.silent_after_s)?;
        positive("assemble_s", self.assemble_s)
    }
}

fn positive(field: &'static str, value: f64) -> Result<(), NetworkError> {
    if value > 0.0 && value.is_finite() {
        return Ok(());
    }
    Err(NetworkError::Config { field, value })
}
