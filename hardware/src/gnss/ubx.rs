//! Frames of u-blox receivers (UBX) and their payloads.

use std::collections::VecDeque;

/// The longest payload that is waited for, in bytes: a NAV-PVT has 92. A length that was garbled
/// keeps no more than this from being read, and longer messages are passed over.
const LONGEST: usize = 256;

const SYNC: [u8; 2] = [0xb5, 0x62];

/// Bytes of a frame beside its payload.
const FRAME: usize = 8;

/// A message whose checksum is right.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Message {
    /// Class and number.
    pub id: (u8, u8),
    pub payload: Payload,
}

/// Numbers of a payload, little-endian, by their offset; `None` beyond its end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Payload(Vec<u8>);

impl Payload {
    fn bytes<const N: usize>(&self, at: usize) -> Option<[u8; N]> {
        self.0.get(at..at.checked_add(N)?)?.try_into().ok()
    }

    pub(super) fn u8(&self, at: usize) -> Option<u8> {
        self.0.get(at).copied()
    }

    pub(super) fn i8(&self, at: usize) -> Option<f64> {
        self.bytes(at).map(i8::from_le_bytes).map(f64::from)
    }

    pub(super) fn u16(&self, at: usize) -> Option<f64> {
        self.bytes(at).map(u16::from_le_bytes).map(f64::from)
    }

    pub(super) fn u32(&self, at: usize) -> Option<u32> {
        self.bytes(at).map(u32::from_le_bytes)
    }

    pub(super) fn i32(&self, at: usize) -> Option<f64> {
        self.bytes(at).map(i32::from_le_bytes).map(f64::from)
    }
}

/// Finds messages in bytes, however these are cut.
#[derive(Clone, Debug, Default)]
pub(super) struct Frames {
    bytes: VecDeque<u8>,
    refused: u64,
}

impl Frames {
    pub(super) fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend(bytes);
    }

    /// Forgets what was begun.
    pub(super) fn clear(&mut self) {
        self.bytes.clear();
    }

    /// Returns the number of frames with a wrong checksum.
    pub(super) fn refused(&self) -> u64 {
        self.refused
    }

    fn at(&self, at: usize) -> Option<u8> {
        self.bytes.get(at).copied()
    }

    /// The next whole message.
    pub(super) fn next(&mut self) -> Option<Message> {
        loop {
            let begin = self.bytes.iter().position(|&byte| byte == SYNC[0]);
            self.bytes.drain(..begin.unwrap_or(self.bytes.len()));
            if self.at(1)? != SYNC[1] {
                self.bytes.pop_front();
                continue;
            }
            let length = usize::from(u16::from_le_bytes([self.at(4)?, self.at(5)?]));
            if length > LONGEST {
                self.bytes.pop_front();
                continue;
            }
            self.at(length + FRAME - 1)?;
            let frame: Vec<u8> = self.bytes.iter().take(length + FRAME).copied().collect();
            match message(&frame) {
                Some(message) => {
                    self.bytes.drain(..frame.len());
                    return Some(message);
                }
                None => self.refuse(),
            }
        }
    }

    /// Drops the first byte of a damaged frame, so that the next one is looked for.
    fn refuse(&mut self) {
        self.refused += 1;
        self.bytes.pop_front();
    }
}

/// The message of a whole frame, if its checksum is right.
fn message(frame: &[u8]) -> Option<Message> {
    let (body, sum) = frame.get(2..)?.split_last_chunk::<2>()?;
    let [class, number, _, _, payload @ ..] = body else { return None };
    let proper = checksum(body) == *sum;
    proper.then(|| Message { id: (*class, *number), payload: Payload(payload.to_vec()) })
}

/// The checksum of Fletcher over class, number, length and payload (RFC 1145).
fn checksum(body: &[u8]) -> [u8; 2] {
    body.iter().fold([0, 0], |[a, b], &byte| {
        let a = byte.wrapping_add(a);
        [a, b.wrapping_add(a)]
    })
}

/// A frame of at most 255 bytes of payload.
pub(super) fn frame(id: (u8, u8), payload: &[u8]) -> Vec<u8> {
    let length = u8::try_from(payload.len()).unwrap_or(u8::MAX);
    let payload = payload.get(..usize::from(length)).unwrap_or_default();
    let body = [&[id.0, id.1, length, 0], payload].concat();
    [&SYNC[..], &body, &checksum(&body)].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_found_between_noise_and_read_by_offset() {
        // MON-VER's question, as u-blox's u-center sends it.
        assert_eq!(frame((0x0a, 0x04), &[]), [0xb5, 0x62, 0x0a, 0x04, 0, 0, 0x0e, 0x34]);
        let payload = [0xfe, 0xff, 0xff, 0xff, 0x10, 0x27];
        let whole = frame((1, 2), &payload);
        let mut damaged = whole.clone();
        damaged[8] ^= 1;
        let too_long = [0xb5, 0x62, 1, 2, 0, 2];
        let bytes = [&[0xb5, 7][..], &damaged, &too_long, &[0xb5], &whole, &whole[..9]].concat();
        let mut frames = Frames::default();
        let mut found = Vec::new();
        for byte in bytes {
            frames.push(&[byte]);
            found.extend(frames.next());
        }
        let [message] = &found[..] else { panic!("one message: {found:?}") };
        assert_eq!((message.id, frames.refused()), ((1, 2), 1));
        let payload = &message.payload;
        assert_eq!((payload.i32(0), payload.u16(4)), (Some(-2.0), Some(10_000.0)));
        assert_eq!((payload.i8(0), payload.u8(5)), (Some(-2.0), Some(0x27)));
        assert_eq!((payload.u32(3), payload.u16(5), payload.u8(6)), (None, None, None));
        frames.push(&whole[9..]);
        assert!(frames.next().is_some(), "the second half of a frame completes it");
    }
}
