use foxhunt_core::parameter::ParameterError;

/// Reason that readings were not turned into a place.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ShadowingGridError {
    /// A setting is outside of its range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// A reading's value is NaN or infinite.
    #[error("reading {index} has the value {value}")]
    Value {
        /// Index of the reading, from 0.
        index: usize,
        /// Value of the reading.
        value: f64,
    },
    /// A reading's receiver pose holds NaN or infinity.
    #[error("the pose of reading {index} is not finite")]
    Receiver {
        /// Index of the reading, from 0.
        index: usize,
    },
    /// Too few places: below three, levels tell nothing of the target's.
    #[error("levels were received at too few places, {segments}: levels from 3 are needed")]
    TooFew {
        /// The number of segments that the readings made.
        segments: usize,
    },
    /// All readings were taken above one place; their values hold nothing about another.
    #[error(
        "the receiver did not move: all levels are from ({east}, {north}) m, and from one place \
         they hold nothing about another"
    )]
    OnePlace {
        /// East of the place, in metres.
        east: f64,
        /// North of the place, in metres.
        north: f64,
    },
    /// The readings' correlation matrix has no Cholesky factor: places coincide and the nugget
    /// is 0.
    #[error("the correlation matrix at {length_m} m is not positive definite")]
    Correlation {
        /// The correlation length in metres.
        length_m: f64,
    },
    /// No cell has a finite likelihood: the regressor is finite nowhere, or a number overflowed.
    #[error("the posterior is finite on none of {cells} cells")]
    Posterior {
        /// Number of cells tried.
        cells: usize,
    },
}
