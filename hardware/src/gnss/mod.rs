//! GNSS receivers: where a vehicle is, and how uncertain that is. A [`GnssDecoder`] makes fixes of
//! bytes, a [`GnssReceiver`] ages them, [`Placed`] and [`StillVehicle`] put them under a pose.

mod config;
mod decoder;
mod error;
mod examine;
mod fix;
mod gpsd;
mod line;
mod nmea;
mod placed;
mod position;
mod receiver;
mod still;
#[cfg(test)]
mod tests;
mod ublox;

pub use config::{GnssConfig, GnssFloors, GnssKind};
pub use decoder::GnssDecoder;
pub use error::GnssError;
pub use fix::GnssFix;
pub use gpsd::GpsdDecoder;
pub use nmea::NmeaDecoder;
pub use placed::{Placed, PlacedError};
pub use position::{GnssPosition, Positioning};
pub use receiver::GnssReceiver;
pub use still::StillVehicle;
pub use ublox::UbloxDecoder;
