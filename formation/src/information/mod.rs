//! Where the next turns tell most.

mod cells;
mod config;
mod planner;
mod power;
mod rollout;
mod search;
mod shapes;
mod turn;
mod worth;

pub use config::{Criterion, InformationConfig, InformationConfigError, Objective};
pub use planner::Information;
pub use turn::{ExpectedReading, RssBearingTurn, TurnFisher, TurnInformation};
