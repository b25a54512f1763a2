//! Worlds as files: plain fields with defaults, checked when a world is made of them.

mod channel;
mod check;
mod devices;
mod multipath;
mod path_loss;
mod world;

pub use channel::ChannelConfig;
pub use devices::{SimStepperConfig, VehicleConfig};
pub use multipath::{ReflectorConfig, ShadowingConfig};
pub use path_loss::{PathLossConfig, TwoRayConfig};
pub use world::{BeaconConfig, DroneConfig, WorldConfig};

pub(crate) use check::{finite, in_range, not_negative, positive};
