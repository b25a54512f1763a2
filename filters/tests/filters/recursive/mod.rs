//! The estimators against exact vectors, the textbook, their laws and statistics.

mod consistency;
mod cramer_rao;
mod edges;
mod grid;
mod iterated;
mod laws;
mod linear;
mod model;
mod monitoring;
mod nonlinear;
mod out_of_order;
mod particles;
mod posterior;
mod rao_blackwellised;
mod refusals;
mod runs;
mod sigma_points;
mod silence;
mod stress;
mod textbook;
mod threads;
mod vectors;
