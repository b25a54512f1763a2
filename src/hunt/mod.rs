//! The hunt itself: sweeps go in, corrections and goals come out.

mod config;
mod drive;
mod error;
mod event;
mod machine;
mod track;

pub use config::HuntConfig;
pub use drive::{DriveError, drive};
pub use error::HuntError;
pub use event::{Event, Fix};
pub use machine::{Command, Hunt};
pub use track::{Components, Heard, TimeStep, Track, TrackConfig, TrackError, WithoutBearing};
