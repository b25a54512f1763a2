//! From a turn of the antenna to a level and a bearing.

mod cell;
mod confidence;
#[cfg(feature = "alloc")]
mod direct;
#[cfg(feature = "alloc")]
mod likelihood;
mod pattern;
mod pritzl2018;
mod rounding;
#[cfg(feature = "alloc")]
mod station;

pub use cell::Cell;
pub use confidence::resultant_confidence;
#[cfg(feature = "alloc")]
pub use direct::{FirstHarmonic, MainLobeFit, Maximum};
#[cfg(feature = "alloc")]
pub use likelihood::{CrossCorrelation, MaximumLikelihood, Residuals};
pub use pattern::Pattern;
pub use pritzl2018::Pritzl2018;
#[cfg(feature = "alloc")]
pub use station::{StationAntenna, StationModel, StationPattern};

#[cfg(feature = "alloc")]
pub(crate) use likelihood::normal_cdf;
#[cfg(feature = "alloc")]
use pattern::check;
#[cfg(feature = "alloc")]
pub(crate) use station::{LOST, TAIL, lobe_db};
