//! Drivers against emulated devices of a simulated world, in its own time.
#![cfg(feature = "hardware")]

mod gnss;
mod gnss_peer;
mod mission;
mod network;
mod xbee;
mod xbee_protocol;
