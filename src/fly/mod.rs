//! The hunt on real devices, or on the same devices emulated.

mod config;
mod drone;
mod erased;
mod error;
mod mission;
mod plan;
mod report;
mod tapped;

pub use config::{FlightConfig, FlownBeacon, Site};
pub use drone::{
    DroneConfig, GnssDevice, ListenConfig, OpenDrone, RadioDevice, RotatorDevice, VehicleDevice,
};
pub use erased::{BoxedAircraft, BoxedRadio, DeviceError};
pub use error::FlyError;
pub use mission::{Ending, FlightRules, FlownDrone, Mission, MissionError};
pub use plan::{FlightPlan, PlannedDrone};
pub use report::{FlightReport, FlownFix};
pub use tapped::{Tap, Tapped};
