//! An antenna that hears alike from everywhere, and so needs no turn.

mod config;
mod error;
mod source;

pub use config::OmnidirectionalConfig;
pub use error::OmnidirectionalError;
pub use source::OmnidirectionalSource;
