use crate::PatternTableError;

/// Why no pattern can be learned from recorded turns.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LearnPatternError {
    /// A number is NaN or infinite.
    #[error("turn {turn} has the {field} {value}, not a finite number")]
    NotFinite {
        /// Which turn, from 0.
        turn: usize,
        /// What it is.
        field: &'static str,
        /// What it held.
        value: f64,
    },
    /// There are too few directions to fit anything to.
    #[error("{directions} directions have readings; at least {needed} are needed")]
    TooFew {
        /// How many positions with a reading there are in all turns together.
        directions: usize,
        /// How many are needed.
        needed: usize,
    },
    /// Too wide a sector has no reading in any of the turns.
    #[error(
        "no readings over {gap_deg:.1}° off boresight on; at most {limit_deg:.1}° may be \
         missing"
    )]
    Gap {
        /// How wide the widest sector without a reading is, in degrees.
        gap_deg: f64,
        /// How wide it may be.
        limit_deg: f64,
    },
    /// The level does not depend on the direction, as far as the noise lets see.
    #[error("the turns show no direction: a flat pattern explains them best")]
    Flat,
    /// The levels swing by more than an antenna's can.
    #[error("the fitted pattern is no antenna's: {0}")]
    Pattern(#[from] PatternTableError),
}
