//! XBee radios: the beacon's counterpart under the drone.

mod config;
mod error;
mod examine;
mod identity;
mod link;
mod question;
mod radio;
mod setup;

pub use config::{XbeeConfig, XbeeQuestion};
pub use error::XbeeError;
pub use identity::XbeeIdentity;
pub use radio::{XbeeCounts, XbeeRadio};
