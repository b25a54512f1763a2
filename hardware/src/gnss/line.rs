/// Gathers lines of text of at most `limit` bytes; what is longer, or no text, is dropped.
#[derive(Clone, Debug)]
pub(super) struct Line {
    bytes: Vec<u8>,
    limit: usize,
    /// Byte that begins a line, and drops what came before it in the same line.
    begin: Option<u8>,
    /// True if this line has become too long: its rest means nothing.
    skips: bool,
}

impl Line {
    pub(super) fn new(limit: usize, begin: Option<u8>) -> Self {
        Self { bytes: Vec::new(), limit, begin, skips: begin.is_some() }
    }

    /// Forgets what was begun.
    pub(super) fn clear(&mut self) {
        self.bytes.clear();
        self.skips = self.begin.is_some();
    }

    /// Takes a byte; the line that it ends, without its end.
    pub(super) fn push<T>(&mut self, byte: u8, whole: impl FnOnce(&str) -> T) -> Option<T> {
        if matches!(byte, b'\r' | b'\n') {
            let text = str::from_utf8(&self.bytes).ok().filter(|text| !text.is_empty());
            let line = text.map(whole);
            self.clear();
            return line;
        }
        if self.begin == Some(byte) {
            self.bytes.clear();
            self.skips = false;
        }
        if !self.skips {
            if self.bytes.len() == self.limit {
                self.bytes.clear();
                self.skips = true;
            } else {
                self.bytes.push(byte);
            }
        }
        None
    }
}
