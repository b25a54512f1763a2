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
    /// The angles do not increase.
    #[error("the angle {angle} rad in row {row} of the antenna pattern does not exceed the last")]
    Order {
        /// Which row, from 0.
        row: usize,
        /// Its angle.
        angle: f64,
    },
    /// The angles span a turn or more, so that the last row says again what the first says.
    #[error("the antenna pattern spans {span} rad; it must stay below a turn")]
    Span {
        /// From the first angle to the last, in radians.
        span: f64,
    },
}
