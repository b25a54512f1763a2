//! An antenna that is fixed to a body, which turns as a whole.

mod config;
mod error;
mod source;

pub use config::BodyConfig;
pub use error::BodyError;
pub use source::BodySource;
