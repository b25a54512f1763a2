//! An antenna on a stepper motor under the drone.

mod config;
mod error;
mod source;
mod turn;

pub use config::StepperConfig;
pub use error::StepperError;
pub use source::StepperSource;

use turn::{Phase, Turn};
