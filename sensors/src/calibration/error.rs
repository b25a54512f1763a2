use foxhunt_core::parameter::ParameterError;

/// Why nothing can be calibrated from the points.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// The parameters and a residual need more points.
    #[error("there are {points} points to calibrate from; at least {needed} are needed")]
    TooFew {
        /// How many there are.
        points: usize,
        /// How many are needed.
        needed: usize,
    },
    /// All points lie at one range: power and exponent cannot be separated.
    #[error("all points lie at {range} m; the exponent needs different ranges")]
    OneRange {
        /// That range, in metres.
        range: f64,
    },
    /// A range is not a positive number.
    #[error("the range of point {index} is {range} m, not a positive number")]
    Range {
        /// Which point, from 0.
        index: usize,
        /// What it held.
        range: f64,
    },
    /// A power is NaN or infinite.
    #[error("the power of point {index} is {rss_dbm} dBm, not a finite number")]
    Rss {
        /// Which point, from 0.
        index: usize,
        /// What it held.
        rss_dbm: f64,
    },
    /// The bound on the exponent is not a positive number.
    #[error("the bound on the exponent is {bound}, not a positive number")]
    Bound {
        /// What it was.
        bound: f64,
    },
    /// A bearing, a heading, an error or a σ is out of its range.
    #[error("the {field} of point {index} is {value}, not {requirement}")]
    Field {
        /// Which point, from 0.
        index: usize,
        /// Which of its numbers.
        field: &'static str,
        /// What it held.
        value: f64,
        /// What it must be.
        requirement: &'static str,
    },
    /// The bearings' errors cancel: they single out no offset.
    #[error("the bearings' errors single out no offset (resultant length {resultant:.3})")]
    Scattered {
        /// Their mean resultant length, from 0 (none) to 1 (sharp).
        resultant: f64,
    },
    /// The headings are too much alike for an offset that depends on them.
    #[error("the headings span too little of the circle to fit how the offset depends on them")]
    Headings,
    /// All errors are 0, or rounding beside their σ: there is no scale to find.
    #[error("the errors are nothing beside their standard deviations, which have no scale then")]
    NoError,
    /// What was fitted is no station.
    #[error("the station: {0}")]
    Station(ParameterError),
}
