//! The log of a hunt: one versioned file of JSON lines, a header and then the events.
//!
//! Every number is written so that reading gives back each of its bits.

use std::{
    fs::{self, File, OpenOptions},
    io::{self, Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

use foxhunt_sim::BeaconCourse;
use foxhunt_wire::geodesy::Geodetic;
use nalgebra::{Vector2, Vector3};
use serde::{Deserialize, Serialize};

use crate::{
    config::{EstimatorConfig, ModelConfig, PlannerConfig},
    document,
    hunt::Event,
};

/// The version of the log that this program writes.
pub const LOG_VERSION: u32 = 7;

/// The oldest version that it reads: one without clouds, and with beacons that stay. Version 5 has
/// hunts that go on from their log; version 6 estimators and sources of users' own;
/// version 7 the health of drones, their heights above the ground, and models over terrain.
pub const OLDEST_LOG_VERSION: u32 = 2;

/// The first bytes of a log of any version.
pub const LOG_BEGIN: &[u8] = b"{\"foxhunt_log\"";

/// The first line of a log: how the estimates came about.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LogHeader {
    /// [`LOG_VERSION`] of the program that wrote it.
    pub foxhunt_log: u32,
    /// Name of the scenario or flight.
    pub scenario: String,
    /// The seed of estimators that draw random numbers, and of a simulated world.
    pub seed: u64,
    /// The estimator's name.
    pub estimator_name: String,
    /// The estimator, if it is made of the library's parts; absent for one of a user's own code,
    /// which is replayed where its name is [registered](crate::registry::Registry).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub estimator: Option<EstimatorConfig>,
    /// Law of propagation that the estimator assumed.
    pub model: ModelConfig,
    /// Planner that decided where to listen; absent in logs before version 4.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub planner: Option<PlannerConfig>,
    /// The beacons, in their order.
    pub beacons: Vec<LoggedBeacon>,
    /// UNIX time when the hunt's time was 0, in whole seconds, if it was flown by real clocks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub epoch_unix_s: Option<i64>,
    /// Places where the drones stood when the hunt began, East, North and Up in metres, if a hunt
    /// may have to go on from this log.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub homes: Vec<Vector3<f64>>,
    /// Place of the local frame's zero on Earth, if that is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<Geodetic>,
}

/// A beacon of a logged hunt.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoggedBeacon {
    /// Name of the beacon.
    pub name: String,
    /// True place at the time 0, East and North in metres, if that is known.
    pub truth: Option<Vector2<f64>>,
    /// Course from there; it stays where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub course: Option<BeaconCourse>,
    /// True places of further transmitters on its frequency, which stay.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub others: Vec<Vector2<f64>>,
}

impl LoggedBeacon {
    /// Returns its true place after `time` seconds, if that is known.
    #[must_use]
    pub fn place_at(&self, time: f64) -> Option<Vector2<f64>> {
        let start = self.truth?;
        Some(self.course.as_ref().map_or(start, |course| course.place_at(start, time)))
    }

    /// Returns the true place after `time` seconds of the transmitter on its frequency that is
    /// nearest to a place; its own where it is alone.
    #[must_use]
    pub fn nearest_at(&self, time: f64, place: &Vector2<f64>) -> Option<Vector2<f64>> {
        let off = |truth: &Vector2<f64>| (truth - place).norm_squared();
        let truths = self.place_at(time).into_iter().chain(self.others.iter().copied());
        truths.min_by(|a, b| off(a).total_cmp(&off(b)))
    }
}

/// A log that was read.
#[derive(Clone, Debug, PartialEq)]
pub struct Log {
    /// Header of the log.
    pub header: LogHeader,
    /// Events of the log, in the order in which they happened.
    pub events: Vec<Event>,
    /// True if the last line was cut short, as by a crash; it is left out of `events`.
    pub torn: bool,
}

impl Log {
    /// Reads a log file.
    ///
    /// # Errors
    ///
    /// [`LogError`] names the file and the line.
    #[inline]
    pub fn read(path: &Path) -> Result<Self, LogError> {
        let failed = |source| LogError::Read { path: path.to_owned(), source };
        let text = match String::from_utf8(fs::read(path).map_err(failed)?) {
            Ok(text) => text,
            // The end was cut within a character; a stand-in for it leaves the line as torn.
            Err(cut) if cut.utf8_error().error_len().is_none() => {
                String::from_utf8_lossy(cut.as_bytes()).into_owned()
            }
            Err(other) => {
                return Err(failed(io::Error::new(io::ErrorKind::InvalidData, other.utf8_error())));
            }
        };
        Self::parse(&text, path)
    }

    /// Reads a log from text; `path` is what errors call it.
    ///
    /// # Errors
    ///
    /// [`LogError`] names the file and the line.
    #[inline]
    pub fn parse(text: &str, path: &Path) -> Result<Self, LogError> {
        let path = || path.to_owned();
        let mut lines = text.lines().enumerate();
        let (_, first) = lines.next().ok_or_else(|| LogError::Empty { path: path() })?;
        let version = document::from_json::<Version>(first)
            .map_err(|source| LogError::NotALog { path: path(), source })?
            .foxhunt_log;
        if !(OLDEST_LOG_VERSION..=LOG_VERSION).contains(&version) {
            return Err(LogError::Version { path: path(), version });
        }
        let broken =
            |line: usize| move |source| LogError::Line { path: path(), line: line + 1, source };
        let header = document::from_json(first).map_err(broken(0))?;
        let mut events = Vec::new();
        let mut torn = false;
        let last = text.lines().count() - 1;
        for (index, line) in lines {
            match document::from_json(line) {
                Ok(event) => events.push(event),
                Err(_) if index == last && !text.ends_with('\n') => torn = true,
                Err(source) => return Err(broken(index)(source)),
            }
        }
        Ok(Self { header, events, torn })
    }
}

/// The one field that every version's header has.
#[derive(serde::Deserialize)]
struct Version {
    foxhunt_log: u32,
}

/// Reason why a log cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LogError {
    /// The file cannot be read.
    #[error("{}: cannot be read", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Cause of the failure.
        source: std::io::Error,
    },
    /// The file is empty.
    #[error("{}: the file is empty; a log begins with a header", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// The first line is no header.
    #[error("{}, line 1: no header of a foxhunt log", path.display())]
    NotALog {
        /// The file.
        path: PathBuf,
        /// Error of the parser.
        source: serde_json::Error,
    },
    /// The log is of another version.
    #[error(
        "{}, line 1: foxhunt_log is {version}; this program reads {OLDEST_LOG_VERSION} to \
         {LOG_VERSION}",
        path.display()
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// Version of the log.
        version: u32,
    },
    /// A line is no event.
    #[error("{}, line {line}: not an event of a foxhunt log", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Number of the line, from 1.
        line: usize,
        /// Error of the parser.
        source: serde_json::Error,
    },
}

/// Writes a log, a line at a time; each line is flushed, so that a crash loses nothing before it.
#[derive(Debug)]
pub struct LogWriter<W> {
    out: W,
}

impl<W: Write> LogWriter<W> {
    /// Begins a log with its header.
    ///
    /// # Errors
    ///
    /// The error of the writer.
    #[inline]
    pub fn new(out: W, header: &LogHeader) -> io::Result<Self> {
        let mut writer = Self { out };
        writer.line(header)?;
        Ok(writer)
    }

    /// Adds an event.
    ///
    /// # Errors
    ///
    /// The error of the writer.
    #[inline]
    pub fn event(&mut self, event: &Event) -> io::Result<()> {
        self.line(event)
    }

    #[inline]
    fn line(&mut self, value: &impl serde::Serialize) -> io::Result<()> {
        // One write for each line: two programs that append never mix within a line.
        let mut line = document::to_json(value)?;
        line.push('\n');
        self.out.write_all(line.as_bytes())?;
        self.out.flush()
    }
}

impl LogWriter<File> {
    /// Goes on behind the last whole line of a log file; what [`Log::read`] calls
    /// torn is cut off, and nothing else.
    ///
    /// # Errors
    ///
    /// The error of the writer.
    #[inline]
    pub fn append(path: &Path) -> io::Result<Self> {
        let mut out = OpenOptions::new().read(true).write(true).open(path)?;
        let mut text = Vec::new();
        out.read_to_end(&mut text)?;
        let whole = text.iter().rposition(|byte| *byte == b'\n').map_or(0, |last| last + 1);
        let rest = &text[whole..];
        let whole_event =
            str::from_utf8(rest).is_ok_and(|rest| document::from_json::<Event>(rest).is_ok());
        if whole_event {
            // All of the last line but its end was written.
            out.seek(SeekFrom::End(0))?;
            out.write_all(b"\n")?;
        } else {
            let whole = u64::try_from(whole).map_err(io::Error::other)?;
            out.set_len(whole)?;
            out.seek(SeekFrom::Start(whole))?;
        }
        Ok(Self { out })
    }
}
