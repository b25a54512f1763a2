//! Pulses given to the tags that sent them.
//!
//! [`read_pulses`] reads what detectors wrote, [`TagTable`] holds the tags that are known, and
//! [`associate`] finds the trains: coded bursts by their gaps, other known tags by frequency, width
//! and interval, and unknown ones, whose intervals the [`IntervalTransform`] proposes. Everything
//! is searched first and associated afterwards; nothing is listened for in predicted windows.

mod associate;
mod clutter;
mod coded;
mod codes;
mod config;
mod error;
mod known;
mod pulses;
mod row;
mod train;
mod transform;

pub use associate::{Association, Tag, associate};
pub use config::AssociationConfig;
pub use error::TagError;
pub use known::{KnownTag, TagTable};
pub use pulses::{PulseList, parse_pulses, read_pulses};
pub use transform::{IntervalPeak, IntervalTransform};
