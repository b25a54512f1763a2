//! Estimates from all observations of a still target at once.

mod belief;
mod curvature;
mod dependence;
mod error;
mod estimator;
mod expansion;
mod fix;
mod iteration;
mod loss;
mod modes;
mod problem;
mod region;
mod solver;

pub use dependence::independent_share;
pub use error::BatchError;
pub use estimator::BatchEstimator;
pub use fix::BatchFix;
pub use loss::Loss;
pub use solver::BatchSolver;

pub(crate) use error::{at_least, finite_entry, positive_entry};
