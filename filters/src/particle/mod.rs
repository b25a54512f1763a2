mod cloud;
mod estimator;
mod filter;
mod kernel;
mod kld;
mod marginal;
mod moments;
mod progressive;
mod rao_blackwellised;
mod rao_blackwellised_estimator;
mod reinitialise;
mod resampling;
mod step;
mod white;

pub use filter::ParticleFilter;
pub use kld::KldSampling;
pub use rao_blackwellised::RaoBlackwellised;
pub use resampling::Resampling;
