//! Other receivers as sources of the same hunt: RTL-SDR over rtl_tcp, `KrakenSDR`, SiK telemetry
//! radios.

mod config;
mod error;
mod examine;
mod gather;
mod kraken;
mod page;
mod placement;
mod rtl_tcp;
mod samples;
mod sik;
#[cfg(feature = "soapy")]
mod soapy;
mod timeline;
mod watch;

pub use config::{KrakenConfig, PulseConfig, RtlTcpConfig};
pub use error::{KrakenSourceError, RtlTcpRadioError};
pub use kraken::KrakenSource;
pub use placement::SampleLosses;
pub use rtl_tcp::RtlTcpRadio;
pub use samples::{RtlTcpSamples, RtlTcpTuning};
pub use sik::{SikError, SikFeed, SikRadio};
#[cfg(feature = "soapy")]
pub use soapy::{SoapyError, SoapySamples, SoapyTuning, soapy_devices};
