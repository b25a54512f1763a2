//! Receptions that were struck out by hand, in a file of JSON lines: a header, then one reception a
//! line.
//!
//! Those of a log have its numbers of drones and beacons, from 0, and the time of the reception
//! with all of its digits:
//!
//! ```json
//! {"foxhunt_struck":1}
//! {"drone":0,"beacon":1,"time":11.4899999999998}
//! ```
//!
//! Those of a recording have the name of its file, the line of the row, or of the first one of a
//! turn, and the beacon where the recording names beacons:
//!
//! ```json
//! {"foxhunt_struck":1}
//! {"file":"walk.csv","line":7}
//! {"file":"collars.csv","line":12,"beacon":"fox"}
//! ```

mod logged;

pub use logged::Struck;

use std::{
    cmp::Ordering,
    collections::{BTreeMap, btree_map::Entry},
    fmt::{self, Display},
    fs,
    path::{Path, PathBuf},
};

use foxhunt_core::{BeaconId, Reception};
use foxhunt_hunt::document;
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use crate::recording::Recording;

/// Version of the file that this program writes and reads.
pub const STRUCK_VERSION: u32 = 1;

/// Identifies a reception.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum ReceptionKey {
    /// In a log.
    Logged(ReceptionId),
    /// In a recording.
    Recorded(RowId),
}

/// Identifies a reception of a log: by drone, beacon and time, where −0 s is 0 s.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReceptionId {
    /// Index of the drone, from 0.
    pub drone: usize,
    /// The beacon.
    pub beacon: BeaconId,
    /// Time of the reception, in seconds; every bit counts.
    pub time: f64,
}

impl ReceptionId {
    /// Identifies a drone's reception.
    #[must_use]
    pub fn new(drone: usize, reception: &Reception) -> Self {
        Self { drone, beacon: reception.beacon, time: reception.time }
    }
}

impl PartialEq for ReceptionId {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for ReceptionId {}

impl PartialOrd for ReceptionId {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for ReceptionId {
    fn cmp(&self, other: &Self) -> Ordering {
        let of = (self.drone, self.beacon).cmp(&(other.drone, other.beacon));
        of.then_with(|| (self.time + 0.0).total_cmp(&(other.time + 0.0)))
    }
}

impl Display for ReceptionId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { drone, beacon, time } = self;
        write!(f, "drone {drone}, beacon {}, time {time}", beacon.0)
    }
}

/// Identifies a reception of a recording.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RowId {
    /// The name of the file, without its folder unless another one of the same name is read along.
    pub file: String,
    /// The line of the row, or of the first one of the turn, from 1.
    pub line: u64,
    /// The beacon, where the recording names beacons.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beacon: Option<String>,
}

impl Display for RowId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { file, line, beacon } = self;
        match beacon {
            Some(beacon) => write!(f, "{beacon} in line {line} of {file}"),
            None => write!(f, "line {line} of {file}"),
        }
    }
}

/// Reason why a list of struck receptions cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum StruckError {
    /// The file cannot be read.
    #[error("{}: cannot be read", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the file system.
        source: std::io::Error,
    },
    /// The first line is no header.
    #[error(
        "{}, line 1: no header of struck receptions, such as {{\"foxhunt_struck\":1}}",
        path.display()
    )]
    Header {
        /// The file.
        path: PathBuf,
        /// The JSON error.
        source: serde_json::Error,
    },
    /// The list is of another version.
    #[error(
        "{}, line 1: foxhunt_struck is {version}; this program reads {STRUCK_VERSION}",
        path.display()
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// Version of the list.
        version: u32,
    },
    /// A line is no reception.
    #[error("{}, line {line}: not {what}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
        /// Expected contents of such a line.
        what: &'static str,
        /// The JSON error.
        source: serde_json::Error,
    },
    /// The log has no such reception.
    #[error(
        "{}, line {line}: the log has no reception of {reception}; {}",
        path.display(),
        where_it_is(nearest.as_ref())
    )]
    NoReception {
        /// The file.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
        /// The reception in that line.
        reception: ReceptionId,
        /// The reception of the same drone and beacon that is nearest in time.
        nearest: Option<ReceptionId>,
    },
    /// The recordings have no reception in such a row.
    #[error("{}, line {line}: there is no reception of {row}; {there}", path.display())]
    NoRow {
        /// The file.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
        /// The row in that line.
        row: RowId,
        /// Text about the rows that exist instead.
        there: String,
    },
    /// A reception stands there twice.
    #[error("{}, line {line}: {what} stands in line {before} already", path.display())]
    Twice {
        /// The file.
        path: PathBuf,
        /// Line number, from 1.
        line: usize,
        /// The reception in that line.
        what: String,
        /// Number of the earlier line.
        before: usize,
    },
}

fn where_it_is(nearest: Option<&ReceptionId>) -> String {
    nearest.map_or_else(
        || "that drone has none of that beacon".to_owned(),
        |nearest| format!("the nearest is at {}", nearest.time),
    )
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    foxhunt_struck: u32,
}

/// Names of some recordings' files in a [`RowId`], in the order of the recordings.
#[must_use]
pub fn file_names(recordings: &[Recording]) -> Vec<String> {
    let last = |recording: &Recording| {
        let file = recording.file();
        Path::new(file).file_name().map_or_else(|| file.to_owned(), |f| f.to_string_lossy().into())
    };
    let short: Vec<String> = recordings.iter().map(last).collect();
    let is_alone = |name: &String| short.iter().filter(|other| *other == name).count() < 2;
    let name = |(recording, short): (&Recording, &String)| match is_alone(short) {
        true => short.clone(),
        false => recording.file().to_owned(),
    };
    recordings.iter().zip(&short).map(name).collect()
}

/// Receptions that are left out, by their identifiers; empty by default.
#[derive(Clone, Debug, PartialEq)]
pub struct StruckList<I> {
    /// Each with its line in the file.
    lines: BTreeMap<I, usize>,
}

impl<I> Default for StruckList<I> {
    fn default() -> Self {
        Self { lines: BTreeMap::new() }
    }
}

impl<I: Ord + Display + DeserializeOwned> StruckList<I> {
    /// Reads the receptions of a list, each of which is checked; `what` is the name of one in
    /// errors.
    fn checked(
        text: &str,
        path: &Path,
        what: &'static str,
        check: impl Fn(usize, &I) -> Result<(), StruckError>,
    ) -> Result<Self, StruckError> {
        let mut struck = Self::default();
        for (line, id) in entries::<I>(text, path, what)? {
            check(line, &id)?;
            match struck.lines.entry(id) {
                Entry::Vacant(entry) => {
                    entry.insert(line);
                }
                Entry::Occupied(entry) => {
                    let what = entry.key().to_string();
                    let path = path.to_owned();
                    return Err(StruckError::Twice { path, line, what, before: *entry.get() });
                }
            }
        }
        Ok(struck)
    }
}

impl<I: Ord> StruckList<I> {
    /// Returns true if a reception is left out.
    #[must_use]
    pub fn contains(&self, id: &I) -> bool {
        self.lines.contains_key(id)
    }

    /// Returns the number of receptions left out.
    #[must_use]
    pub fn len(&self) -> usize {
        self.lines.len()
    }

    /// Returns true if no reception is left out.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }
}

/// Receptions of recordings that are left out.
pub type StruckRows = StruckList<RowId>;

impl StruckRows {
    /// Reads a file of receptions, each of which is one of `known`.
    ///
    /// # Errors
    ///
    /// [`StruckError`] names the file, the line and the value.
    pub fn read(path: &Path, known: &[RowId]) -> Result<Self, StruckError> {
        Self::parse(&read(path)?, path, known)
    }

    /// Reads receptions from text; `path` is what errors call it.
    ///
    /// # Errors
    ///
    /// [`StruckError`] names the file, the line and the value.
    pub fn parse(text: &str, path: &Path, known: &[RowId]) -> Result<Self, StruckError> {
        Self::checked(text, path, "file and line of a reception", |line, row| {
            if known.contains(row) {
                return Ok(());
            }
            let there = what_is_there(row, known);
            Err(StruckError::NoRow { path: path.to_owned(), line, row: row.clone(), there })
        })
    }

    /// Returns the number of a beacon's receptions left out.
    #[must_use]
    pub fn of_beacon(&self, beacon: Option<&str>) -> usize {
        self.lines.keys().filter(|row| row.beacon.as_deref() == beacon).count()
    }
}

/// The text of a list.
fn read(path: &Path) -> Result<String, StruckError> {
    fs::read_to_string(path).map_err(|source| StruckError::Read { path: path.to_owned(), source })
}

/// Reads the lines of a list after its header, each with its number from 1; `what` is the name of
/// such a line in errors.
fn entries<T: DeserializeOwned>(
    text: &str,
    path: &Path,
    what: &'static str,
) -> Result<Vec<(usize, T)>, StruckError> {
    let path = || path.to_owned();
    let mut lines = text.lines().zip(1..);
    let (first, _) = lines.next().unwrap_or_default();
    let Header { foxhunt_struck: version } = document::from_json(first)
        .map_err(|source| StruckError::Header { path: path(), source })?;
    if version != STRUCK_VERSION {
        return Err(StruckError::Version { path: path(), version });
    }
    let entry = |(text, line): (&str, usize)| {
        let wrong = |source| StruckError::Line { path: path(), line, what, source };
        Ok((line, document::from_json(text).map_err(wrong)?))
    };
    lines.filter(|(text, _)| !text.trim().is_empty()).map(entry).collect()
}

/// Describes the known row nearest to a missing one.
fn what_is_there(row: &RowId, known: &[RowId]) -> String {
    let of_file = || known.iter().filter(|known| known.file == row.file);
    let nearest = of_file().min_by_key(|known| (known.line.abs_diff(row.line), &known.beacon));
    match (nearest, known.first()) {
        (Some(nearest), _) => format!("the nearest is {nearest}"),
        (None, Some(first)) => format!("the first is {first}"),
        (None, None) => "the recording has no reception at all".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::ReadOptions;

    fn row(file: &str, line: u64, beacon: Option<&str>) -> RowId {
        RowId { file: file.to_owned(), line, beacon: beacon.map(str::to_owned) }
    }

    fn parse(lines: &str) -> Result<StruckRows, StruckError> {
        let known =
            [row("a.csv", 2, None), row("b.csv", 7, Some("fox")), row("b.csv", 7, Some("owl"))];
        let text = format!("{{\"foxhunt_struck\":1}}\n{lines}");
        StruckRows::parse(&text, Path::new("list"), &known)
    }

    #[test]
    fn rows_are_known_by_file_line_and_beacon() {
        let struck =
            parse("{\"file\":\"b.csv\",\"line\":7,\"beacon\":\"owl\"}\n\n").expect("it is there");
        assert_eq!(
            (struck.len(), struck.of_beacon(Some("owl")), struck.of_beacon(None)),
            (1, 1, 0)
        );
        assert!(struck.contains(&row("b.csv", 7, Some("owl"))));
        assert!(!struck.contains(&row("b.csv", 7, Some("fox"))));
        assert!(!struck.contains(&row("a.csv", 2, None)));
    }

    #[test]
    fn what_is_wrong_is_named() {
        let error = |lines: &str| parse(lines).expect_err("it is wrong").to_string();
        for (lines, part) in [
            ("{\"file\":\"a.csv\",\"line\":9}", "nearest is line 2 of a.csv"),
            ("{\"file\":\"b.csv\",\"line\":7}", "nearest is fox in line 7"),
            ("{\"file\":\"c.csv\",\"line\":2}", "first is line 2 of a.csv"),
            ("{\"drone\":0,\"beacon\":0,\"time\":6.0}", "not file and line"),
        ] {
            let error = error(lines);
            assert!(error.contains("list, line 2") && error.contains(part), "{error}");
        }
        let line = "{\"file\":\"a.csv\",\"line\":2}";
        let twice = error(&format!("{line}\n{line}"));
        assert!(twice.contains("line 3") && twice.contains("line 2 already"), "{twice}");
    }

    #[test]
    fn files_of_one_name_keep_their_folders() {
        let read = |name: &str| {
            let csv = "east_m,north_m,rss_dbm\n0,0,-60\n";
            Recording::from_reader(csv.as_bytes(), name, &ReadOptions::default()).expect("rows")
        };
        let names = file_names(&[read("x/a.csv"), read("x/b.csv"), read("y/b.csv")]);
        assert_eq!(names, ["a.csv", "x/b.csv", "y/b.csv"]);
    }
}
