//! Cursor on Target to TAK servers and teams: over TCP, TLS and UDP (unicast and multicast).
//!
//! A [`CotSender`] has one thread for each address, so that neither a slow server nor a lost
//! network holds up the hunt. It keeps the last message of each name alone: its memory and its
//! traffic are bounded, and a connection that comes back gets the present state.

mod config;
#[cfg(feature = "cot")]
mod sender;
#[cfg(feature = "cot")]
mod stream;
#[cfg(feature = "cot")]
mod tls;

pub use config::{CotAddress, CotConfig, CotError, CotTransport};
#[cfg(feature = "cot")]
pub use sender::{CotMessage, CotSender};

#[cfg(all(test, feature = "cot"))]
mod tests;
