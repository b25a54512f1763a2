use foxhunt_core::parameter::ParameterError;

/// Reason that there is no sweep.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CoverageError {
    /// A spacing, the margin or the direction is out of its range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// Fewer corners than an area has.
    #[error("{corners} corners make no area; it takes 3")]
    Corners {
        /// Number of corners.
        corners: usize,
    },
    /// A corner holds NaN or infinity.
    #[error("the corner ({east}, {north}) m is not finite")]
    NotFinite {
        /// Its East.
        east: f64,
        /// Its North.
        north: f64,
    },
    /// Two sides meet elsewhere than in a corner.
    #[error("side {first} of the area meets side {second}; sides are counted from 0")]
    Crossing {
        /// One side, from the corner of this number to the next.
        first: usize,
        /// The other one.
        second: usize,
    },
    /// The area is too small for the margin.
    #[error("no place in the area is {margin_m} m from its sides")]
    NoRoom {
        /// The margin.
        margin_m: f64,
    },
}
