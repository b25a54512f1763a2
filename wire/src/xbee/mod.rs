//! The API frames of XBee radios (Digi, "XBee/XBee-PRO S2C 802.15.4" and "… Zigbee RF Module" user
//! guides, chapter "API operation").
//!
//! [`Frame`] is a frame's content, [`Frame::encode`] and [`Frame::decode`] are its bytes in either
//! [`ApiMode`], and [`Decoder`] finds frames in what comes over a serial line.

mod address;
mod command;
mod decoder;
mod error;
mod fields;
mod frame;
mod layout;
mod packet;
mod parse;
mod protocol;
mod status;

pub use address::{Address, Address16, Address64, AddressError};
pub use command::AtCommand;
pub use decoder::Decoder;
pub use error::FrameError;
pub use frame::Frame;
pub use layout::LONGEST_DATA;
pub use packet::ApiMode;
pub use protocol::Protocol;
pub use status::{AtStatus, DeliveryStatus, ModemStatus, TransmitStatus};
