//! Simulated hunts as files: what is true, what the hunt takes for known, and its parts.

mod builtin;
mod calibrated;
mod definition;
mod keys;
mod random_fleet;

pub use builtin::{DEFAULT_SCENARIO, builtin_scenarios, builtin_text};
pub use definition::{Scenario, ScenarioError, SimulationConfig, SourcesError};
pub use keys::{Key, KeyTable, scenario_keys};
pub use random_fleet::random_fleet;
