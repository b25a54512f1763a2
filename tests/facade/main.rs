//! The library through its facade, as its users meet it: one binary, a module for each subject.

mod bearing_trial;
mod campaign;
mod competing_bearings;
mod custom_backends;
mod files;
mod fleets;
mod flights;
mod golden;
mod hunt;
mod planners;
mod refusals;
mod settings;
mod sources;
mod support;
mod trial;
mod unknown_power;
