//! Planners that need an estimator of their own.

mod bayesian_optimisation;

pub use bayesian_optimisation::{BayesianOptimisation, BayesianOptimisationConfig};
