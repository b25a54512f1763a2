//! Pulses that detectors wrote and tables of known tags, read from rows of text.

use std::{
    fs,
    io::{self, Read as _},
    path::{Path, PathBuf},
};

use chrono::DateTime;
use flate2::read::MultiGzDecoder;
use serde::{Deserialize, Serialize};

use crate::Pulse;

/// The first bytes of a gzip file (RFC 1952, §2.3.1).
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// Length of the pulses that SensorGnome's detector searches for by default, in seconds; its files
/// do not hold a width.
const SENSORGNOME_WIDTH_S: f64 = 0.0025;

/// Columns of a SensorGnome's pulses.
const SENSORGNOME_PULSE: [&str; 4] = ["time_unix_s", "dfreq_kHz", "sig_dB", "noise_dB"];

/// Lines by which a SensorGnome's own file is known.
const SENSORGNOME_LINES: usize = 100;

/// Headers of files of pulses.
const PULSES: &str = "a pulse file: time_s, frequency_hz, width_s, power_dbm, snr_db (foxhunt); \
                     time_unix_s, dfreq_kHz, sig_dB, noise_dB (SensorGnome); Time, Frequency, \
                     Duration, avg (dBW), snr (dB) (pyradiotracking)";

/// Headers of tables of tags.
const TAGS: &str = "a table of tags: name, interval_s and at will frequency_hz, width_s, \
                    gaps_ms, other_interval_s (foxhunt); tagID, nomFreq, offsetFreq, period, \
                    pulseLen, param1, param2, param3 (SensorGnome)";

/// The reason why pulses cannot be read or associated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TagError {
    /// The file cannot be read.
    #[error("{}: cannot be read", file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// The cause.
        source: io::Error,
    },
    /// The header belongs to no known file.
    #[error("{}, line 1: the columns {columns} are not those of {wanted}", file.display())]
    Header {
        /// The file.
        file: PathBuf,
        /// The columns of the file.
        columns: String,
        /// The columns that are known.
        wanted: &'static str,
    },
    /// A line has another number of fields than the header, or is not text.
    #[error("{}, line {line}: {problem}", file.display())]
    Line {
        /// The file.
        file: PathBuf,
        /// The line, from 1.
        line: u64,
        /// The problem.
        problem: String,
    },
    /// A field does not hold what it must.
    #[error("{}, line {line}, {field}: {value:?} is not {requirement}", file.display())]
    Field {
        /// The file.
        file: PathBuf,
        /// The line, from 1.
        line: u64,
        /// The column.
        field: String,
        /// The content of the field.
        value: String,
        /// The requirement on the field.
        requirement: &'static str,
    },
    /// Two tags of a table have the same name.
    #[error("{}, line {line}: there is a tag {name:?} already", file.display())]
    Twice {
        /// The file.
        file: PathBuf,
        /// The line of the second, from 1.
        line: u64,
        /// The name.
        name: String,
    },
    /// A parameter is out of its range.
    #[error("{name} is {value}; it must be {requirement}")]
    Parameter {
        /// The parameter.
        name: &'static str,
        /// Value of the parameter.
        value: f64,
        /// The requirement on the value.
        requirement: &'static str,
    },
    /// A pulse holds a number that is not finite.
    #[error("pulse {index}: {field} is {value}; it must be finite")]
    Pulse {
        /// Place of the pulse in the list.
        index: usize,
        /// The field.
        field: &'static str,
        /// Value of the field.
        value: f64,
    },
}

/// A table with a header.
struct Rows<'a> {
    file: &'a Path,
    columns: Vec<String>,
    rows: Vec<(u64, csv::StringRecord)>,
}

/// One line of it.
#[derive(Clone, Copy)]
struct Row<'a> {
    rows: &'a Rows<'a>,
    line: u64,
    record: &'a csv::StringRecord,
}

impl<'a> Rows<'a> {
    /// Reads the rows of a file: fields are separated by `,` or, where the header has one, by `;`.
    fn parse(file: &'a Path, bytes: &[u8]) -> Result<Self, TagError> {
        if let Some(rows) = Self::of_sensorgnome(file, bytes) {
            return Ok(rows);
        }
        let header = bytes.split(|byte| *byte == b'\n').next().unwrap_or_default();
        let delimiter = if header.contains(&b';') { b';' } else { b',' };
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(delimiter)
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .from_reader(bytes);
        let problem = |error: csv::Error| TagError::Line {
            file: file.to_owned(),
            line: error.position().map_or(1, csv::Position::line),
            problem: error.to_string(),
        };
        let header = reader.headers().map_err(problem)?;
        let columns = header.iter().map(|c| c.trim_start_matches('\u{feff}').to_owned()).collect();
        let mut rows = Vec::new();
        for record in reader.records() {
            let record = record.map_err(problem)?;
            rows.push((record.position().map_or(0, csv::Position::line), record));
        }
        Ok(Self { file, columns, rows })
    }

    /// The pulses in a SensorGnome's own file, which has lines of several kinds and no header:
    /// `p1,1435173846.6384,3.883,-49.09,-71.03` is a pulse of port 1 (Motus, "File formats").
    /// `None` for any other file.
    fn of_sensorgnome(file: &'a Path, bytes: &[u8]) -> Option<Self> {
        let text = std::str::from_utf8(bytes).ok()?;
        let cells = |line: &str| -> Option<csv::StringRecord> {
            let (kind, cells) = line.trim_end().split_once(',')?;
            let port = kind.strip_prefix(['p', 'T', 'G', 'S', 'C'])?;
            let is_port = port.bytes().all(|byte| byte.is_ascii_digit());
            let cells: csv::StringRecord = cells.split(',').take(4).collect();
            (is_port && cells.get(0)?.parse::<f64>().is_ok()).then_some(cells)
        };
        let first = || text.lines().filter(|line| !line.is_empty()).take(SENSORGNOME_LINES);
        let is_line = |line: &str| cells(line).is_some();
        if first().next().is_none() || !first().all(is_line) {
            return None;
        }
        let columns = SENSORGNOME_PULSE.map(str::to_owned).to_vec();
        let pulses = (1..).zip(text.lines()).filter(|(_, line)| line.starts_with('p'));
        // A damaged line is a row whose cells say so.
        let rows = pulses.map(|(number, line)| (number, cells(line).unwrap_or_default())).collect();
        Some(Self { file, columns, rows })
    }

    fn has(&self, columns: &[&str]) -> bool {
        columns.iter().all(|wanted| self.columns.iter().any(|column| column == wanted))
    }

    /// The error of a header that none of the readers knows.
    fn unknown(&self, wanted: &'static str) -> TagError {
        let columns = self.columns.join(", ");
        TagError::Header { file: self.file.to_owned(), columns, wanted }
    }

    fn iter(&'a self) -> impl Iterator<Item = Row<'a>> {
        self.rows.iter().map(|(line, record)| Row { rows: self, line: *line, record })
    }
}

impl<'a> Row<'a> {
    /// The text of a column; `None` if there is no such column or its field is empty.
    fn text(&self, column: &str) -> Option<&'a str> {
        let index = self.rows.columns.iter().position(|name| name == column)?;
        self.record.get(index).filter(|text| !text.is_empty())
    }

    /// An error in a column.
    fn error(&self, field: &str, requirement: &'static str) -> TagError {
        TagError::Field {
            file: self.rows.file.to_owned(),
            line: self.line,
            field: field.to_owned(),
            value: self.text(field).unwrap_or_default().to_owned(),
            requirement,
        }
    }

    /// A name that occurs twice.
    fn twice(&self, name: &str) -> TagError {
        TagError::Twice { file: self.rows.file.to_owned(), line: self.line, name: name.to_owned() }
    }

    /// A finite number.
    fn number(&self, column: &str) -> Result<f64, TagError> {
        let read = self.text(column).and_then(|text| text.parse::<f64>().ok());
        read.filter(|x| x.is_finite()).ok_or_else(|| self.error(column, "a finite number"))
    }

    /// A number above zero.
    fn positive(&self, column: &str) -> Result<f64, TagError> {
        let read = self.number(column).ok().filter(|x| *x > 0.0);
        read.ok_or_else(|| self.error(column, "a number above 0"))
    }

    /// A number above zero, or nothing.
    fn optional(&self, column: &str) -> Result<Option<f64>, TagError> {
        self.text(column).map(|_| self.positive(column)).transpose()
    }
}

/// The pulses of a file, in its order.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct PulseList {
    /// The program that wrote it.
    pub format: &'static str,
    /// The pulses.
    pub pulses: Vec<Pulse>,
    /// The entry of each pulse in a column `tags`, as `foxhunt tags --csv` writes it: empty for a
    /// pulse of no tag; `None` if there is no such column.
    pub tags: Option<Vec<String>>,
}

/// A tag that is known to be about.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct KnownTag {
    /// Name of the tag.
    pub name: String,
    /// The frequency of its carrier, in hertz, about the same reference as that of the pulses.
    pub frequency_hz: Option<f64>,
    /// Interval from pulse to pulse, or from burst to burst of a coded tag, in seconds.
    pub interval_s: f64,
    /// A second interval: that of mortality or activity, in seconds.
    pub other_interval_s: Option<f64>,
    /// Duration of a pulse, in seconds.
    pub width_s: Option<f64>,
    /// The gaps between the pulses of a coded tag's burst, in seconds; empty for an uncoded one.
    pub gaps_s: Vec<f64>,
}

impl KnownTag {
    /// An uncoded tag of unknown frequency and width.
    #[must_use]
    pub fn new(name: impl Into<String>, interval_s: f64) -> Self {
        Self {
            name: name.into(),
            frequency_hz: None,
            interval_s,
            other_interval_s: None,
            width_s: None,
            gaps_s: Vec::new(),
        }
    }

    /// Sets the frequency of its carrier, in hertz.
    #[must_use]
    pub fn with_frequency_hz(self, frequency_hz: f64) -> Self {
        Self { frequency_hz: Some(frequency_hz), ..self }
    }

    /// Sets the width of its pulses, in seconds.
    #[must_use]
    pub fn with_width_s(self, width_s: f64) -> Self {
        Self { width_s: Some(width_s), ..self }
    }

    /// Sets the second interval, in seconds.
    #[must_use]
    pub fn with_other_interval_s(self, other_interval_s: f64) -> Self {
        Self { other_interval_s: Some(other_interval_s), ..self }
    }

    /// Sets the gaps between the pulses of its bursts, in seconds.
    #[must_use]
    pub fn with_gaps_s(self, gaps_s: Vec<f64>) -> Self {
        Self { gaps_s, ..self }
    }

    /// Duration of a burst from its first pulse to its last, in seconds.
    #[must_use]
    pub fn burst_s(&self) -> f64 {
        self.gaps_s.iter().sum()
    }
}

/// The tags that are known to be about.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct TagTable {
    tags: Vec<KnownTag>,
}

impl TagTable {
    /// A table of these tags.
    #[must_use]
    pub fn new(tags: Vec<KnownTag>) -> Self {
        Self { tags }
    }

    /// Reads a table.
    ///
    /// - foxhunt: `name, interval_s`, and where they are known `frequency_hz, width_s, gaps_ms,
    ///   other_interval_s`; the gaps of a burst are separated by spaces;
    /// - SensorGnome: `tagID, nomFreq` (MHz), `offsetFreq` (kHz), `period` (s), `pulseLen` (ms),
    ///   `param1` to `param3` (gaps in ms). Its frequencies are left out: the pulses of such a
    ///   receiver are about a centre that its files do not hold.
    ///
    /// # Errors
    ///
    /// If the file cannot be read, its columns are neither, a field is not what it must be, or a
    /// name occurs twice.
    pub fn read(file: &Path) -> Result<Self, TagError> {
        Self::parse(file, &bytes_of(file)?)
    }

    /// Reads the bytes of a table; errors name `file`.
    ///
    /// # Errors
    ///
    /// The errors of [`TagTable::read`].
    pub fn parse(file: &Path, bytes: &[u8]) -> Result<Self, TagError> {
        let rows = Rows::parse(file, bytes)?;
        let read = if rows.has(&["name", "interval_s"]) {
            own_tag
        } else if rows.has(&["tagID", "nomFreq", "period", "pulseLen", "param1"]) {
            sensorgnome_tag
        } else {
            return Err(rows.unknown(TAGS));
        };
        let mut tags: Vec<KnownTag> = Vec::new();
        for row in rows.iter() {
            let tag = read(&row)?;
            if tags.iter().any(|other| other.name == tag.name) {
                return Err(row.twice(&tag.name));
            }
            tags.push(tag);
        }
        Ok(Self { tags })
    }

    /// The tags, in the table's order.
    #[must_use]
    pub fn tags(&self) -> &[KnownTag] {
        &self.tags
    }
}

/// Reads the bytes of a file.
fn bytes_of(file: &Path) -> Result<Vec<u8>, TagError> {
    let wrong = |source| TagError::Read { file: file.to_owned(), source };
    let bytes = fs::read(file).map_err(wrong)?;
    if !bytes.starts_with(&GZIP) {
        return Ok(bytes);
    }
    let mut held = Vec::new();
    MultiGzDecoder::new(bytes.as_slice()).read_to_end(&mut held).map_err(wrong)?;
    Ok(held)
}

/// Reads a list of pulses; its header shows which program wrote it.
///
/// - foxhunt: `time_s, frequency_hz, width_s, power_dbm, snr_db`, separated by commas;
/// - SensorGnome: its own file, compressed with gzip or not, or a table with `time_unix_s,
///   dfreq_kHz, sig_dB, noise_dB`; frequencies are relative to the receiver's centre, widths are
///   the 2.5 ms that its detector searches for;
/// - pyradiotracking: separated by semicolons, times in UTC with a date.
///
/// The ratios of the latter two are powers in their own bandwidths. As E/N0 they would be off by a
/// constant; nothing here depends on one.
///
/// # Errors
///
/// If the file cannot be read, no program is known by its header, or a field is not what it must
/// be, with line, field and value.
pub fn read_pulses(file: &Path) -> Result<PulseList, TagError> {
    parse_pulses(file, &bytes_of(file)?)
}

/// Reads the bytes of a list of pulses; errors name `file`.
///
/// # Errors
///
/// The errors of [`read_pulses`].
pub fn parse_pulses(file: &Path, bytes: &[u8]) -> Result<PulseList, TagError> {
    type Read = fn(&Row<'_>) -> Result<Pulse, TagError>;
    let rows = Rows::parse(file, bytes)?;
    let readers: [(&str, &[&str], Read); 3] = [
        ("foxhunt", &["time_s", "frequency_hz", "width_s", "power_dbm", "snr_db"], own_pulse),
        ("sensorgnome", &SENSORGNOME_PULSE, sensorgnome_pulse),
        (
            "pyradiotracking",
            &["Time", "Frequency", "Duration", "avg (dBW)", "snr (dB)"],
            pyradio_pulse,
        ),
    ];
    let known = readers.into_iter().find(|(_, columns, _)| rows.has(columns));
    let (format, _, read) = known.ok_or_else(|| rows.unknown(PULSES))?;
    let pulses = rows.iter().map(|row| read(&row)).collect::<Result<_, _>>()?;
    let tag = |row: Row<'_>| row.text("tags").unwrap_or_default().to_owned();
    let tags = rows.has(&["tags"]).then(|| rows.iter().map(tag).collect());
    Ok(PulseList { format, pulses, tags })
}

fn own_pulse(row: &Row<'_>) -> Result<Pulse, TagError> {
    Ok(Pulse::new(
        row.number("time_s")?,
        row.number("frequency_hz")?,
        row.positive("width_s")?,
        row.number("power_dbm")?,
        row.number("snr_db")?,
    ))
}

fn sensorgnome_pulse(row: &Row<'_>) -> Result<Pulse, TagError> {
    let power = row.number("sig_dB")?;
    Ok(Pulse::new(
        row.number("time_unix_s")?,
        1e3 * row.number("dfreq_kHz")?,
        SENSORGNOME_WIDTH_S,
        power,
        power - row.number("noise_dB")?,
    ))
}

fn pyradio_pulse(row: &Row<'_>) -> Result<Pulse, TagError> {
    let time = row.text("Time");
    let time = time.and_then(|t| DateTime::parse_from_str(t, "%Y-%m-%d %H:%M:%S%.f%:z").ok());
    let time = time.ok_or_else(|| row.error("Time", "a date and time with its offset from UTC"))?;
    let width = row.positive("Duration")?;
    // The time is that of the beginning.
    let begin = seconds(time.timestamp()) + f64::from(time.timestamp_subsec_micros()) * 1e-6;
    Ok(Pulse::new(
        begin + 0.5 * width,
        row.number("Frequency")?,
        width,
        // From dBW.
        row.number("avg (dBW)")? + 30.0,
        row.number("snr (dB)")?,
    ))
}

#[expect(clippy::cast_precision_loss, reason = "seconds of any year are below 2^53")]
fn seconds(whole: i64) -> f64 {
    whole as f64
}

fn own_tag(row: &Row<'_>) -> Result<KnownTag, TagError> {
    let name = row.text("name").ok_or_else(|| row.error("name", "a name"))?;
    let gap = |text: &str| text.parse::<f64>().ok().filter(|gap| gap.is_finite() && *gap > 0.0);
    let gaps: Option<Vec<f64>> =
        row.text("gaps_ms").unwrap_or_default().split_whitespace().map(gap).collect();
    let gaps = gaps.ok_or_else(|| row.error("gaps_ms", "numbers above 0 between spaces"))?;
    let frequency = row.text("frequency_hz").map(|_| row.number("frequency_hz")).transpose()?;
    Ok(KnownTag {
        name: name.to_owned(),
        frequency_hz: frequency,
        interval_s: row.positive("interval_s")?,
        other_interval_s: row.optional("other_interval_s")?,
        width_s: row.optional("width_s")?,
        gaps_s: gaps.iter().map(|gap| 1e-3 * gap).collect(),
    })
}

fn sensorgnome_tag(row: &Row<'_>) -> Result<KnownTag, TagError> {
    let name = row.text("tagID").ok_or_else(|| row.error("tagID", "a name"))?;
    let gaps = ["param1", "param2", "param3"].map(|column| row.optional(column));
    let mut gaps_s = Vec::new();
    for gap in gaps {
        gaps_s.extend(gap?.map(|gap| 1e-3 * gap));
    }
    let tag = KnownTag::new(name, row.positive("period")?);
    Ok(tag.with_width_s(1e-3 * row.positive("pulseLen")?).with_gaps_s(gaps_s))
}
