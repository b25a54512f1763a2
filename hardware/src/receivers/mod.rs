//! Other receivers as sources of the same hunt: RTL-SDR over rtl_tcp, `KrakenSDR`, SiK telemetry
//! radios.

mod config;
mod error;
mod examine;
mod gather;
mod kraken;
mod page;
mod rtl_tcp;
mod sik;

pub use config::{KrakenConfig, RtlTcpConfig};
pub use error::{KrakenSourceError, RtlTcpRadioError};
pub use kraken::KrakenSource;
pub use rtl_tcp::RtlTcpRadio;
pub use sik::{SikError, SikFeed, SikRadio};
