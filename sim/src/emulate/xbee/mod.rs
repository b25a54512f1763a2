//! An XBee on a stream, whose RSSI comes from a world.

mod air;
mod config;
mod device;
mod registers;
mod text;

pub use config::{EmulatedXbeeConfig, xbee_address};
pub use device::EmulatedXbee;
