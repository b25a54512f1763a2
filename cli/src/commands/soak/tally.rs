use std::any::Any;

use foxhunt::soak::SoakFailure;

/// Counts and failures of one run.
#[derive(Debug, Default)]
pub(super) struct Tally {
    pub(super) kind: Kind,
    pub(super) refused: bool,
    pub(super) searches: u64,
    pub(super) estimates: u64,
    pub(super) replayed: u64,
    pub(super) log_bytes: u64,
    /// Places that were found in a recording.
    pub(super) located: u64,
    pub(super) failures: Vec<SoakFailure>,
}

/// Kind of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Kind {
    /// A simulated flight.
    #[default]
    Flight,
    /// A flight of emulated devices.
    #[cfg(all(unix, feature = "hardware"))]
    Devices,
    /// A recording that could be read, or not.
    Recording {
        /// True if it could be read.
        is_read: bool,
    },
}

impl Kind {
    /// Returns the kind that a seed draws: a recording one time in four, and emulated devices, whose
    /// flights take longest, one time in eight.
    pub(super) fn of(seed: u64) -> Self {
        match seed % 8 {
            0 | 4 => Self::Recording { is_read: false },
            #[cfg(all(unix, feature = "hardware"))]
            7 => Self::Devices,
            _ => Self::Flight,
        }
    }
}

/// Returns the message of a panic.
pub(super) fn text_of(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    text.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("?").to_owned()
}
