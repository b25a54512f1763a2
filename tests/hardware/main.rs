//! Drivers against emulated devices of a simulated world, in its own time.
#![cfg(feature = "hardware")]

mod receivers;
mod xbee;
mod xbee_protocol;
