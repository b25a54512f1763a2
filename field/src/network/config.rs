use foxhunt_core::parameter::{ParameterError, as_value, positive, require};
use serde::{Deserialize, Serialize};

/// Settings of a [`DroneNode`](super::DroneNode): how often messages to the one that fuses are sent
/// and repeated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DroneNodeConfig {
    /// Its pose and its status are sent this often, in seconds.
    pub report_every_s: f64,
    /// Interval at which a delivery is sent again until it is known to be logged, in seconds.
    pub repeat_every_s: f64,
    /// Time after which an order that a device did not follow is tried again, in seconds.
    pub retry_after_s: f64,
    /// A drone whose clock's offset is less certain than this, in seconds, takes no part; what it
    /// receives is refused.
    pub clock_uncertainty_s: f64,
    /// Maximum number of kept deliveries that are not known to be logged; the oldest are given up.
    pub most_kept: usize,
}

impl Default for DroneNodeConfig {
    /// Five reports a second, a delivery and an order again after a second, clocks within half a
    /// second, 1000 deliveries kept.
    fn default() -> Self {
        Self {
            report_every_s: 0.2,
            repeat_every_s: 1.0,
            retry_after_s: 1.0,
            clock_uncertainty_s: 0.5,
            most_kept: 1000,
        }
    }
}

impl DroneNodeConfig {
    /// Refuses settings that are out of their range.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the field.
    pub fn check(&self) -> Result<(), ParameterError> {
        positive("report_every_s", self.report_every_s)?;
        positive("repeat_every_s", self.repeat_every_s)?;
        positive("retry_after_s", self.retry_after_s)?;
        positive("clock_uncertainty_s", self.clock_uncertainty_s)?;
        require(self.most_kept > 0, "most_kept", as_value(self.most_kept), "at least 1")?;
        Ok(())
    }
}

/// Settings of a [`FusionNode`](super::FusionNode): how often messages to the drones are repeated,
/// and how their reports are judged.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FusionNodeConfig {
    /// Orders are sent again this often, in seconds.
    pub order_every_s: f64,
    /// The view of the hunt is sent this often, in seconds.
    pub show_every_s: f64,
    /// Tolerance of a corrected clock, in seconds: a reception from farther in the future is
    /// refused.
    pub clock_tolerance_s: f64,
    /// Time without a report after which a drone is silent, and not waited for at the end, in
    /// seconds.
    pub silent_after_s: f64,
    /// Time that a hunt that goes on from its log waits for its drones to show up, in seconds.
    pub assemble_s: f64,
    /// Number of places kept of each drone's path, for the view.
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
    /// Refuses settings that are out of their range.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the field.
    pub fn check(&self) -> Result<(), ParameterError> {
        positive("order_every_s", self.order_every_s)?;
        positive("show_every_s", self.show_every_s)?;
        positive("clock_tolerance_s", self.clock_tolerance_s)?;
        positive("silent_after_s", self.silent_after_s)?;
        positive("assemble_s", self.assemble_s)?;
        Ok(())
    }
}
