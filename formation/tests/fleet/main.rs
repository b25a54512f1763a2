//! Real fleets: airspace, assignment, traffic and endurance.

mod airspace;
mod assignment;
mod endurance;
mod formation;
mod play;
mod traffic;
mod world;
