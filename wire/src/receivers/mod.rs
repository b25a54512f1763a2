//! Protocols of other receivers: [`rtl_tcp`](RtlTcpHeader), `KrakenSDR`'s page of bearings
//! ([`KrakenDoa`]), and the RSSI of [`SiK`](sik_dbm) telemetry radios.

mod http;
mod kraken;
mod narrow_band;
mod rtl_tcp;
mod sik;

pub use http::{HttpError, HttpResponse};
pub use kraken::{KrakenDoa, KrakenError};
pub use narrow_band::NarrowBand;
pub use rtl_tcp::{RtlTcpCommand, RtlTcpError, RtlTcpHeader};
pub use sik::{SikStatus, sik_dbm};
