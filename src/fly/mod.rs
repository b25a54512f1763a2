//! The hunt on real devices, or on the same devices emulated.

mod config;
mod device;
mod drone;
#[cfg(unix)]
mod emulated;
mod erased;
mod error;
mod identify;
mod mission;
mod open;
mod plan;
mod report;
mod rules;
mod tapped;

pub use config::{FlightConfig, FlownBeacon, Site};
pub use device::{GnssDevice, ListenConfig, RadioDevice, RotatorDevice, VehicleDevice};
pub use drone::DroneConfig;
#[cfg(unix)]
pub use emulated::{DroneFaults, EmulatedField, EmulatedFieldConfig, FieldError};
pub use erased::{
    BoxedAircraft, BoxedRadio, BoxedRotator, DeviceError, Examine, ExaminedAircraft, ExaminedRadio,
    ExaminedRotator,
};
pub use error::FlyError;
pub use identify::identify;
pub use mission::{FlownDrone, Mission, MissionError};
pub use open::OpenDrone;
pub use plan::{FlightPlan, PlannedDrone};
pub use report::{FlightReport, FlownFix};
pub use rules::{Ending, FlightRules};
pub use tapped::{Tap, Tapped};
