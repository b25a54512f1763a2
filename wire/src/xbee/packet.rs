//! Frames as they lie on a serial line: packets in either mode, and the decoder that finds them.

use super::{Frame, LONGEST_DATA, frame::FrameError};

/// First byte of a frame.
const DELIMITER: u8 = 0x7E;

/// Byte before an escaped one.
const ESCAPE: u8 = 0x7D;

/// Bits that escaping flips.
const FLIP: u8 = 0x20;

/// Bytes of the delimiter and the length, before the data.
const HEAD: usize = 3;

/// Encoding of frames on the serial line: the radio's parameter `AP`.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum ApiMode {
    /// `AP` 1: as they are.
    #[default]
    Plain,
    /// `AP` 2: bytes that begin a frame, and bytes that serial lines take for commands, are
    /// escaped.
    Escaped,
}

impl Frame {
    /// Returns the bytes of the frame on the line.
    ///
    /// # Errors
    ///
    /// [`FrameError::NoSuchLength`] if it is longer than [`LONGEST_DATA`].
    pub fn encode(&self, mode: ApiMode) -> Result<Vec<u8>, FrameError> {
        let data = self.data();
        let length = data.len();
        let short = u16::try_from(length).ok().filter(|_| length <= LONGEST_DATA);
        let declared = short.ok_or(FrameError::NoSuchLength { length })?;
        let mut out = Vec::with_capacity(length + HEAD + 1);
        out.push(DELIMITER);
        let checksum = checksum(&data);
        for byte in declared.to_be_bytes().into_iter().chain(data).chain([checksum]) {
            if mode == ApiMode::Escaped && matches!(byte, DELIMITER | ESCAPE | 0x11 | 0x13) {
                out.extend([ESCAPE, byte ^ FLIP]);
            } else {
                out.push(byte);
            }
        }
        Ok(out)
    }

    /// The frame that these bytes are, no more and no less.
    ///
    /// # Errors
    ///
    /// [`FrameError`] names what is wrong with them.
    pub fn decode(bytes: &[u8], mode: ApiMode) -> Result<Self, FrameError> {
        let found = *bytes.first().ok_or(FrameError::Cut { bytes: 0 })?;
        if found != DELIMITER {
            return Err(FrameError::Delimiter { found });
        }
        let bytes = match mode {
            ApiMode::Plain => bytes.to_vec(),
            ApiMode::Escaped => unescaped(bytes),
        };
        let [_, high, low, rest @ ..] = bytes.as_slice() else {
            return Err(FrameError::Cut { bytes: bytes.len() });
        };
        let declared = usize::from(u16::from_be_bytes([*high, *low]));
        let (last, data) = rest.split_last().ok_or(FrameError::Cut { bytes: bytes.len() })?;
        if declared != data.len() {
            return Err(FrameError::Length { declared, actual: data.len() });
        }
        checked(data, *last)
    }
}

/// Finds frames in the bytes of a serial line, however they are divided.
///
/// Bytes of no frame are [skipped](Self::skipped). A frame that turns out wrong costs its delimiter
/// alone: the next one is looked for in what came after it. In [`ApiMode::Escaped`] a delimiter is
/// nothing else, so a frame that was cut ends where the next begins. In [`ApiMode::Plain`] it may
/// be data, so a cut frame is known only when as many bytes have come as it announced; until then,
/// the frames behind it wait. [`give_up`](Self::give_up) ends that when the line has been quiet.
///
/// It keeps at most one frame of the longest length.
///
/// ```
/// use foxhunt_wire::xbee::{ApiMode, AtCommand, Decoder, Frame};
/// let mut decoder = Decoder::new(ApiMode::Plain);
/// let frames = decoder.push(&[0x00, 0x7E, 0x00, 0x04, 0x08, 0x01, 0x44, 0x42, 0x70]);
/// assert_eq!(frames, [Ok(Frame::at(1, AtCommand::DB))]);
/// assert_eq!(decoder.skipped(), 1);
/// ```
#[derive(Clone, Debug)]
pub struct Decoder {
    mode: ApiMode,
    /// Bytes from a delimiter on, unescaped; shorter than the frame that it announces.
    begun: Vec<u8>,
    /// The last byte was an escape.
    escaped: bool,
    skipped: u64,
}

impl Decoder {
    /// A decoder without any bytes so far.
    #[must_use]
    pub fn new(mode: ApiMode) -> Self {
        Self { mode, begun: Vec::new(), escaped: false, skipped: 0 }
    }

    /// Encoding of the frames.
    #[must_use]
    pub fn mode(&self) -> ApiMode {
        self.mode
    }

    /// Number of bytes that belonged to no frame.
    #[must_use]
    pub fn skipped(&self) -> u64 {
        self.skipped
    }

    /// Returns true if a frame has begun and is not complete.
    #[must_use]
    pub fn is_waiting(&self) -> bool {
        !self.begun.is_empty()
    }

    /// Takes received bytes; returns the frames that they complete, and the errors of broken ones,
    /// in their order.
    pub fn push(&mut self, bytes: &[u8]) -> Vec<Result<Frame, FrameError>> {
        let mut frames = Vec::new();
        for byte in bytes {
            match self.mode {
                ApiMode::Plain => self.begun.push(*byte),
                ApiMode::Escaped => self.unescape(*byte, &mut frames),
            }
            self.find(&mut frames);
        }
        frames
    }

    /// The line has been quiet for long enough to know that a frame which has begun was cut; the
    /// frames that had come behind it.
    pub fn give_up(&mut self) -> Vec<Result<Frame, FrameError>> {
        let mut frames = Vec::new();
        while self.is_waiting() {
            frames.push(Err(FrameError::Cut { bytes: self.begun.len() }));
            self.drop_delimiter();
            self.find(&mut frames);
        }
        self.escaped = false;
        frames
    }

    fn unescape(&mut self, byte: u8, frames: &mut Vec<Result<Frame, FrameError>>) {
        match byte {
            DELIMITER => {
                if self.is_waiting() {
                    frames.push(Err(FrameError::Cut { bytes: self.begun.len() }));
                    self.skip(self.begun.len());
                }
                self.escaped = false;
                self.begun.push(byte);
            }
            ESCAPE if self.is_waiting() && !self.escaped => self.escaped = true,
            _ if self.is_waiting() => {
                self.begun.push(if self.escaped { byte ^ FLIP } else { byte });
                self.escaped = false;
            }
            _ => self.skipped += 1,
        }
    }

    /// Takes out all frames that are complete, and leaves the beginning of an incomplete one.
    fn find(&mut self, frames: &mut Vec<Result<Frame, FrameError>>) {
        loop {
            let before = self.begun.iter().position(|byte| *byte == DELIMITER);
            self.skip(before.unwrap_or(self.begun.len()));
            let Some(&[_, high, low]) = self.begun.first_chunk() else { return };
            let length = usize::from(u16::from_be_bytes([high, low]));
            if !(1..=LONGEST_DATA).contains(&length) {
                frames.push(Err(FrameError::NoSuchLength { length }));
                self.drop_delimiter();
                continue;
            }
            let Some(body) = self.begun.get(HEAD..=HEAD + length) else { return };
            let Some((last, data)) = body.split_last() else { return };
            let outcome = checked(data, *last);
            if matches!(outcome, Err(FrameError::Checksum { .. })) {
                self.drop_delimiter();
            } else {
                self.begun.drain(..=HEAD + length);
            }
            frames.push(outcome);
        }
    }

    /// Drops a delimiter that began no frame. In escaped mode the bytes after it were of this frame
    /// alone.
    fn drop_delimiter(&mut self) {
        match self.mode {
            ApiMode::Plain => self.skip(1),
            ApiMode::Escaped => self.skip(self.begun.len()),
        }
    }

    fn skip(&mut self, count: usize) {
        self.begun.drain(..count);
        self.skipped += u64::try_from(count).unwrap_or(u64::MAX);
    }
}

/// 0xFF less the sum of the data.
fn checksum(data: &[u8]) -> u8 {
    !data.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte))
}

/// The frame with these data, if they match the checksum.
fn checked(data: &[u8], declared: u8) -> Result<Frame, FrameError> {
    let computed = checksum(data);
    if declared != computed {
        return Err(FrameError::Checksum { declared, computed });
    }
    Frame::from_data(data)
}

fn unescaped(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(bytes.len());
    let mut escaped = false;
    for byte in bytes {
        if *byte == ESCAPE && !escaped {
            escaped = true;
            continue;
        }
        out.push(if escaped { *byte ^ FLIP } else { *byte });
        escaped = false;
    }
    out
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn whatever_comes_it_keeps_less_than_one_frame(
            bytes in prop::collection::vec(
                prop_oneof![Just(0x7E_u8), Just(0x7D), Just(0x00), Just(0x01), any::<u8>()],
                0..4000,
            ),
            escaped in any::<bool>(),
        ) {
            let mode = if escaped { ApiMode::Escaped } else { ApiMode::Plain };
            let mut decoder = Decoder::new(mode);
            for chunk in bytes.chunks(97) {
                decoder.push(chunk);
                prop_assert!(decoder.begun.len() < LONGEST_DATA + HEAD + 1);
            }
            prop_assert!(decoder.begun.capacity() <= 2 * (LONGEST_DATA + HEAD + 1));
            decoder.give_up();
            prop_assert!(!decoder.is_waiting());
        }
    }
}
