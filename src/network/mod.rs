//! A hunt on several computers: one on every drone, and one that fuses, over any link.
//!
//! A [`DroneNode`] turns its antenna, makes receptions of what it hears, and flies where it is told.
//! A [`FusionNode`] runs the [`Hunt`](crate::hunt::Hunt). Both say what they have to say again and
//! again, so that whatever is lost, late or doubled on the way, and whichever of them is restarted,
//! nothing is counted twice and nothing that was delivered is lost.

mod config;
mod deliveries;
mod draws;
mod drone;
mod error;
mod fusion;
mod remote;
mod show;

pub use config::{DroneNodeConfig, FusionNodeConfig};
pub use draws::uniform_draws;
pub use drone::DroneNode;
pub use error::NetworkError;
pub use fusion::{FusionNode, Past};
