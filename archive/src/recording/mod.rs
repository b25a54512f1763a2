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
mod floor;
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
mod rover;
mod rover_file;
mod row;
mod source;
mod sweep;
mod table;
mod utc;
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
pub use rover::Rover;
pub use source::{North, Source, Value};
pub use sweep::{RecordedSource, RecordedSweep, RecordingEnded, SweepWriter};
pub use utc::{utc, utc_seconds};
pub use utm::UtmZone;

use std::{ops::Deref, sync::Arc};

use foxhunt_core::{MeasuredList, Pose, Remark};
use foxhunt_wire::geodesy::{Geodetic, LocalFrame};
use nalgebra::{Vector2, Vector3};

/// One row of a recording, in our units and frame. Files may have millions of rows: what rows share
/// or lack are [`Details`], which a record has by dereference.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// The row's line in its file, from 1.
    pub line: u64,
    /// Time in seconds since the recording's own origin. All rows of a file have it, or no row.
    pub time: Option<f64>,
    /// The receiver's place and heading.
    place: Option<Place>,
    /// The received power, in dBm, or in dB about an unknown reference: see
    /// [`Recording::is_calibrated`].
    pub rss_dbm: Option<f64>,
    /// Values that rows share.
    details: Arc<Details>,
}

/// Place of a receiver, East, North and Up in metres, and the direction of its nose in radians
/// counter-clockwise from East.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Place {
    pub position: Vector3<f64>,
    pub heading: f64,
}

/// The pose of a receiver that is more than a [`Place`]: tilted, or of a known velocity.
fn beyond_place(pose: Pose) -> Option<Pose> {
    (pose != Pose::level(pose.position, pose.heading)).then_some(pose)
}

impl Record {
    /// Returns the receiver's pose. All rows of a file have it, or no row. Up is above the ground
    /// (or the frame's origin for `alt_m`), 0 where the height is not known; the heading is 0
    /// where it is not known.
    #[must_use]
    pub fn receiver(&self) -> Option<Pose> {
        let Place { position, heading } = self.place?;
        Some(self.tilted.unwrap_or_else(|| Pose::level(position, heading)))
    }
}

/// Values of a row that many rows share, or that few recordings have.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Details {
    /// The beacon's name, if the recording names them.
    pub beacon: Option<Arc<str>>,
    /// The receiver's name; the file's where the recording does not name it.
    pub drone: Arc<str>,
    /// σ of the receiver's place on each axis in metres, if the recording has it.
    pub receiver_sigma_m: Option<f64>,
    /// Direction of the antenna, in radians counter-clockwise from East; `None` for an
    /// omnidirectional antenna.
    pub boresight: Option<f64>,
    /// Index of the turn's position, from 0.
    pub position: Option<u16>,
    /// Number of the antenna's turn.
    pub turn: Option<u32>,
    /// The receiver's floor, as the level is given: a level at or below it is noise, and no level
    /// a silence.
    pub floor_dbm: Option<f64>,
    /// The receiver's ceiling, as the level is given, stated or found: at a level there or above
    /// the receiver is saturated, and the true level is higher.
    pub ceiling_dbm: Option<f64>,
    /// A ready-made bearing.
    pub bearing: Option<RecordedBearing>,
    /// Other measurements: a range, a range difference, a level difference.
    pub measured: MeasuredList,
    /// The known distance to the beacon, in metres, where it is not measured but given.
    pub known_range: Option<f64>,
    /// The beacon's true place, East and North in metres.
    pub truth: Option<Vector2<f64>>,
    /// The pose of a receiver that is not level, or whose velocity is known.
    tilted: Option<Pose>,
}

impl Deref for Record {
    type Target = Details;

    fn deref(&self) -> &Details {
        &self.details
    }
}

/// A bearing that a recording brings with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordedBearing {
    /// From the receiver to the beacon, in radians counter-clockwise from East.
    pub angle: f64,
    /// Standard deviation of the bearing in radians, if the recording has it.
    pub sigma: Option<f64>,
    /// True if angle and σ are calibrated by the array that made it.
    pub is_calibrated: bool,
}

/// The records of one file, at least one.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    file: String,
    format: String,
    frame: Option<LocalFrame>,
    in_degrees: bool,
    north: North,
    in_utc: bool,
    calibrated: bool,
    names_drones: bool,
    turns: Turns,
    rows: u64,
    dropped: Vec<Dropped>,
    backwards: Option<Backwards>,
    ignored: Vec<String>,
    remarks: Vec<Remark>,
    records: Vec<Record>,
}

/// Number of rows that a rule left out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Dropped {
    /// Rule that these rows did not pass, such as `alt_agl_m ≥ 15`. A row is counted at the first.
    pub rule: String,
    /// Number of rows.
    pub rows: u64,
}

/// Rows that are earlier than the row before of the same drone and beacon.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Backwards {
    /// The line of the first of them.
    pub line: u64,
    /// Time by which that row is earlier, in seconds.
    pub by_s: f64,
    /// Number of such rows.
    pub rows: u64,
}

impl Recording {
    /// Returns the file's name.
    #[must_use]
    pub fn file(&self) -> &str {
        &self.file
    }

    /// The name of the mapping it was read through.
    #[must_use]
    pub fn format(&self) -> &str {
        &self.format
    }

    /// Returns true if every row has a time.
    #[must_use]
    pub fn is_timed(&self) -> bool {
        self.records.iter().all(|record| record.time.is_some())
    }

    /// The rows that were kept, in the file's order.
    #[must_use]
    pub fn records(&self) -> &[Record] {
        &self.records
    }

    /// The local frame; `None` where the file is in local metres of unknown place, or has no
    /// positions.
    #[must_use]
    pub fn frame(&self) -> Option<LocalFrame> {
        self.frame
    }

    /// Returns true if the receivers' places are degrees of latitude and longitude.
    #[must_use]
    pub fn is_in_degrees(&self) -> bool {
        self.in_degrees
    }

    /// Returns the North of the file's angles; the records' angles are counted from the frame's
    /// East.
    #[must_use]
    pub fn north(&self) -> North {
        self.north
    }

    /// Returns true if the records' times are seconds since 1970 in UTC.
    #[must_use]
    pub fn is_in_utc(&self) -> bool {
        self.in_utc
    }

    /// Returns true if `rss_dbm` is in dBm, and not about an unknown reference.
    #[must_use]
    pub fn is_calibrated(&self) -> bool {
        self.calibrated
    }

    /// Returns true if the records have the receiver's place.
    #[must_use]
    pub fn is_located(&self) -> bool {
        self.records.iter().all(|record| record.place.is_some())
    }

    /// Returns the number of rows of the file, kept or not.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// Returns the number of rows that each rule left out: the mapping's rules first, in its order,
    /// then the two that every recording has: a measurement, and a position where the file has
    /// such.
    #[must_use]
    pub fn dropped(&self) -> &[Dropped] {
        &self.dropped
    }

    /// Returns the rows whose time runs backwards, if any; rows are taken in the order of time.
    #[must_use]
    pub fn backwards(&self) -> Option<Backwards> {
        self.backwards
    }

    /// Adds a remark on how the recording was joined.
    pub fn add_remark(&mut self, remark: Remark) {
        self.remarks.push(remark);
    }

    /// Doubts about the recording, each with the file and the lines that it is about: rows that
    /// were left out since they cannot be believed, places or times that do not fit together.
    #[must_use]
    pub fn remarks(&self) -> &[Remark] {
        &self.remarks
    }

    /// The file's columns that the mapping does not read.
    #[must_use]
    pub fn ignored_columns(&self) -> &[String] {
        &self.ignored
    }

    /// The beacons in the order of their first record; `None` for the nameless one.
    #[must_use]
    pub fn beacons(&self) -> Vec<Option<&str>> {
        distinct(self.records.iter().map(|record| record.beacon.as_deref()))
    }

    /// The drones in the order of their first record.
    #[must_use]
    pub fn drones(&self) -> Vec<&str> {
        distinct(self.records.iter().map(|record| &*record.drone))
    }

    /// Returns true if the recording names its drones; otherwise a drone is called as the file.
    #[must_use]
    pub fn names_drones(&self) -> bool {
        self.names_drones
    }

    /// The recording of each drone alone, in the order of their names.
    #[must_use]
    pub fn by_drone(&self) -> Vec<Self> {
        let mut drones = self.drones();
        drones.sort_unstable();
        let without = Self {
            file: self.file.clone(),
            format: self.format.clone(),
            dropped: self.dropped.clone(),
            ignored: self.ignored.clone(),
            remarks: self.remarks.clone(),
            records: Vec::new(),
            ..*self
        };
        let of = |drone: &str| {
            let own = self.records.iter().filter(|record| &*record.drone == drone);
            Self { records: own.cloned().collect(), ..without.clone() }
        };
        drones.into_iter().map(of).collect()
    }

    /// Replaces ready-made bearings by what `correct` makes of them; `None` leaves one as it is.
    pub(crate) fn correct_bearings(
        &mut self,
        mut correct: impl FnMut(&Record, RecordedBearing) -> Option<RecordedBearing>,
    ) {
        for record in &mut self.records {
            let Some(bearing) = record.bearing else { continue };
            if let Some(corrected) = correct(record, bearing) {
                Arc::make_mut(&mut record.details).bearing = Some(corrected);
            }
        }
    }

    /// Returns the receiver's first place on Earth; `None` where the recording has no such places.
    #[must_use]
    pub fn first_place(&self) -> Option<Geodetic> {
        let receiver = self.records.iter().find_map(Record::receiver)?;
        Some(self.frame?.to_geodetic(&receiver.position))
    }
}

/// The items in the order of their first appearance, each once.
fn distinct<T: PartialEq>(items: impl Iterator<Item = T>) -> Vec<T> {
    let mut known = Vec::new();
    for item in items {
        if !known.contains(&item) {
            known.push(item);
        }
    }
    known
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_of_millions_take_little_memory() {
        assert!(size_of::<Record>() <= 88, "{}", size_of::<Record>());
    }
}
