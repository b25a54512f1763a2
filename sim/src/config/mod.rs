//! Worlds as files: plain fields with defaults, checked when a world is made of them.

mod channel;
mod course;
mod devices;
mod interval;
mod multipath;
mod path_loss;
mod range_difference;
mod relief;
mod three_axis;
mod vehicle;
mod world;

pub use channel::ChannelConfig;
pub use course::BeaconCourse;
pub use devices::SimStepperConfig;
pub use interval::Interval;
pub use multipath::{DeadZoneConfig, ReflectorConfig, ScatteringConfig, ShadowingConfig};
pub use path_loss::{PathLossConfig, TwoRayConfig};
pub use range_difference::RangeDifferenceConfig;
pub use relief::ReliefConfig;
pub use three_axis::{DipoleConfig, ThreeAxisConfig};
pub use vehicle::{KinematicConfig, VehicleConfig};
pub use world::{BeaconConfig, DroneConfig, PulseTrain, WorldConfig};
