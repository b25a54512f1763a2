//! The hunt itself: sweeps go in, corrections and goals come out.

mod cloud;
mod command;
mod config;
mod drive;
mod error;
mod event;
mod flight;
mod homeward;
mod machine;
mod outbox;
mod parts;
mod search;
mod searching;
mod track;

pub use command::Command;
pub use config::HuntConfig;
pub use drive::{DriveError, drive};
pub use error::HuntError;
pub use event::{Event, Fix, FlightStage};
pub use machine::Hunt;
pub use parts::{BoxedHunt, HuntParts, PartsError};
pub use track::{Components, Heard, TimeStep, Track, TrackConfig, TrackError, WithoutBearing};

use flight::Flight;
use outbox::Outbox;
