//! Complex samples of a receiver, from files and streams, in chunks that know their place in time.

mod error;
mod format;
mod open;
mod sigmf;
mod source;

pub use error::SampleError;
pub use format::SampleFormat;
pub use open::{OpenOptions, open};
pub use sigmf::SigMf;
pub use source::SampleSource;
