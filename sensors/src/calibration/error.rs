use foxhunt_core::parameter::ParameterError;

/// Reason that nothing can be calibrated from the points.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// The parameters and a residual need more points.
    #[error("there are {points} points to calibrate from; at least {needed} are needed")]
    TooFew {
        /// Number of points.
        points: usize,
        /// Number of points that are needed.
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
        /// Index of the point, from 0.
        index: usize,
        /// The range, in metres.
        range: f64,
    },
    /// A power is NaN or infinite.
    #[error("the power of point {index} is {rss_dbm} dBm, not a finite number")]
    Rss {
        /// Index of the point, from 0.
        index: usize,
        /// The power, in dBm.
        rss_dbm: f64,
    },
    /// The bound on the exponent is not a positive number.
    #[error("the bound on the exponent is {bound}, not a positive number")]
    Bound {
        /// The bound.
        bound: f64,
    },
    /// A bearing, a heading, an error or a σ is out of its range.
    #[error("the {field} of point {index} is {value}, not {requirement}")]
    Field {
        /// Index of the point, from 0.
        index: usize,
        /// Name of the field.
        field: &'static str,
        /// Value of the field.
        value: f64,
        /// The requirement that the value does not meet.
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
    /// The fitted parameters make no station.
    #[error("the station: {0}")]
    Station(ParameterError),
}
