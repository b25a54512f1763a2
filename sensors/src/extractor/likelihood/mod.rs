//! A turn laid against an antenna whose gain is known.

mod fit;
mod gain_table;
mod gaussian;
mod looks;
mod maximum_likelihood;
mod misfit;
mod posterior;
mod read_out;
mod silence;

pub use maximum_likelihood::MaximumLikelihood;

pub(in crate::extractor) use posterior::{Node, Peak, peaks};
pub(crate) use silence::normal_cdf;
