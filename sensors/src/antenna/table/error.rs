/// Why rows make no antenna pattern.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PatternTableError {
    /// A turn cannot be read from so few rows.
    #[error("the antenna pattern has {rows} rows; it needs at least {needed}")]
    TooFew {
        /// How many there are.
        rows: usize,
        /// How many are needed.
        needed: usize,
    },
    /// A number is NaN or infinite.
    #[error("row {row} of the antenna pattern has the {field} {value}, not a finite number")]
    NotFinite {
        /// Which row, from 0.
        row: usize,
        /// Which of its fields.
        field: &'static str,
        /// What it held.
        value: f64,
    },
    /// A gain is beyond what any antenna has.
    #[error(
        "row {row} of the antenna pattern has the gain {gain} dB; it must be within ±{limit} dB"
    )]
    Gain {
        /// Which row, from 0.
        row: usize,
        /// Its gain in dB.
        gain: f64,
        /// The largest that is taken.
        limit: f64,
    },
    /// An elevation is beyond the poles.
    #[error("the elevation {elevation} rad in row {row} of the antenna pattern is beyond a pole")]
    Elevation {
        /// Which row, from 0.
        row: usize,
        /// Its elevation in radians.
        elevation: f64,
    },
    /// The angles do not increase, or by less than the least step.
    #[error("the angle {angle} rad in row {row} of the antenna pattern does not exceed the last")]
    Order {
        /// Which row, from 0.
        row: usize,
        /// Its angle.
        angle: f64,
    },
    /// The angles span a turn or more, so that the last row repeats the first.
    #[error("the antenna pattern spans {span} rad; it must stay below a turn")]
    Span {
        /// From the first angle to the last, in radians.
        span: f64,
    },
}
