//! The API frames of XBee radios (Digi, "XBee/XBee-PRO S2C 802.15.4" and "… Zigbee RF Module" user
//! guides, chapter "API operation").
//!
//! [`Frame`] is a frame's content, [`Frame::encode`] and [`Frame::decode`] are its bytes in either
//! [`ApiMode`], and [`Decoder`] finds frames in what comes over a serial line.

mod fields;
mod frame;
mod packet;

pub use fields::{
    Address, Address16, Address64, AddressError, AtCommand, AtStatus, DeliveryStatus, ModemStatus,
    Protocol, TransmitStatus,
};
pub use frame::{Frame, FrameError, LONGEST_DATA};
pub use packet::{ApiMode, Decoder};
