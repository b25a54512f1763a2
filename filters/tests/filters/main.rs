//! The estimators against exact vectors, the textbook, published figures, bounds, their laws and
//! statistics: one binary, which takes less time to build than one for each folder.

mod batch;
mod directional_grid;
mod joint;
mod mixture;
mod moment_grid;
mod multi;
mod recorded_flights;
mod recursive;
mod shadowing_grid;
