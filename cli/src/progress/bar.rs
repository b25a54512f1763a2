use indicatif::{ProgressBar, ProgressStyle};

/// A bar on standard error, with the time that is left.
#[derive(Debug)]
pub(super) struct Bar(ProgressBar);

const TEMPLATE: &str = "{wide_bar} {pos} of {len} {msg}, {eta} left";

impl Bar {
    /// Shows a bar of `total` parts; `what` names them.
    pub(super) fn new(total: u64, what: &'static str) -> Self {
        let bar = ProgressBar::new(total);
        // The template is checked by a test; a bar without style is a bar all the same.
        if let Ok(style) = ProgressStyle::with_template(TEMPLATE) {
            bar.set_style(style);
        }
        Self(bar.with_message(what))
    }

    /// Shows the number of parts that are done.
    pub(super) fn reach(&self, done: u64) {
        self.0.set_position(done);
    }

    /// Replaces the note beside the bar.
    pub(super) fn note(&self, note: String) {
        self.0.set_message(note);
    }

    /// Prints above the bar.
    pub(super) fn above(&self, print: impl FnOnce()) {
        self.0.suspend(print);
    }

    /// Removes the bar.
    pub(super) fn remove(&self) {
        self.0.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_template_is_one() {
        assert!(ProgressStyle::with_template(TEMPLATE).is_ok());
    }
}
