//! The hunt: sweeps and receptions go in, corrections, goals and events come out.

mod cloud;
mod config;
mod drive;
mod error;
mod event;
mod flight;
mod learned;
mod machine;

pub use cloud::{PlaceEstimate, cloud};
pub use config::HuntConfig;
pub use drive::{
    Agenda, BoxedDrone, BoxedSource, BoxedVehicle, DeviceError, Devices, DriveError, Drone, Erased,
    Tap, Tapped, boxed_source, drive,
};
pub use error::HuntError;
pub use event::{Command, Event, Fix, FlightStage};
pub use foxhunt_estimators::{
    Components, FoundTransmitter, LearnedReceiver, TimeStep, Track, TrackConfig, TrackError,
    TrackStep, WithoutBearing,
};
pub use learned::remarks_of_receivers;
pub use machine::{Believed, Hunt, Parts, Search, Tracks};
