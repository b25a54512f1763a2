//! Receivers of a world whose transmitters send by themselves: rtl_tcp, and `KrakenSDR`'s page.

mod config;
mod dongle;
mod keyed;
mod kraken;
mod rtl_tcp;

pub use config::{EmulatedRtlTcpConfig, InterfererConfig};
pub use dongle::{EmulatedDongle, PlayedPulse};
pub use kraken::{EmulatedKraken, EmulatedKrakenConfig};
pub use rtl_tcp::EmulatedRtlTcp;
