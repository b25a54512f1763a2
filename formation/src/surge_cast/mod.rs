mod heard;
mod planner;
#[cfg(test)]
mod tests;

use heard::Heard;
pub use planner::{SurgeCast, SurgeCastConfig};
