//! The estimators against exact vectors, the textbook, their laws and statistics.

mod consistency;
mod edges;
mod laws;
mod linear;
mod model;
mod posterior;
mod refusals;
mod runs;
mod sigma_points;
mod stress;
mod textbook;
mod vectors;
