//! The batch estimators against published figures, bounds, laws and statistics.

mod lenth1981;
mod linear_bearings;
mod model;
mod recursive;
mod refusals;
mod solver;
