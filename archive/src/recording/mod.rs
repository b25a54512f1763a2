//! Recorded flights: CSV files whose named columns carry their unit and frame.
//!
//! Our own format and the column mappings that make others readable are described in
//! `docs/recordings.md`. Records are in our units: metres East-North-Up, radians counter-clockwise
//! from East, seconds, dBm.

mod beside;
mod ceiling;
mod clock_offset;
mod column;
mod convert;
mod converted;
mod coordinate;
mod dates;
mod decompress;
mod error;
mod exclusion;
mod flight_log;
mod formats;
mod mapping;
pub(crate) mod near_miss;
mod of_log;
mod options;
mod parse;
mod plain;
mod plan;
pub(crate) mod poses;
mod reachable;
mod read;
mod record;
mod rover;
mod rover_file;
mod row;
mod source;
mod sweep;
mod table;
pub(crate) mod utc;
mod utm;

pub use clock_offset::{ClockOffset, ClockOffsetError};
pub use column::Column;
pub use convert::write_recordings;
pub use dates::{TimeFormat, TimeZone};
pub use error::{FieldProblem, RecordingError};
pub use formats::builtin_mappings;
pub use mapping::{Beside, Keep, Mapping, Melt, Spectrum, Turns};
pub use options::{Band, ReadOptions};
pub use poses::{PoseLog, TimedLevel};
pub use record::{Backwards, Details, Dropped, Record, RecordedBearing, Recording};
pub use rover::Rover;
pub use source::{North, Source, Value};
pub use sweep::{RecordedSource, RecordedSweep, RecordingEnded, SweepWriter};
pub use utc::utc_seconds;
pub use utm::UtmZone;
