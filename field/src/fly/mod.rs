//! The hunt on real devices, or on the same devices emulated.

mod advised;
mod carried;
mod checklist;
mod config;
mod device;
mod driver;
mod drone;
#[cfg(unix)]
mod emulated;
#[cfg(unix)]
mod emulated_error;
#[cfg(unix)]
mod emulated_flight;
mod emulated_tags;
mod error;
mod flown_beacon;
mod flown_drone;
mod height_watch;
mod identify;
mod mission;
mod mission_file;
mod open;
mod over_ground;
mod plan;
mod ports;
mod report;
mod route;
mod rules;
mod site;
mod terrain;

pub use carried::{CarriedDrone, CarriedDroneError, ForeignVehicle};
pub use checklist::{Check, CheckState, Examined};
pub use config::FlightConfig;
pub use device::{GnssDevice, ListenConfig, RadioDevice, RotatorDevice, VehicleDevice};
pub use driver::{
    BoxedAircraft, BoxedRadio, BoxedRotator, Examine, ExaminedAircraft, ExaminedRadio,
    ExaminedRotator,
};
pub use drone::DroneConfig;
#[cfg(unix)]
pub use emulated::{DroneFaults, EmulatedField, EmulatedFieldConfig, EmulatedPorts};
#[cfg(unix)]
pub use emulated_error::EmulatedFieldError;
#[cfg(unix)]
pub use emulated_flight::{
    EmulatedFlight, EmulatedFlightError, EmulatedFlown, ReportedMode, pilot_modes,
};
pub use error::FlyError;
pub use flown_beacon::FlownBeacon;
pub(crate) use flown_drone::Departure;
pub use flown_drone::FlownDrone;
pub use foxhunt_hunt::hunt::{Tap, Tapped};
pub use identify::identify;
pub use mission::{Mission, MissionError};
pub use mission_file::{MissionFormat, MissionFormatError};
pub use open::OpenDrone;
pub use plan::{FlightPlan, PlannedDrone};
pub use ports::{Ports, SystemPorts};
pub use report::{FlightReport, FlownFix, FlownTruth};
pub use route::Route;
pub use rules::{Ending, FlightRules};
pub use site::Site;
pub use terrain::{Ground, TerrainConfig};
