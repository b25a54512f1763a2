//! Drivers against emulated devices of a simulated world, in its own time.
#![cfg(feature = "hardware")]
mod network;
mod nodes;
