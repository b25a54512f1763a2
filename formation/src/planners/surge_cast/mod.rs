mod planner;
mod receptions;
#[cfg(test)]
mod tests;

pub use planner::{SurgeCast, SurgeCastConfig};
use receptions::Receptions;
