//! The batch estimators against published figures, bounds, laws and statistics.

mod bearing_grid;
mod bearings;
mod field_map;
mod model;
mod ranges;
mod recursive;
mod solver;
mod stress;
mod track_grid;
