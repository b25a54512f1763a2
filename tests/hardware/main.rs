//! Drivers against emulated devices of a simulated world, in its own time.
#![cfg(feature = "hardware")]

mod gnss;
mod gnss_peer;
