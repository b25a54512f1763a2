//! From a turn of the antenna to a level and a bearing.

#[cfg(feature = "alloc")]
mod looks;
mod pattern;
mod pritzl2018;

#[cfg(feature = "alloc")]
pub use looks::{
    CrossCorrelation, CrossCorrelationConfig, FirstHarmonic, MainLobeFit, Maximum,
    MaximumLikelihood, MaximumLikelihoodConfig, Residuals, StationAntenna, StationModel,
    StationPattern,
};
pub use pattern::{Cell, Pattern, resultant_confidence};
pub use pritzl2018::Pritzl2018;

#[cfg(feature = "alloc")]
pub(crate) use looks::{LOST, TAIL, lobe_db, log_student, normal_cdf};
