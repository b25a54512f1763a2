//! XBee radios: the beacon's counterpart under the drone.

mod config;
mod error;
mod examine;
mod firmware;
mod link;
mod question;
mod radio;
mod setup;

pub use config::{XbeeConfig, XbeeConfigError, XbeeQuestion};
pub use error::XbeeError;
pub use firmware::{XbeeIdentity, XbeeProtocol};
pub use radio::{XbeeCounts, XbeeRadio};
