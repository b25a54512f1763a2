//! The hunt itself: sweeps go in, corrections and goals come out.

mod cloud;
mod command;
mod config;
mod drive;
mod error;
mod event;
mod flight;
mod hearing;
mod homeward;
mod machine;
mod outbox;
mod parts;
mod resume;
mod search;
mod searching;
mod track;

pub use command::Command;
pub use config::HuntConfig;
pub use drive::{DriveError, drive};
pub use error::HuntError;
pub use event::{Event, Fix, FlightStage};
pub use machine::{Believed, Hunt};
pub use parts::{BoxedHunt, HuntExtractor, HuntParts, PartsError, hunt_extractor};
pub use track::{Components, Heard, TimeStep, Track, TrackConfig, TrackError, WithoutBearing};

use flight::Flight;
use outbox::Outbox;
