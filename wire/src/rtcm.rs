//! Frames of RTCM 3 (RTCM 10403): 0xD3, six reserved bits, ten bits of length, the message and its
//! CRC-24Q. Messages themselves are not read.

/// First byte of a frame.
const PREAMBLE: u8 = 0xd3;

/// Bytes before the message.
const HEAD: usize = 3;

/// Bytes after the message.
const CHECKSUM: usize = 3;

/// Greatest length of a message, in bytes: ten bits of length.
pub const LONGEST_MESSAGE: usize = 1023;

/// Generator of CRC-24Q (Qualcomm), with its leading one.
const GENERATOR: u32 = 0x186_4cfb;

/// CRC-24Q of bytes, from zero.
#[must_use]
pub fn crc24q(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0, |crc, byte| {
        let crc = crc ^ (u32::from(*byte) << 16);
        (0..8).fold(crc, |crc, _| {
            let shifted = crc << 1;
            if shifted & 0x100_0000 == 0 { shifted } else { shifted ^ GENERATOR }
        })
    })
}

/// Puts a message into a frame; `None` if it is longer than [`LONGEST_MESSAGE`].
#[must_use]
pub fn frame(message: &[u8]) -> Option<Vec<u8>> {
    let length = u16::try_from(message.len()).ok().filter(|_| message.len() <= LONGEST_MESSAGE)?;
    let [high, low] = length.to_be_bytes();
    let mut frame = vec![PREAMBLE, high, low];
    frame.extend(message);
    let [_, crc @ ..] = crc24q(&frame).to_be_bytes();
    frame.extend(crc);
    Some(frame)
}

/// Number of the message in a frame, such as 1005; `None` for a message of less than 12 bits.
#[must_use]
pub fn message_number(frame: &[u8]) -> Option<u16> {
    let message = frame.get(HEAD..frame.len().checked_sub(CHECKSUM)?)?;
    let [first, second, ..] = message else { return None };
    Some(u16::from_be_bytes([*first, *second]) >> 4)
}

/// Finds frames among bytes, however these are cut. A frame with a wrong CRC is dropped, and its
/// bytes are searched for the next one. At most one frame is held.
///
/// ```
/// use foxhunt_wire::rtcm::{Frames, frame};
///
/// let sent = frame(&[0x3e, 0xd0, 0x00]).expect("short");
/// let mut frames = Frames::default();
/// let mut found = Vec::new();
/// frames.take(b"ICY", &mut |frame| found.push(frame.to_vec()));
/// frames.take(&sent, &mut |frame| found.push(frame.to_vec()));
/// assert_eq!(found, [sent]);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Frames {
    bytes: Vec<u8>,
    whole: u64,
    damaged: u64,
}

impl Frames {
    /// Takes bytes; hands on each frame that they complete, from its first byte to its CRC.
    pub fn take(&mut self, bytes: &[u8], emit: &mut dyn FnMut(&[u8])) {
        for piece in bytes.chunks(HEAD + LONGEST_MESSAGE + CHECKSUM) {
            self.bytes.extend(piece);
            self.search(emit);
        }
    }

    fn search(&mut self, emit: &mut dyn FnMut(&[u8])) {
        let mut at = 0;
        while let Some(rest) = self.bytes.get(at..) {
            let Some(ahead) = rest.iter().position(|byte| *byte == PREAMBLE) else {
                at = self.bytes.len();
                break;
            };
            at += ahead;
            let rest = self.bytes.get(at..).unwrap_or_default();
            let Some(&[_, high, low]) = rest.first_chunk::<HEAD>() else { break };
            // The reserved bits are zero in every version until now.
            if high & 0xfc != 0 {
                at += 1;
                continue;
            }
            let length = HEAD + usize::from(u16::from_be_bytes([high, low])) + CHECKSUM;
            let Some(frame) = rest.get(..length) else { break };
            // The CRC of a frame with its own CRC behind it is zero.
            if crc24q(frame) == 0 {
                self.whole += 1;
                emit(frame);
                at += length;
            } else {
                self.damaged += 1;
                at += 1;
            }
        }
        self.bytes.drain(..at.min(self.bytes.len()));
    }

    /// Forgets what was begun: the next bytes belong to another connection.
    pub fn reset(&mut self) {
        self.bytes.clear();
    }

    /// Number of whole frames until now.
    #[must_use]
    pub fn whole(&self) -> u64 {
        self.whole
    }

    /// Number of frames with a wrong CRC until now.
    #[must_use]
    pub fn damaged(&self) -> u64 {
        self.damaged
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The example of RTCM 10403, message 1005 of station 2003.
    const STATION: [u8; 25] = [
        0xd3, 0x00, 0x13, 0x3e, 0xd7, 0xd3, 0x02, 0x02, 0x98, 0x0e, 0xde, 0xef, 0x34, 0xb4, 0xbd,
        0x62, 0xac, 0x09, 0x41, 0x98, 0x6f, 0x33, 0x36, 0x0b, 0x98,
    ];

    fn found(frames: &mut Frames, bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut found = Vec::new();
        frames.take(bytes, &mut |frame| found.push(frame.to_vec()));
        found
    }

    #[test]
    fn the_example_of_the_standard_is_a_frame() {
        let message = &STATION[3..22];
        assert_eq!(frame(message).as_deref(), Some(&STATION[..]));
        assert_eq!(crc24q(&STATION[..22]), 0x36_0b98);
        assert_eq!(found(&mut Frames::default(), &STATION), [STATION]);
        assert_eq!(message_number(&STATION), Some(1005));
        assert_eq!(message_number(&[0xd3, 0, 0, 0x47, 0xea, 0x4b]), None);
        assert_eq!(frame(&[0; 1024]), None);
        assert!(frame(&[0; 1023]).is_some());
    }

    #[test]
    fn a_damaged_frame_is_dropped_and_the_next_one_found() {
        for bit in 0..8 * STATION.len() {
            let mut bytes = STATION;
            bytes[bit / 8] ^= 1 << (bit % 8);
            let mut frames = Frames::default();
            let whole = found(&mut frames, &[&bytes[..], &[0; 1100], &STATION].concat());
            assert_eq!(whole, [STATION], "bit {bit}");
            assert_eq!(frames.whole(), 1, "bit {bit}");
        }
        let mut frames = Frames::default();
        let mut bytes = STATION;
        bytes[10] ^= 1;
        assert!(found(&mut frames, &bytes).is_empty());
        assert!(frames.damaged() > 0);
    }

    proptest! {
        #[test]
        fn cuts_and_bytes_between_change_nothing(
            messages in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..1024), 1..5),
            cut in 1_usize..2000,
        ) {
            let sent: Vec<Vec<u8>> =
                messages.iter().map(|message| frame(message).expect("short")).collect();
            let stream = sent.join(&b"\r\n"[..]);
            let mut frames = Frames::default();
            let pieces = stream.chunks(cut);
            let whole: Vec<Vec<u8>> =
                pieces.flat_map(|piece| found(&mut frames, piece)).collect();
            prop_assert_eq!(whole, sent);
            prop_assert_eq!(frames.damaged(), 0);
        }

        #[test]
        fn any_bytes_are_held_within_a_frame(bytes in prop::collection::vec(any::<u8>(), 0..5000)) {
            let mut frames = Frames::default();
            frames.take(&bytes, &mut |_| ());
            prop_assert!(frames.bytes.len() < HEAD + LONGEST_MESSAGE + CHECKSUM);
        }
    }
}
