//! Notices on standard error while a hunt goes on.

use foxhunt::{hunt::Event, overview::notice};

use crate::output::warn;

/// Prints an event that people want to know of.
pub(super) fn narrate(event: &Event) {
    if let Some(notice) = notice(event).filter(|notice| notice.important) {
        warn(&format!("{:7.0} s  {}", notice.time, notice.text));
    }
}
