//! Drivers against emulated devices of a simulated world, in its own time.
#![cfg(feature = "hardware")]

mod ardrone;
mod mavlink;
mod mission;
mod xbee;
mod xbee_protocol;
mod network;
mod peers;
