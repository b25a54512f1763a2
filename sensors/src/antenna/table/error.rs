/// Reason that rows make no antenna pattern.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PatternTableError {
    /// A turn cannot be read from so few rows.
    #[error("the antenna pattern has {rows} rows; it needs at least {needed}")]
    TooFew {
        /// Number of rows.
        rows: usize,
        /// Number of rows that are needed.
        needed: usize,
    },
    /// A number is NaN or infinite.
    #[error("row {row} of the antenna pattern has the {field} {value}, not a finite number")]
    NotFinite {
        /// Index of the row, from 0.
        row: usize,
        /// Name of its field.
        field: &'static str,
        /// Value of the field.
        value: f64,
    },
    /// A gain is beyond what any antenna has.
    #[error(
        "row {row} of the antenna pattern has the gain {gain} dB; it must be within ±{limit} dB"
    )]
    Gain {
        /// Index of the row, from 0.
        row: usize,
        /// Its gain in dB.
        gain: f64,
        /// The largest that is taken.
        limit: f64,
    },
    /// An elevation is beyond the poles.
    #[error("the elevation {elevation} rad in row {row} of the antenna pattern is beyond a pole")]
    Elevation {
        /// Index of the row, from 0.
        row: usize,
        /// Its elevation in radians.
        elevation: f64,
    },
    /// The angles do not increase, or by less than the least step.
    #[error("the angle {angle} rad in row {row} of the antenna pattern does not exceed the last")]
    Order {
        /// Index of the row, from 0.
        row: usize,
        /// Its angle.
        angle: f64,
    },
    /// The angles span a turn or more, so that the last row repeats the first.
    #[error("the antenna pattern spans {span} rad; it must stay below a turn")]
    Span {
        /// Angle from the first row to the last, in radians.
        span: f64,
    },
}
