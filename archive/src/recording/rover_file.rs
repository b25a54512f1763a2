//! Files that hold the path of a receiver, of any kind.

use std::{fs, path::Path};

use super::{
    Column, ReadOptions, Record, Recording, RecordingError, Rover,
    decompress::{self, decompressed},
    flight_log::{Fix, Kind},
    formats,
    read::on_ground,
};

/// Bytes in which the first element of a GPX file is looked for.
const LOOKED_AT: usize = 1024;

impl Rover {
    /// Number of bytes by which a file is recognised; tables of autopilots have headers of some
    /// thousand.
    pub const BEGIN: usize = 1 << 15;

    /// Returns true for a GPX or KML file or an autopilot's log, which [`Self::parse`] reads. The
    /// first [`Self::BEGIN`] bytes are enough, but for a KMZ file.
    #[must_use]
    pub fn is_track(bytes: &[u8]) -> bool {
        let bytes = &*decompress::begin(bytes, Self::BEGIN);
        let begin = bytes.get(..LOOKED_AT).unwrap_or(bytes);
        let is_xml = begin.starts_with(b"<") || begin.starts_with(b"\xef\xbb\xbf<");
        let is_track = is_xml && begin.windows(4).any(|word| word == b"<gpx" || word == b"<kml");
        // Lines in KML without a track have no times: they are bearings, or drawn.
        let has = |element: &[u8]| bytes.windows(element.len()).any(|word| word == element);
        let is_track = is_track && (!has(b"<LineString") || has(b"Track>"));
        is_track || Kind::of(bytes).is_some()
    }

    /// Returns true for a table with times and places but nothing that was measured, which
    /// [`Self::parse`] reads as well, by its first [`Self::BEGIN`] bytes.
    #[must_use]
    pub fn is_path_table(bytes: &[u8]) -> bool {
        formats::is_path(&decompress::begin(bytes, Self::BEGIN))
    }

    /// Reads a GPX, KML or KMZ file, an autopilot's log, or a table, compressed with gzip or not.
    ///
    /// # Errors
    ///
    /// [`RecordingError`] names the file, and the line, field and value of an invalid point: out of
    /// range, at 0, 0, or earlier than the one before; for a log without places in UTC, the reason.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, RecordingError> {
        Self::read_with(path, &ReadOptions::default())
    }

    /// Reads a file as [`Self::read`] does. The options' zone and order of day and month hold for
    /// the times of a table.
    ///
    /// # Errors
    ///
    /// As [`Self::read`].
    pub fn read_with(
        path: impl AsRef<Path>,
        options: &ReadOptions,
    ) -> Result<Self, RecordingError> {
        let file = path.as_ref().display().to_string();
        let wrong = |source| RecordingError::Read { file: file.clone(), source };
        let bytes = fs::read(path).map_err(wrong)?;
        Self::parse_with(&bytes, &file, options)
    }

    /// Reads a track from the contents of such a file; `file` is its name in errors.
    ///
    /// # Errors
    ///
    /// As [`Self::read`].
    pub fn parse(bytes: &[u8], file: &str) -> Result<Self, RecordingError> {
        Self::parse_with(bytes, file, &ReadOptions::default())
    }

    fn parse_with(bytes: &[u8], file: &str, options: &ReadOptions) -> Result<Self, RecordingError> {
        let contents = decompressed(bytes, file)?;
        let xml = &*contents;
        if let Some(kind) = Kind::of(xml) {
            return Self::of_log(kind, xml, file);
        }
        // GPX and KML are XML, perhaps behind spaces or a byte order mark; a table begins
        // otherwise.
        let begin = xml.strip_prefix(b"\xef\xbb\xbf").unwrap_or(xml);
        let first = begin.iter().find(|byte| !byte.is_ascii_whitespace());
        if first.is_some_and(|byte| *byte != b'<') {
            return Self::of_table(xml, file, options);
        }
        Self::of_xml(xml, file)
    }

    /// A table is a recording whose level is the same everywhere.
    fn of_table(bytes: &[u8], file: &str, stated: &ReadOptions) -> Result<Self, RecordingError> {
        let mut options = ReadOptions::default().with_constant(Column::RssDb, 0.0);
        options.time_format = stated.time_format;
        options.time_zone = stated.time_zone;
        let recording = Recording::from_reader(bytes, file, &options)?;
        let no_path = |problem: &str| RecordingError::NoPath {
            file: file.to_owned(),
            what: "a table",
            problem: problem.to_owned(),
        };
        if !recording.is_in_utc() {
            return Err(no_path("its times are not in UTC: a path needs dates, or time_utc"));
        }
        let in_degrees = recording.frame.filter(|_| recording.in_degrees);
        let frame = in_degrees.ok_or_else(|| no_path("its places are not in degrees"))?;
        let has_height = recording.records().iter().filter_map(|record| record.receiver());
        let has_height = has_height.clone().any(|pose| pose.position.z.abs() > 0.0);
        let fix = |record: &Record| {
            let position = record.receiver()?.position;
            let place = match has_height {
                true => frame.to_geodetic(&position),
                false => on_ground(&frame, position),
            };
            Some(Fix { time: record.time?, place })
        };
        let mut fixes: Vec<Fix> = recording.records().iter().filter_map(fix).collect();
        fixes.sort_by(|a, b| a.time.total_cmp(&b.time));
        // Of the places of a whole second the first one is nearest to its begin.
        fixes.dedup_by(|next, last| next.time <= last.time);
        Self::of_fixes(fixes, file)
    }
}
