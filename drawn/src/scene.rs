//! Recordings before and after they become text, and the classes that they are drawn from.

use std::{io, path::Path};

use crate::{bound::Bound, geodesy::Origin, random::Random};

/// Name of the class whose recordings are so large that it runs on request alone.
pub const LARGE_NAME: &str = "large";

/// Names of the classes whose recordings leave the place open.
pub const OPEN: [&str; 4] = ["hover", "jitter", "never-there", "bearings-place"];

/// East, North and Up in metres.
pub type At = [f64; 3];

/// A row of a recording: who received what, where and when.
#[derive(Clone, Debug, Default)]
pub struct Row {
    /// Number of the transmitter, where the recording names them.
    pub beacon: Option<u32>,
    /// Number of the receiver, where there are several.
    pub receiver: Option<u32>,
    pub time_s: f64,
    /// Recorded place of the receiver.
    pub at: At,
    /// True place of the transmitter.
    pub truth: Option<[f64; 2]>,
    /// Further columns by name.
    pub values: Vec<(&'static str, f64)>,
}

impl Row {
    /// Creates a row without values.
    pub fn new(time_s: f64, at: At, truth: At) -> Self {
        Self { time_s, at, truth: Some([truth[0], truth[1]]), ..Self::default() }
    }

    /// Sets the value of a column.
    pub fn with(mut self, column: &'static str, value: f64) -> Self {
        self.set(column, value);
        self
    }

    /// Sets the value of a column.
    pub fn set(&mut self, column: &'static str, value: f64) {
        match self.values.iter_mut().find(|(name, _)| *name == column) {
            Some(known) => known.1 = value,
            None => self.values.push((column, value)),
        }
    }

    /// Returns the value of a column.
    pub fn get(&self, column: &str) -> Option<f64> {
        self.values.iter().find(|(name, _)| *name == column).map(|(_, value)| *value)
    }

    /// Replaces the value of a column, where there is one.
    pub fn change(&mut self, column: &'static str, change: impl FnOnce(f64) -> f64) {
        if let Some(value) = self.get(column) {
            self.set(column, change(value));
        }
    }
}

/// Separators of cells and decimals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Spelling {
    /// Commas between cells, decimal points.
    #[default]
    Point,
    /// Semicolons between cells, decimal commas.
    Comma,
}

/// All of a drawn recording before it becomes text.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    pub rows: Vec<Row>,
    /// Places are written in degrees from here, and in metres without.
    pub origin: Option<Origin>,
    pub spelling: Spelling,
    /// Lines above the header.
    pub preamble: Vec<String>,
    /// Columns that the file calls by another name.
    pub renamed: Vec<(&'static str, &'static str)>,
    /// Files beside it.
    pub beside: Vec<DrawnFile>,
    pub flags: Vec<String>,
    pub bound: Option<Bound>,
    /// Nothing was transmitted: any place is wrong.
    pub is_empty: bool,
    /// Names of columns of truth are left out of the file.
    pub hides_truth: bool,
}

impl Scene {
    /// Creates a scene of rows in metres.
    pub fn of(rows: Vec<Row>) -> Self {
        Self { rows, ..Self::default() }
    }

    /// Adds a flag with its value.
    pub fn with_flag(mut self, flag: &str, value: impl ToString) -> Self {
        self.flags.push(format!("{flag}={}", value.to_string()));
        self
    }

    /// Writes places in degrees.
    pub fn in_degrees(mut self, lat_deg: f64, lon_deg: f64) -> Self {
        self.origin = Some(Origin { lat_deg, lon_deg });
        self
    }

    /// Writes the rows as a table with a header.
    fn text(&self) -> String {
        let has_beacons = self.rows.iter().any(|row| row.beacon.is_some());
        let has_receivers = self.rows.iter().any(|row| row.receiver.is_some());
        let mut columns: Vec<&'static str> = Vec::new();
        for (name, _) in self.rows.iter().flat_map(|row| &row.values) {
            if !columns.contains(name) {
                columns.push(name);
            }
        }
        let mut header: Vec<&str> = Vec::new();
        header.extend(has_beacons.then_some("beacon"));
        header.extend(has_receivers.then_some("drone"));
        header.push("time_s");
        header.extend(match self.origin {
            Some(_) => ["lat_deg", "lon_deg", "alt_agl_m"],
            None => ["east_m", "north_m", "up_m"],
        });
        header.extend(&columns);
        let has_truth = !self.hides_truth && self.rows.iter().any(|row| row.truth.is_some());
        header.extend(match (has_truth, self.origin) {
            (false, _) => &[][..],
            (true, Some(_)) => &["truth_lat_deg", "truth_lon_deg"],
            (true, None) => &["truth_east_m", "truth_north_m"],
        });
        for name in &mut header {
            if let Some((_, other)) = self.renamed.iter().find(|(own, _)| own == name) {
                *name = other;
            }
        }
        let separator = match self.spelling {
            Spelling::Point => ",",
            Spelling::Comma => ";",
        };
        let mut lines = self.preamble.clone();
        lines.push(header.join(separator));
        for row in &self.rows {
            let mut cells = Vec::with_capacity(header.len());
            cells.extend(row.beacon.filter(|_| has_beacons).map(|number| format!("fox{number}")));
            if has_receivers {
                cells.push(format!("rx{}", row.receiver.unwrap_or(0)));
            }
            cells.push(number(row.time_s, 3));
            cells.extend(self.place([row.at[0], row.at[1]]));
            cells.push(number(row.at[2], 2));
            let cell = |name: &&str| row.get(name).map_or_else(String::new, |v| number(v, 3));
            cells.extend(columns.iter().map(cell));
            if has_truth {
                let missing = [String::new(), String::new()];
                cells.extend(row.truth.map_or(missing, |truth| self.place(truth)));
            }
            if self.spelling == Spelling::Comma {
                cells.iter_mut().for_each(|cell| *cell = cell.replace('.', ","));
            }
            lines.push(cells.join(separator));
        }
        lines.push(String::new());
        lines.join("\n")
    }

    fn place(&self, at: [f64; 2]) -> [String; 2] {
        match self.origin {
            Some(origin) => origin.degrees(at).map(|degrees| number(degrees, 7)),
            None => at.map(|metres| number(metres, 2)),
        }
    }
}

/// A file of a drawn recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DrawnFile {
    /// Name of the file in the folder that the command runs in.
    pub name: String,
    /// Text of the file.
    pub text: String,
}

/// A recording that was drawn from a seed.
#[derive(Clone, Debug, PartialEq)]
pub struct DrawnRecording {
    /// The files: first the recording, then those beside it.
    pub files: Vec<DrawnFile>,
    /// Flags of the command that reads them, beginning with `--track` where the transmitter is to
    /// be tracked; names of files in them stand for files of the folder.
    pub flags: Vec<String>,
    /// Lines of the recording up to the end of its header.
    pub header: usize,
    /// The least error, where the recording follows a law that has one.
    pub bound: Option<Bound>,
    /// True if nothing was transmitted: any place is wrong.
    pub is_empty: bool,
}

impl DrawnRecording {
    /// Returns the text of the recording.
    #[must_use]
    pub fn text(&self) -> &str {
        self.files.first().map_or("", |file| &file.text)
    }

    /// Replaces the text of the recording.
    #[must_use]
    pub fn with_text(mut self, text: String) -> Self {
        if let Some(file) = self.files.first_mut() {
            file.text = text;
        }
        self
    }

    /// Returns true if the transmitter is to be tracked.
    #[must_use]
    pub fn is_track(&self) -> bool {
        self.flags.iter().any(|flag| flag == "--track")
    }
}

/// A kind of recordings.
#[derive(Clone, Copy, Debug)]
pub struct Class {
    /// Name of the class, as `--class` takes it.
    pub name: &'static str,
    /// Summary of its draws, in a line.
    pub about: &'static str,
    source: Source,
}

/// Origin of the recordings of a class.
#[derive(Clone, Copy, Debug)]
enum Source {
    /// Drawn rows.
    Rows(fn(&mut Random) -> Scene),
    /// Drawn files in a format of their own.
    Files(fn(&mut Random) -> DrawnRecording),
    /// Real recordings in a folder.
    Cut(fn(&mut Random, &Path) -> io::Result<DrawnRecording>),
}

impl Class {
    /// Creates a class of drawn rows.
    pub(crate) const fn rows(
        name: &'static str,
        about: &'static str,
        draw: fn(&mut Random) -> Scene,
    ) -> Self {
        Self { name, about, source: Source::Rows(draw) }
    }

    /// Creates a class of drawn files.
    pub(crate) const fn files(
        name: &'static str,
        about: &'static str,
        draw: fn(&mut Random) -> DrawnRecording,
    ) -> Self {
        Self { name, about, source: Source::Files(draw) }
    }

    /// Creates a class of real recordings that are cut.
    pub(crate) const fn cut(
        name: &'static str,
        about: &'static str,
        draw: fn(&mut Random, &Path) -> io::Result<DrawnRecording>,
    ) -> Self {
        Self { name, about, source: Source::Cut(draw) }
    }

    /// Returns true if the class cuts real recordings and needs their folder.
    #[must_use]
    pub fn is_cut(&self) -> bool {
        matches!(self.source, Source::Cut(_))
    }

    /// Returns true if each recording takes many seconds.
    #[must_use]
    pub fn is_large(&self) -> bool {
        self.name == LARGE_NAME
    }

    /// Returns true if the recordings leave the place open, so that a refusal is right.
    #[must_use]
    pub fn is_open(&self) -> bool {
        OPEN.contains(&self.name)
    }

    /// Draws the recording of a seed. The same seed gives the same one, whatever else is drawn;
    /// `data` is the folder of real recordings.
    ///
    /// # Errors
    ///
    /// [`io::Error`] that names the file, where a real recording cannot be read or no folder is
    /// given.
    pub fn draw(&self, seed: u64, data: Option<&Path>) -> io::Result<DrawnRecording> {
        let mut random = Random::new(self.name, seed);
        match self.source {
            Source::Rows(draw) => Ok(recording(self.name, draw(&mut random))),
            Source::Files(draw) => Ok(draw(&mut random)),
            Source::Cut(draw) => match data {
                Some(data) => draw(&mut random, data),
                None => Err(io::Error::new(
                    io::ErrorKind::NotFound,
                    format!("{}: no folder of real recordings is given", self.name),
                )),
            },
        }
    }
}

/// Writes a number with at most `decimals` decimals.
fn number(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Writes a scene.
fn recording(name: &str, scene: Scene) -> DrawnRecording {
    let recorded = DrawnFile { name: format!("{name}.csv"), text: scene.text() };
    DrawnRecording {
        header: scene.preamble.len() + 1,
        files: [recorded].into_iter().chain(scene.beside).collect(),
        flags: scene.flags,
        bound: scene.bound,
        is_empty: scene.is_empty,
    }
}
