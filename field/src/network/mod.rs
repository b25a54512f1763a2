//! A hunt on several computers: one on every drone, and one that fuses, over any link.
//!
//! A [`DroneNode`] turns its antenna, makes receptions of its sweeps, and flies where it is sent; a
//! [`FlownNode`] does so with a real aircraft, by its pilot's rules. A [`FusionNode`] runs the
//! [`Hunt`](foxhunt_hunt::hunt::Hunt). Both repeat their messages, so that whatever is lost, late
//! or doubled on the way, and whichever of them is restarted, nothing is counted twice and nothing
//! that was delivered is lost.
//!
//! # Why this is not `drive`
//!
//! [`drive`](foxhunt_hunt::hunt::drive) calls the devices of each drone and takes their answers
//! within one step. Here the devices are on other computers: a pose comes when it comes, an order
//! is a state that is repeated until it is followed, and a sweep never leaves its drone, which
//! sends the reception made of it. So a [`FusionNode`] calls the same methods of the same hunt
//! (`located`, `advance`, `poll_command`, `reception`) as messages come and go, and a [`DroneNode`]
//! calls the devices. What is known of a lost or doubled message has no place in the traits of
//! devices.

mod config;
mod deliveries;
mod draws;
mod drone;
mod error;
mod flown;
mod fusion;
mod remote;
mod show;

pub use config::{DroneNodeConfig, FusionNodeConfig};
pub use draws::uniform_draws;
pub use drone::DroneNode;
pub use error::NetworkError;
pub use flown::FlownNode;
pub use fusion::{FusionNode, Past};
