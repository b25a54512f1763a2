//! A turn laid against an antenna whose gain is known.

mod amplitude_table;
mod cross_correlation;
mod fading;
mod fit;
mod gain_table;
mod gaussian;
mod judge;
mod looks;
mod maximum_likelihood;
mod misfit;
mod posterior;
mod read_out;
mod reflection;
mod residuals;
mod silence;
mod student;
mod two_paths;

pub(super) use looks::{Look, Looks};

pub use cross_correlation::CrossCorrelation;
pub use maximum_likelihood::MaximumLikelihood;
pub use residuals::Residuals;

pub(in crate::extractor) use posterior::{Node, Peak, peaks, summit};
pub(crate) use silence::normal_cdf;
