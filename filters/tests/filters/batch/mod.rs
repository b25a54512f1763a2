//! The batch estimators against published figures, bounds, laws and statistics.

mod bearing_grid;
mod field_map;
mod lenth1981;
mod linear_bearings;
mod model;
mod ranges;
mod recorded;
mod recursive;
mod refusals;
mod silence;
mod solver;
mod stress;
mod track_grid;
