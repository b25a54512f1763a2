use super::BagError;

/// Reads the values of a message in CDR, as ROS 2 writes it: OMG's Common Data Representation,
/// version 1, where each number is aligned to its own size.
#[derive(Debug)]
pub(super) struct Cdr<'a> {
    bytes: &'a [u8],
    at: usize,
    little: bool,
}

/// Maximum length of a text or a list; a longer one would not fit into any message.
const MOST: usize = 1 << 20;

impl<'a> Cdr<'a> {
    /// The message after its header of four bytes.
    pub(super) fn new(message: &'a [u8]) -> Result<Self, BagError> {
        match message {
            [0, 0, _, _, bytes @ ..] => Ok(Self { bytes, at: 0, little: false }),
            [0, 1, _, _, bytes @ ..] => Ok(Self { bytes, at: 0, little: true }),
            _ => Err(BagError::Encoding),
        }
    }

    /// The next `N` bytes, aligned to as many.
    fn take<const N: usize>(&mut self) -> Result<[u8; N], BagError> {
        let begin = self.at.next_multiple_of(N);
        let end = begin + N;
        let bytes = self.bytes.get(begin..end).and_then(|bytes| bytes.try_into().ok());
        let mut bytes: [u8; N] = bytes.ok_or(BagError::Short { length: self.bytes.len() })?;
        self.at = end;
        if !self.little {
            bytes.reverse();
        }
        Ok(bytes)
    }

    pub(super) fn u8(&mut self) -> Result<u8, BagError> {
        self.take().map(u8::from_le_bytes)
    }

    pub(super) fn bool(&mut self) -> Result<bool, BagError> {
        Ok(self.u8()? != 0)
    }

    pub(super) fn u16(&mut self) -> Result<u16, BagError> {
        self.take().map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Result<u32, BagError> {
        self.take().map(u32::from_le_bytes)
    }

    pub(super) fn f32(&mut self) -> Result<f32, BagError> {
        self.take().map(f32::from_le_bytes)
    }

    pub(super) fn f64(&mut self) -> Result<f64, BagError> {
        self.take().map(f64::from_le_bytes)
    }

    pub(super) fn f64s<const N: usize>(&mut self) -> Result<[f64; N], BagError> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f64()?;
        }
        Ok(values)
    }

    /// Reads the length of the text or the list that follows.
    fn length(&mut self) -> Result<usize, BagError> {
        let length = usize::try_from(self.u32()?).unwrap_or(usize::MAX);
        if length > MOST { Err(BagError::Short { length: self.bytes.len() }) } else { Ok(length) }
    }

    /// Passes over a text.
    pub(super) fn skip_text(&mut self) -> Result<(), BagError> {
        let length = self.length()?;
        self.at += length;
        if self.at > self.bytes.len() {
            return Err(BagError::Short { length: self.bytes.len() });
        }
        Ok(())
    }

    /// Passes over a list of numbers.
    pub(super) fn skip_f64s(&mut self) -> Result<(), BagError> {
        for _ in 0..self.length()? {
            self.f64()?;
        }
        Ok(())
    }

    /// Passes over a `std_msgs/Header`.
    pub(super) fn skip_header(&mut self) -> Result<(), BagError> {
        self.u32()?;
        self.u32()?;
        self.skip_text()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_aligned_and_of_either_order() {
        // A byte, three of padding, 0x01020304, then 1.5 as a double at 8.
        let little = [0, 1, 0, 0, 7, 0, 0, 0, 4, 3, 2, 1, 0, 0, 0, 0, 0, 0, 0xF8, 0x3F];
        let mut cdr = Cdr::new(&little).expect("a header");
        assert_eq!(cdr.u8(), Ok(7));
        assert_eq!(cdr.u32(), Ok(0x0102_0304));
        assert_eq!(cdr.f64(), Ok(1.5));
        assert!(matches!(cdr.u8(), Err(BagError::Short { .. })));
        let big = [0, 0, 0, 0, 0, 0, 0, 2, b'a', 0, 0, 9];
        let mut cdr = Cdr::new(&big).expect("a header");
        cdr.skip_text().expect("a text of two bytes");
        assert_eq!(cdr.u16(), Ok(9));
        assert!(matches!(Cdr::new(&[1, 2]), Err(BagError::Encoding)));
        let long = [0, 1, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF];
        assert!(Cdr::new(&long).expect("a header").skip_text().is_err());
        assert!(Cdr::new(&long).expect("a header").skip_f64s().is_err());
    }
}
