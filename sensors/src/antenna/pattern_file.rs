//! Antennas in files: reading and writing of CSV tables, and the faults that a file may have.

use alloc::{
    format,
    string::{String, ToString},
    vec::Vec,
};

use crate::{PatternTable, PatternTable3d, PatternTableError};

const CORNER: &str = "elevation_deg\\azimuth_deg";

/// A gain that is given again a turn later may be rounded otherwise, in dB.
const CLOSING_DB: f64 = 0.05;

/// Angles that are given to a few decimals, in degrees.
const ROUNDING_DEG: f64 = 1e-6;

/// Reason for refusing the text of an antenna file, and its line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("line {line}: {reason}")]
pub struct PatternFileError {
    /// The line, from 1; the last one for anything missing at the end.
    pub line: usize,
    /// The fault in the line.
    pub reason: PatternFileReason,
}

/// Fault in a line of an antenna file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PatternFileReason {
    /// The first line is the header of no known layout.
    #[error(
        "the header is {found:?}; a table begins with \"angle_deg,gain_db\", one over azimuth and \
         elevation with \"elevation_deg\\azimuth_deg,…\""
    )]
    Header {
        /// The header.
        found: String,
    },
    /// A field holds no finite number.
    #[error("the {field} is {value:?}, not a finite number")]
    NotANumber {
        /// Name of the field.
        field: &'static str,
        /// Text of the field.
        value: String,
    },
    /// A line has too few or too many fields.
    #[error("there are {found} fields where {expected} are needed")]
    Fields {
        /// Number of fields.
        found: usize,
        /// Number of fields that are needed.
        expected: usize,
    },
    /// Angles neither rise nor fall throughout.
    #[error("the angle {angle}° is out of order")]
    Order {
        /// The angle in degrees.
        angle: f64,
    },
    /// Angles go beyond the turn.
    #[error("the angle {angle}° is beyond the turn")]
    Turn {
        /// The angle in degrees.
        angle: f64,
    },
    /// A table closes on a gain that is not its first.
    #[error("a turn after the first angle the gain is {gain} dB, not {first} dB as there")]
    Closing {
        /// The last gain in dB.
        gain: f64,
        /// The first one.
        first: f64,
    },
    /// An attenuation is below zero: a gain above the maximum.
    #[error("the attenuation is {value} dB; it counts down from the maximum and is not negative")]
    Attenuation {
        /// The attenuation in dB.
        value: f64,
    },
    /// The gain of an MSI file has no unit that is known.
    #[error("the gain {value:?} needs a unit, dBi or dBd")]
    Unit {
        /// Text of the field.
        value: String,
    },
    /// A field or a section is missing.
    #[error("{name} is missing")]
    Missing {
        /// Name of the field or the section.
        name: &'static str,
    },
    /// A field or a section stands there twice.
    #[error("{name} appears twice")]
    Twice {
        /// Name of the field or the section.
        name: String,
    },
    /// A section has another number of rows than it declares.
    #[error("{section} has {found} rows, not {declared} as it declares")]
    Rows {
        /// The section.
        section: &'static str,
        /// Number of its rows.
        found: usize,
        /// Number of rows that it declares.
        declared: usize,
    },
    /// The rows make no pattern.
    #[error(transparent)]
    Table(PatternTableError),
}

impl PatternFileReason {
    pub(super) fn at(self, line: usize) -> PatternFileError {
        PatternFileError { line, reason: self }
    }
}

impl PatternTable {
    /// Reads the columns `angle_deg,gain_db`: degrees off boresight, counter-clockwise from
    /// above, rising or falling, and dB. A row that gives the first one again a turn later is left
    /// out.
    ///
    /// # Errors
    ///
    /// [`PatternFileError`] names the line and what is wrong with it.
    pub fn from_csv(text: &str) -> Result<Self, PatternFileError> {
        let mut lines = lines(text);
        let (line, header) = lines.next().unwrap_or((1, ""));
        let names: Vec<&str> = header.split(',').map(str::trim).collect();
        if names != ["angle_deg", "gain_db"] {
            return Err(PatternFileReason::Header { found: header.into() }.at(line));
        }
        let mut rows = Vec::new();
        let mut last = line;
        for (line, row) in lines {
            let fields: Vec<&str> = row.split(',').collect();
            let [angle, gain] = fields[..] else {
                return Err(PatternFileReason::Fields { found: fields.len(), expected: 2 }.at(line));
            };
            rows.push((line, number(line, "angle_deg", angle)?, number(line, "gain_db", gain)?));
            last = line;
        }
        turn(rows, last)
    }

    /// Writes it as text: a row for each of the table's, in degrees to nine decimals.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let row = |(angle, gain): (f64, f64)| format!("{},{gain}\n", rounded(angle.to_degrees()));
        core::iter::once("angle_deg,gain_db\n".to_string()).chain(self.rows().map(row)).collect()
    }
}

impl PatternTable3d {
    /// Reads a table over azimuth and elevation: the first line `elevation_deg\azimuth_deg` and the
    /// azimuths, counter-clockwise from above; each further line an elevation and the gains
    /// in dBi there. Both may rise or fall; a column that gives the first one again a turn later is
    /// left out.
    ///
    /// # Errors
    ///
    /// [`PatternFileError`] names the line and what is wrong with it.
    pub fn from_csv(text: &str) -> Result<Self, PatternFileError> {
        let mut lines = lines(text);
        let (first, header) = lines.next().unwrap_or((1, ""));
        let Some((CORNER, azimuths)) = header.split_once(',') else {
            return Err(PatternFileReason::Header { found: header.into() }.at(first));
        };
        let azimuths = azimuths.split(',').map(|text| number(first, "azimuth", text));
        let azimuths = azimuths.collect::<Result<Vec<_>, _>>()?;
        let mut rows: Vec<(usize, f64, PatternTable)> = Vec::new();
        let mut last = first;
        for (line, row) in lines {
            let mut fields = row.split(',');
            let elevation = number(line, "elevation", fields.next().unwrap_or(""))?;
            let gains = fields.map(|text| number(line, "gain", text));
            let gains = gains.collect::<Result<Vec<_>, _>>()?;
            if gains.len() != azimuths.len() {
                let found = gains.len() + 1;
                let expected = azimuths.len() + 1;
                return Err(PatternFileReason::Fields { found, expected }.at(line));
            }
            let cells = azimuths.iter().zip(gains).map(|(angle, gain)| (line, *angle, gain));
            rows.push((line, elevation, turn(cells.collect(), line)?));
            last = line;
        }
        in_order(rows.iter().map(|(line, elevation, _)| (*line, *elevation)))?;
        if rows.first().zip(rows.last()).is_some_and(|(a, b)| a.1 > b.1) {
            rows.reverse();
        }
        let rows = rows.into_iter().map(|(_, elevation, row)| (elevation.to_radians(), row));
        Self::from_rows(rows.collect()).map_err(|error| PatternFileReason::Table(error).at(last))
    }
}

/// The lines that hold anything, counted from 1.
pub(super) fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    // Some editors begin a file with a mark.
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    text.lines().enumerate().map(|(i, line)| (i + 1, line.trim())).filter(|(_, l)| !l.is_empty())
}

/// Degrees without the rounding of the way through radians.
fn rounded(degrees: f64) -> f64 {
    libm::round(degrees * 1e9) / 1e9
}

/// A turn of (line, degrees, dB), rising or falling, with or without its first row at the end
/// again.
fn turn(mut rows: Vec<(usize, f64, f64)>, last: usize) -> Result<PatternTable, PatternFileError> {
    in_order(rows.iter().map(|(line, angle, _)| (*line, *angle)))?;
    if let [(_, from, first), .., (line, to, gain)] = rows[..] {
        let beyond = (to - from).abs() - 360.0;
        if beyond > ROUNDING_DEG {
            return Err(PatternFileReason::Turn { angle: to }.at(line));
        }
        if beyond > -ROUNDING_DEG {
            if (gain - first).abs() > CLOSING_DB {
                return Err(PatternFileReason::Closing { gain, first }.at(line));
            }
            rows.pop();
        }
        if from > to {
            rows.reverse();
        }
    }
    let rows: Vec<_> = rows.iter().map(|(_, angle, gain)| (angle.to_radians(), *gain)).collect();
    PatternTable::from_rows(&rows).map_err(|error| PatternFileReason::Table(error).at(last))
}

/// Checks that angles rise or fall throughout.
fn in_order(angles: impl Iterator<Item = (usize, f64)>) -> Result<(), PatternFileError> {
    let mut before: Option<f64> = None;
    let mut rising: Option<bool> = None;
    for (line, angle) in angles {
        if let Some(before) = before {
            let rises = angle > before;
            if rising.is_some_and(|rising| rising != rises) || (angle - before).abs() < ROUNDING_DEG
            {
                return Err(PatternFileReason::Order { angle }.at(line));
            }
            rising = Some(rises);
        }
        before = Some(angle);
    }
    Ok(())
}

/// The finite number in `text`.
pub(super) fn number(
    line: usize,
    field: &'static str,
    text: &str,
) -> Result<f64, PatternFileError> {
    let read = text.trim().parse::<f64>().ok().filter(|value| value.is_finite());
    read.ok_or_else(|| PatternFileReason::NotANumber { field, value: text.trim().into() }.at(line))
}
