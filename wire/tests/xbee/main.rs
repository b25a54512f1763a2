//! The frames of XBee radios: vectors of another implementation, and what holds for all bytes.
#![cfg(feature = "xbee")]

mod any;
mod properties;
mod vectors;
