//! Planners that listen where the next turns are expected to teach most.

mod cells;
mod columns;
mod config;
mod planner;
mod power;
mod rollout;
mod search;
mod shapes;
mod steepest_descent;
mod travel;
mod turn;
mod worth;

pub use config::{Criterion, InformationConfig, Objective};
pub use planner::Information;
pub use steepest_descent::{SteepestDescent, SteepestDescentConfig};
pub use turn::{
    ExpectedReading, ExpectedReadings, RssBearingTurn, TARGETS, TurnFisher, TurnFishers,
    TurnInformation,
};
