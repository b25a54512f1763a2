//! Antennas in files: CSV tables, and the MSI Planet files of vendors.

mod csv;
mod error;
mod msi;
mod msi_text;
mod number;

pub use error::{PatternFileError, PatternFileReason};
pub use msi::{MsiFile, MsiUnit};

use number::number;
