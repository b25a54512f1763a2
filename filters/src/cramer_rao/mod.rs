mod bound;
mod error;
mod fisher;

pub use bound::PosteriorCramerRao;
pub use error::CramerRaoError;
pub use fisher::FisherQuadrature;
