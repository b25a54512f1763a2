//! Notices on standard error while a hunt goes on.

use std::collections::BTreeMap;
#[cfg(feature = "hardware")]
use std::collections::BTreeSet;

#[cfg(feature = "hardware")]
use foxhunt::hunt::{Hunt, remarks_of_receivers};
use foxhunt::{hunt::Event, overview::notice};

use crate::output::warn;

/// A trouble that was away for this time, in seconds, is printed when it comes again.
const AWAY_S: f64 = 60.0;

/// Prints events that people want to know of, and a lasting trouble once.
#[derive(Debug, Default)]
pub struct Notices {
    troubles: BTreeMap<String, Trouble>,
    /// Receivers that were said to be off, by number and code of the remark.
    #[cfg(feature = "hardware")]
    off: BTreeSet<(usize, String)>,
}

/// A trouble that was printed.
#[derive(Debug)]
struct Trouble {
    /// Time of its last occurrence, in seconds.
    came: f64,
    /// Number of occurrences since it was printed.
    since: u32,
}

impl Notices {
    /// Prints an event that people want to know of.
    pub fn print(&mut self, event: &Event) {
        if let Some(line) = self.line(event) {
            warn(&line);
        }
    }

    /// Prints once of each receiver, after a reception, what the estimator has learned that it gets
    /// wrong; `name` is its name, if it has one.
    #[cfg(feature = "hardware")]
    pub fn print_receivers(
        &mut self,
        event: &Event,
        hunt: &Hunt,
        name: impl Fn(usize) -> Option<String>,
    ) {
        let Event::Corrected { time, .. } = event else { return };
        let name = |number: usize| name(number).unwrap_or_else(|| format!("drone {}", number + 1));
        for learned in hunt.learned_receivers() {
            for remark in remarks_of_receivers(&[*learned], name) {
                if self.off.insert((learned.0, remark.code.into_owned())) {
                    warn(&format!("{time:7.0} s  {}", remark.text));
                }
            }
        }
    }

    /// Prints the counts of troubles since they were printed last.
    pub fn finish(self) {
        for (text, Trouble { since, .. }) in self.troubles {
            if since > 0 {
                warn(&format!("{since} times more: {text}"));
            }
        }
    }

    fn line(&mut self, event: &Event) -> Option<String> {
        let notice = notice(event).filter(|notice| notice.important)?;
        let mut again = String::new();
        if goes_on(event) {
            if let Some(known) = self.troubles.get_mut(&notice.text) {
                let away_s = notice.time - known.came;
                (known.came, known.since) = (notice.time, known.since + 1);
                if away_s < AWAY_S {
                    return None;
                }
                if known.since > 1 {
                    again = format!(" ({} times)", known.since);
                }
            }
            let trouble = Trouble { came: notice.time, since: 0 };
            self.troubles.insert(notice.text.clone(), trouble);
        }
        Some(format!("{:7.0} s  {}{again}", notice.time, notice.text))
    }
}

/// Returns true if an event is a trouble that comes again while it lasts.
fn goes_on(event: &Event) -> bool {
    matches!(
        event,
        Event::Missing { .. } | Event::FilterDiverged { .. } | Event::DeviceFailed { .. }
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn failed(time: f64, reason: &str) -> Event {
        Event::DeviceFailed { time, drone: Some(0), reason: reason.to_owned() }
    }

    #[test]
    fn a_trouble_is_printed_once_while_it_lasts() {
        let mut notices = Notices::default();
        let mut lines = Vec::new();
        for second in (0..130_u8).chain(200..210) {
            let event = failed(f64::from(second), "the radio is silent");
            lines.extend(notices.line(&event));
        }
        let text = "drone 1: the radio is silent; the hunt goes on; bring it home if it stays so";
        let expected = [format!("      0 s  {text}"), format!("    200 s  {text} (130 times)")];
        assert_eq!(lines, expected);
        assert!(notices.line(&failed(205.0, "no fix")).is_some(), "another trouble");
        assert_eq!(notices.troubles[text].since, 9);
        // What changes is no trouble that lasts.
        let resumed = Event::Resumed { time: 1.0 };
        assert!(notices.line(&resumed).is_some() && notices.line(&resumed).is_some());
    }
}
