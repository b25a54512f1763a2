//! Mixtures of estimators against exact mixtures, grids, their laws and statistics.

mod bank;
mod gaussian_sum;
mod imm;
mod laws;
mod model;
