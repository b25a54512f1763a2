//! The hunt on real devices, or on the same devices emulated.

mod carried;
mod checklist;
mod config;
mod driver;
mod drone;
mod eager;
#[cfg(unix)]
mod emulated;
#[cfg(unix)]
mod emulated_flight;
#[cfg(unix)]
mod emulated_ports;
mod error;
mod flown_drone;
mod guide;
mod identify;
mod mission;
mod open;
mod plan;
mod route;
mod rules;
mod sections;
mod terrain;
mod wrapped;

pub use carried::{CarriedDrone, CarriedDroneError, ForeignVehicle};
pub use checklist::{Check, CheckState, Examined};
pub use config::FlightConfig;
pub use driver::{
    BoxedAircraft, BoxedRadio, BoxedRotator, Examine, ExaminedAircraft, ExaminedRadio,
    ExaminedRotator,
};
pub use drone::DroneConfig;
#[cfg(unix)]
pub use emulated::{
    DroneFaults, EmulatedField, EmulatedFieldConfig, EmulatedPlatform, EmulatedReceiver,
    EmulatedVehicle,
};
#[cfg(unix)]
pub use emulated_flight::{
    EmulatedFlight, EmulatedFlightError, EmulatedFlown, ReportedMode, pilot_modes,
};
#[cfg(unix)]
pub use emulated_ports::{EmulatedFieldError, EmulatedPorts};
pub use error::FlyError;
pub(crate) use flown_drone::Departure;
pub use flown_drone::FlownDrone;
pub use foxhunt_hunt::hunt::{Tap, Tapped};
pub use guide::{Pitch, PitchConfig, Warmth};
pub use identify::identify;
pub use mission::{Mission, MissionError};
pub use open::{Connector, OpenDrone, Ports, SystemPorts};
pub use plan::{FlightPlan, FlightReport, FlownFix, FlownTruth, PlannedDrone};
pub use route::{MissionFormat, MissionFormatError, Route};
pub use rules::{Ending, FlightRules};
pub use sections::{
    FlownBeacon, GnssDevice, ListenConfig, RadioDevice, RotatorDevice, Site, VehicleDevice,
};
pub use terrain::{Ground, TerrainConfig};
