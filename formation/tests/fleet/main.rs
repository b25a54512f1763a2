//! Real fleets: airspace, assignment, traffic and endurance.

mod airspace;
mod assignment;
mod endurance;
mod flown;
mod formation;
mod play;
mod traffic;
mod void;
mod world;
