/// A bar that draws nothing: WebAssembly has no terminal.
#[derive(Debug)]
pub(super) struct Bar;

impl Bar {
    pub(super) fn new(_total: u64, _what: &'static str) -> Self {
        Self
    }

    pub(super) fn reach(&self, _done: u64) {}

    pub(super) fn note(&self, _note: String) {}

    /// Prints at once.
    pub(super) fn above(&self, print: impl FnOnce()) {
        print();
    }

    pub(super) fn remove(&self) {}
}
