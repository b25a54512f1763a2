//! Worlds as files: plain fields with defaults, checked when a world is made of them.

mod channel;
mod check;
mod devices;
mod world;

pub use channel::ChannelConfig;
pub use devices::{SimStepperConfig, VehicleConfig};
pub use world::{BeaconConfig, DroneConfig, WorldConfig};

pub(crate) use check::{finite, in_range, not_negative, positive};
