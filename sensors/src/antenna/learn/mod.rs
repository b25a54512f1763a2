//! An antenna's pattern out of recorded turns.

mod error;
mod fit;
mod series;

pub use error::LearnPatternError;
pub use fit::{LearnedPattern, learn_pattern};
