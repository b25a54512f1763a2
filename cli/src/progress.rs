//! Progress of long work.

use std::{
    io::{IsTerminal, stderr},
    sync::atomic::{AtomicU64, Ordering},
};

#[cfg(not(target_family = "wasm"))]
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

use crate::output::{Output, event, warn};

/// The progress of a long work: a bar with the time that is left, where standard error is a
/// terminal; with `--json=lines` a line for each hundredth.
#[derive(Debug)]
pub struct Progress {
    what: &'static str,
    total: u64,
    done: AtomicU64,
    bar: Option<Bar>,
    streams: bool,
}

/// Progress of a work.
#[derive(Debug, Serialize)]
struct Done {
    what: &'static str,
    done: u64,
    total: u64,
}

impl Progress {
    /// Begins a work of `total` parts; `what` names the parts. Without `shows` there is no bar.
    pub fn new(output: Output<'_>, what: &'static str, total: u64, shows: bool) -> Self {
        let bar = (shows && stderr().is_terminal()).then(|| Bar::new(total, what));
        Self { what, total, done: AtomicU64::new(0), bar, streams: output.streams() }
    }

    /// Counts one part as done; from any thread.
    pub fn step(&self) {
        let before = self.done.fetch_add(1, Ordering::Relaxed);
        self.show(before, before + 1);
    }

    /// Sets the number of parts that are done.
    pub fn reach(&self, done: u64) {
        self.show(self.done.swap(done, Ordering::Relaxed), done);
    }

    fn show(&self, before: u64, done: u64) {
        if let Some(bar) = &self.bar {
            bar.reach(self.done.load(Ordering::Relaxed));
        }
        if self.streams && hundredth(before, done, self.total) {
            // Where standard output is closed the result cannot be printed either.
            let _ = event("progress", &Done { what: self.what, done, total: self.total });
        }
    }

    /// Replaces the note beside the bar.
    pub fn note(&self, note: String) {
        if let Some(bar) = &self.bar {
            bar.note(note);
        }
    }

    /// Prints a line on standard error, above the bar.
    pub fn warn(&self, line: &str) {
        match &self.bar {
            Some(bar) => bar.above(|| warn(line)),
            None => warn(line),
        }
    }

    /// Removes the bar.
    pub fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.remove();
        }
    }
}

/// Returns true if a hundredth of the work was completed on the way from `before` to `done`.
fn hundredth(before: u64, done: u64, total: u64) -> bool {
    let parts = |done: u64| done.saturating_mul(100) / total.max(1);
    parts(done) > parts(before)
}

/// A bar on standard error, with the time that is left.
#[cfg(not(target_family = "wasm"))]
#[derive(Debug)]
struct Bar(ProgressBar);

#[cfg(not(target_family = "wasm"))]
const TEMPLATE: &str = "{wide_bar} {pos} of {len} {msg}, {eta} left";

#[cfg(not(target_family = "wasm"))]
impl Bar {
    /// Shows a bar of `total` parts; `what` names them.
    fn new(total: u64, what: &'static str) -> Self {
        let bar = ProgressBar::new(total);
        // The template is checked by a test; a bar without style is a bar all the same.
        if let Ok(style) = ProgressStyle::with_template(TEMPLATE) {
            bar.set_style(style);
        }
        Self(bar.with_message(what))
    }

    /// Shows the number of parts that are done.
    fn reach(&self, done: u64) {
        self.0.set_position(done);
    }

    /// Replaces the note beside the bar.
    fn note(&self, note: String) {
        self.0.set_message(note);
    }

    /// Prints above the bar.
    fn above(&self, print: impl FnOnce()) {
        self.0.suspend(print);
    }

    /// Removes the bar.
    fn remove(&self) {
        self.0.finish_and_clear();
    }
}

/// A bar that draws nothing: WebAssembly has no terminal.
#[cfg(target_family = "wasm")]
#[derive(Debug)]
struct Bar;

#[cfg(target_family = "wasm")]
impl Bar {
    fn new(_total: u64, _what: &'static str) -> Self {
        Self
    }

    fn reach(&self, _done: u64) {}

    fn note(&self, _note: String) {}

    /// Prints at once.
    fn above(&self, print: impl FnOnce()) {
        print();
    }

    fn remove(&self) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_hundredth_once() {
        for total in [100, 370, 1000] {
            let completed = (1..=total).filter(|done| hundredth(done - 1, *done, total));
            assert_eq!(completed.count(), 100);
        }
        assert_eq!((1..=3).filter(|done| hundredth(done - 1, *done, 3)).count(), 3);
        assert!(hundredth(2, 3, 3));
    }

    #[test]
    fn the_template_is_one() {
        assert!(ProgressStyle::with_template(TEMPLATE).is_ok());
    }
}
