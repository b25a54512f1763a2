//! Real fleets: airspace, assignment, traffic and endurance.

mod airspace;
mod assignment;
mod edge;
mod endurance;
mod flown;
mod formation;
mod given_up;
mod logged;
mod play;
mod traffic;
mod void;
mod world;
