use nalgebra::Vector3;

use crate::{config::PlannerConfig, hunt::HuntConfig};

/// Where and with what a hunt flies, as far as planners need it for their settings.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// The planner that the scenario or the flight brings.
    pub planner: PlannerConfig,
    /// The path-loss exponent that the estimators take.
    pub exponent: f64,
    /// How fast the drones fly, in metres per second, where that is known.
    pub speed_mps: Option<f64>,
    /// How fast they climb, in metres per second, where that is known.
    pub climb_mps: Option<f64>,
    /// How long the slowest turn takes, in seconds, where that is known.
    pub turn_s: Option<f64>,
    /// Prior, airspace and distances.
    pub hunt: HuntConfig,
    /// Where the drones begin: East, North and Up in metres.
    pub drones_m: Vec<Vector3<f64>>,
}
