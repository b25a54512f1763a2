//! Drivers against emulated devices of a simulated world, in its own time.
#![cfg(feature = "hardware")]

mod flown;
mod gnss;
mod gnss_peer;
mod mission;
mod network;
mod xbee;
mod xbee_protocol;
