//! Campaigns, simulated hunts and what they are made of: one binary, a module for each subject.

mod avalanche;
mod next_event;
mod pulsed_hunts;
mod receptions_over_hills;
mod store;
mod terrain;
