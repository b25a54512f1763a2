//! Localisation by lines of bearing.

mod grid;
mod lenth1981;
mod line;
mod linear;
mod moments;
mod repeated_median;
mod weights;

pub use grid::{BearingGrid, BearingGridFix, CommonErrors, StationError};
pub use lenth1981::{BearingFix, Lenth1981};
pub use line::BearingLine;
pub use linear::{instrumental_variables, pseudolinear, stansfield};
pub use repeated_median::{RepeatedMedianFix, repeated_median};
pub use weights::BearingWeights;
