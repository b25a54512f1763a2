/// Why no law of propagation can be had from the points.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// Two parameters and a residual need three points.
    #[error("there are {points} points to calibrate from; at least {needed} are needed")]
    TooFew {
        /// How many there are.
        points: usize,
        /// How many are needed.
        needed: usize,
    },
    /// All points lie at one range: power and exponent cannot be told apart.
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
}
