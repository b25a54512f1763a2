use nalgebra::Vector3;

use crate::{config::PlannerConfig, hunt::HuntConfig};

/// Conditions of a hunt that planners need for their settings.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// The planner that the scenario or the flight brings.
    pub planner: PlannerConfig,
    /// The path-loss exponent that the estimators take.
    pub exponent: f64,
    /// Speed of the drones, in metres per second, if known.
    pub speed_mps: Option<f64>,
    /// Speed of their climb, in metres per second, if known.
    pub climb_mps: Option<f64>,
    /// Duration of the slowest turn, in seconds, if known.
    pub turn_s: Option<f64>,
    /// Prior, airspace and distances.
    pub hunt: HuntConfig,
    /// Places where the drones begin: East, North and Up in metres.
    pub drones_m: Vec<Vector3<f64>>,
}
