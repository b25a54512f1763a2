mod cloud;
mod estimator;
mod filter;
mod resampling;

pub use filter::ParticleFilter;
pub use resampling::Resampling;
