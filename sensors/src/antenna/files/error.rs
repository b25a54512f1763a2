use alloc::string::String;

use crate::PatternTableError;

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
        /// Its name.
        name: &'static str,
    },
    /// A field or a section stands there twice.
    #[error("{name} stands there twice")]
    Twice {
        /// Its name.
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
