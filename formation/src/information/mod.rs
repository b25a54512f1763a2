//! Where the next turns tell most.

mod cells;
mod config;
mod planner;
mod power;
mod rollout;
mod search;
mod shapes;
mod steepest_descent;
mod turn;
mod worth;

pub use config::{Criterion, InformationConfig, Objective};
pub use planner::Information;
pub use steepest_descent::{SteepestDescent, SteepestDescentConfig};
pub use turn::{ExpectedReading, RssBearingTurn, TurnFisher, TurnInformation};
