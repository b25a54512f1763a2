use crate::PatternTableError;

/// Reason that no pattern can be learned from recorded turns.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LearnPatternError {
    /// A number is NaN or infinite.
    #[error("turn {turn} has the {field} {value}, not a finite number")]
    NotFinite {
        /// Index of the turn, from 0.
        turn: usize,
        /// Name of the field.
        field: &'static str,
        /// Value of the field.
        value: f64,
    },
    /// There are too few directions to fit anything to.
    #[error("{directions} directions have readings; at least {needed} are needed")]
    TooFew {
        /// Number of positions with a reading, in all turns together.
        directions: usize,
        /// Number of positions that are needed.
        needed: usize,
    },
    /// Too wide a sector has no reading in any of the turns.
    #[error(
        "no readings over {gap_deg:.1}° off boresight on; at most {limit_deg:.1}° may be \
         missing"
    )]
    Gap {
        /// Width of the widest sector without a reading, in degrees.
        gap_deg: f64,
        /// Largest width that is allowed, in degrees.
        limit_deg: f64,
    },
    /// The level does not depend on the direction, as far as the noise lets see.
    #[error("the turns show no direction: a flat pattern explains them best")]
    Flat,
    /// The levels swing by more than an antenna's can.
    #[error("the fitted pattern is no antenna's: {0}")]
    Pattern(#[from] PatternTableError),
}
