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
mod out_of_order;
mod particles;
mod predictive;
mod rao_blackwellised;
mod sigma_points;
mod smoothing;
mod textbook;
