/// Writes the values of a message in CDR, as ROS 2 reads it: OMG's Common Data Representation,
/// version 1, little-endian, where each number is aligned to its own size.
#[derive(Debug)]
pub(super) struct CdrWriter(Vec<u8>);

/// Length of the header; alignment counts from its end.
const HEADER: usize = 4;

impl CdrWriter {
    /// A message that has its header alone.
    pub(super) fn new() -> Self {
        Self(vec![0, 1, 0, 0])
    }

    fn put<const N: usize>(&mut self, bytes: [u8; N]) {
        let end = self.0.len() - HEADER;
        self.0.resize(HEADER + end.next_multiple_of(N), 0);
        self.0.extend(bytes);
    }

    pub(super) fn u8(&mut self, value: u8) {
        self.put([value]);
    }

    pub(super) fn u16(&mut self, value: u16) {
        self.put(value.to_le_bytes());
    }

    pub(super) fn u32(&mut self, value: u32) {
        self.put(value.to_le_bytes());
    }

    pub(super) fn f64s(&mut self, values: impl IntoIterator<Item = f64>) {
        for value in values {
            self.put(value.to_le_bytes());
        }
    }

    /// Writes the length of a list, whose items follow.
    pub(super) fn length(&mut self, items: usize) {
        self.u32(u32::try_from(items).unwrap_or(u32::MAX));
    }

    /// Writes a text; it ends at its first zero byte, which CDR has no room for.
    pub(super) fn text(&mut self, text: &str) {
        let text = text.split('\0').next().unwrap_or_default();
        self.length(text.len() + 1);
        self.0.extend(text.as_bytes());
        self.u8(0);
    }

    pub(super) fn into_bytes(self) -> Vec<u8> {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_aligned_to_their_size() {
        let mut cdr = CdrWriter::new();
        cdr.u8(7);
        cdr.u32(0x0102_0304);
        cdr.f64s([1.5]);
        cdr.text("a\0b");
        cdr.u16(9);
        let header = [0, 1, 0, 0];
        let numbers = [7, 0, 0, 0, 4, 3, 2, 1, 0, 0, 0, 0, 0, 0, 0xF8, 0x3F];
        let text_and_number = [2, 0, 0, 0, b'a', 0, 9, 0];
        assert_eq!(cdr.into_bytes(), [&header[..], &numbers, &text_and_number].concat());
    }
}
