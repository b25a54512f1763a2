//! Worlds as files: plain fields with defaults, checked when a world is made of them.

mod beacon;
mod channel;
mod equipment;
mod path_loss;
mod relief;
mod world;

pub use beacon::{BeaconConfig, BeaconCourse, DipoleConfig, OtherConfig, PulseTrain};
pub use channel::{
    ChannelConfig, DeadZoneConfig, ReflectorConfig, ScatteringConfig, ShadowingConfig,
};
pub use equipment::{
    KinematicConfig, RangeDifferenceConfig, SimStepperConfig, ThreeAxisConfig, VehicleConfig,
};
pub use path_loss::{PathLossConfig, TwoRayConfig};
pub use relief::ReliefConfig;
pub use world::{DroneConfig, Interval, WorldConfig};
