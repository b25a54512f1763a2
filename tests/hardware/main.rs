//! Drivers against emulated devices of a simulated world, in its own time.
#![cfg(feature = "hardware")]

mod mission;
mod xbee;
mod xbee_protocol;
mod network;
