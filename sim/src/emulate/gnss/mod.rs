//! A drone's GNSS receiver.

mod config;
mod epoch;
mod gpsd;
mod nmea;
mod receiver;
mod ublox;
mod wander;

pub use config::{EmulatedGnssConfig, EmulatedGnssKind};
pub use receiver::EmulatedGnss;
