//! Receivers of a world that sends without being asked: rtl_tcp, and `KrakenSDR`'s page.

mod keyed;
mod kraken;
mod rtl_tcp;

pub use kraken::{EmulatedKraken, EmulatedKrakenConfig};
pub use rtl_tcp::{EmulatedRtlTcp, EmulatedRtlTcpConfig};
