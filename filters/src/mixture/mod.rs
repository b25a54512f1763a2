//! Beliefs that are weighted sums of other estimators' beliefs.

mod bank;
mod component;
mod first_bearing;
mod gaussian_sum;
mod hypotheses;
mod imm;
mod merge;
mod moments;
mod polar;
mod range;
mod reinitialise;
mod split;
mod transition;

pub use bank::Bank;
pub use component::InnovationOf;
pub use first_bearing::FirstBearing;
pub use gaussian_sum::GaussianSum;
pub use imm::Imm;
pub use polar::polar_moments;
pub use range::RangeParameterised;
pub use reinitialise::Reinitialise;
pub use split::{split, split_standard_normal};
pub use transition::Transition;
