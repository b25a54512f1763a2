//! A source with an omnidirectional antenna, which needs no turn.

mod config;
mod error;
mod source;

pub use config::OmnidirectionalConfig;
pub use error::OmnidirectionalError;
pub use source::OmnidirectionalSource;
