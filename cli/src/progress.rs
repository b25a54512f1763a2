use std::{
    io::{IsTerminal, stderr},
    sync::atomic::{AtomicU64, Ordering},
};

use indicatif::{ProgressBar, ProgressStyle};

use crate::output::warn;

/// The progress of a long work on standard error: a bar on a terminal, elsewhere a line for each
/// tenth.
#[derive(Debug)]
pub(crate) struct Progress {
    what: &'static str,
    total: u64,
    done: AtomicU64,
    bar: Option<ProgressBar>,
}

impl Progress {
    /// Begins a work of `total` parts; `what` names the parts.
    pub(crate) fn new(what: &'static str, total: u64) -> Self {
        let bar = stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(total);
            // The template is checked by a test; a bar without style is a bar all the same.
            if let Ok(style) = ProgressStyle::with_template(TEMPLATE) {
                bar.set_style(style);
            }
            bar.with_message(what)
        });
        if bar.is_none() {
            warn(&format!("0 of {total} {what}"));
        }
        Self { what, total, done: AtomicU64::new(0), bar }
    }

    /// One part is done; from any thread.
    pub(crate) fn step(&self) {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        match &self.bar {
            Some(bar) => bar.inc(1),
            None if tenth(done, self.total) => {
                warn(&format!("{done} of {} {}", self.total, self.what));
            }
            None => {}
        }
    }

    /// Takes the bar away.
    pub(crate) fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

const TEMPLATE: &str = "{wide_bar} {pos} of {len} {msg}, {eta} left";

/// Whether a tenth of the work is completed with this part.
fn tenth(done: u64, total: u64) -> bool {
    let tenths = |parts: u64| parts.saturating_mul(10) / total.max(1);
    tenths(done) > tenths(done.saturating_sub(1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_tenth_once() {
        for total in [10, 37, 1000] {
            assert_eq!((1..=total).filter(|done| tenth(*done, total)).count(), 10);
        }
        assert_eq!((1..=3).filter(|done| tenth(*done, 3)).count(), 3);
        assert!(tenth(3, 3));
    }

    #[test]
    fn the_template_is_one() {
        assert!(ProgressStyle::with_template(TEMPLATE).is_ok());
    }
}
