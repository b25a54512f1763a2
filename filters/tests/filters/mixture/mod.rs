//! Mixtures of estimators against exact mixtures, grids, their laws and statistics.

mod bank;
mod consistency;
mod gaussian_sum;
mod imm;
mod laws;
mod model;
mod range;
