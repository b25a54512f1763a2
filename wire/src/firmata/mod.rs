//! Firmata with the stepper messages of ConfigurableFirmata's AccelStepper: how an Arduino turns
//! the antenna. Sources: the [protocol](https://github.com/firmata/protocol) 2.6 and its
//! `accelStepperFirmata.md`.
//!
//! A host sends [`Request`]s and a device [`Reply`]s; [`Decoder`] reads either from a stream of
//! bytes.

mod messages;
mod stepper;

use std::{marker::PhantomData, str::Utf8Chunk};

pub use messages::{PinCapability, PinMode, Reply, Request};
pub use stepper::{Decimal, StepperInterface, StepperRequest, Wiring};

/// First and last byte of a system exclusive message.
const SYSEX: u8 = 0xF0;
const END_SYSEX: u8 = 0xF7;

/// Bytes that follow F0.
const STEPPER: u8 = 0x62;
const ANALOG_MAPPING_QUERY: u8 = 0x69;
const ANALOG_MAPPING: u8 = 0x6A;
const CAPABILITY_QUERY: u8 = 0x6B;
const CAPABILITIES: u8 = 0x6C;
const PIN_STATE: u8 = 0x6E;
const TEXT: u8 = 0x71;
const FIRMWARE: u8 = 0x79;

/// First bytes of short messages.
const DIGITAL: u8 = 0x90;
const REPORT_DIGITAL: u8 = 0xD0;
const PIN_MODE: u8 = 0xF4;
const VERSION: u8 = 0xF9;
const RESET: u8 = 0xFF;

/// Bytes that follow F0 62 in both directions.
const REPORT: u8 = 0x06;
const DONE: u8 = 0x0A;

/// The largest magnitude that has room beside the sign.
const LARGEST: u32 = 0x7FFF_FFFF;

/// Error of a message that cannot be put into bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{field} is {value}; Firmata has room for {least} to {most}")]
pub struct FirmataError {
    /// Name of the field that does not fit.
    pub field: &'static str,
    /// Value of the field.
    pub value: i64,
    /// The least that fits.
    pub least: i64,
    /// The most that fits.
    pub most: i64,
}

/// One direction's messages.
pub trait Message: Sized {
    /// Number of bytes of data after a status byte; `None` where no message begins with it.
    fn data_length(status: u8) -> Option<usize>;

    /// The message of a status byte and its data, the missing ones 0; `None` if there is no such
    /// message.
    fn from_short(status: u8, data: [u8; 2]) -> Option<Self>;

    /// The message of the payload between F0 and F7, all below 0x80; `None` if there is no such
    /// message.
    fn from_sysex(payload: &[u8]) -> Option<Self>;

    /// Appends its bytes.
    ///
    /// # Errors
    ///
    /// [`FirmataError`] where a number has no room in its message; nothing is appended then.
    fn encode(&self, into: &mut Vec<u8>) -> Result<(), FirmataError>;
}

/// Reads messages of one direction from a stream of bytes.
///
/// After any bytes it finds the next message: a byte of 0x80 or more begins a message, and ends the
/// message that it interrupts. It holds one message at most, of at most [`LONGEST`](Self::LONGEST)
/// bytes; a longer one is passed over.
#[derive(Clone, Debug)]
pub struct Decoder<M> {
    state: State,
    payload: Vec<u8>,
    rejected: u64,
    message: PhantomData<M>,
}

/// State of the decoder between two bytes of the stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Between,
    Short { status: u8, wanted: usize, data: [u8; 2], have: usize },
    Sysex,
    TooLong,
}

impl<M> Default for Decoder<M> {
    fn default() -> Self {
        let state = State::Between;
        let message = PhantomData;
        Self { state, payload: Vec::new(), rejected: 0, message }
    }
}

impl<M: Message> Decoder<M> {
    /// The most that may stand between F0 and F7: more than the capabilities of an Arduino Mega.
    pub const LONGEST: usize = 1024;

    /// Takes a byte; the message that it completes.
    pub fn push(&mut self, byte: u8) -> Option<M> {
        if byte >= 0x80 {
            return self.status(byte);
        }
        match &mut self.state {
            State::Between | State::TooLong => None,
            State::Sysex if self.payload.len() >= Self::LONGEST => {
                self.rejected += 1;
                self.state = State::TooLong;
                None
            }
            State::Sysex => {
                self.payload.push(byte);
                None
            }
            State::Short { status, wanted, data, have } => {
                if let Some(place) = data.get_mut(*have) {
                    *place = byte;
                }
                *have += 1;
                if *have < *wanted {
                    return None;
                }
                let message = M::from_short(*status, *data);
                self.state = State::Between;
                self.counted(message)
            }
        }
    }

    fn status(&mut self, byte: u8) -> Option<M> {
        let before = std::mem::replace(&mut self.state, State::Between);
        if byte == END_SYSEX && before != State::Between {
            let whole = before == State::Sysex;
            let message = if whole { M::from_sysex(&self.payload) } else { None };
            self.payload.clear();
            // One that was too long was counted when it was found to be.
            return if before == State::TooLong { None } else { self.counted(message) };
        }
        if matches!(before, State::Sysex | State::Short { .. }) {
            self.rejected += 1;
        }
        self.payload.clear();
        if byte == SYSEX {
            self.state = State::Sysex;
            return None;
        }
        match M::data_length(byte) {
            Some(0) => {
                let message = M::from_short(byte, [0; 2]);
                self.counted(message)
            }
            Some(wanted) => {
                self.state = State::Short { status: byte, wanted, data: [0; 2], have: 0 };
                None
            }
            None => {
                self.rejected += 1;
                None
            }
        }
    }

    fn counted(&mut self, message: Option<M>) -> Option<M> {
        self.rejected += u64::from(message.is_none());
        message
    }

    /// Number of messages that were cut, too long, or not of this direction.
    #[must_use]
    pub fn rejected(&self) -> u64 {
        self.rejected
    }
}

/// `value`, if it is at most `most`.
fn at_most(field: &'static str, value: u8, most: u8) -> Result<u8, FirmataError> {
    if value <= most {
        return Ok(value);
    }
    Err(FirmataError { field, value: value.into(), least: 0, most: most.into() })
}

/// Frames a payload.
fn sysex(payload: &[u8], into: &mut Vec<u8>) {
    into.push(SYSEX);
    into.extend_from_slice(payload);
    into.push(END_SYSEX);
}

/// A whole number: its magnitude, and its sign in bit 3 of the last byte.
fn encode_i32(field: &'static str, value: i32) -> Result<[u8; 5], FirmataError> {
    let magnitude = value.unsigned_abs();
    if magnitude > LARGEST {
        let most = i64::from(LARGEST);
        return Err(FirmataError { field, value: value.into(), least: -most, most });
    }
    let mut bytes = [0, 7, 14, 21, 28].map(|bit| low(magnitude >> bit));
    bytes[4] |= u8::from(value < 0) << 3;
    Ok(bytes)
}

/// `None` where bits are set that have no meaning.
fn decode_i32([a, b, c, d, last]: [u8; 5]) -> Option<i32> {
    if last > 0x0F {
        return None;
    }
    let magnitude = u32::from(a)
        | u32::from(b) << 7
        | u32::from(c) << 14
        | u32::from(d) << 21
        | u32::from(last & 0x07) << 28;
    let magnitude = i32::try_from(magnitude).ok()?;
    Some(if last & 0x08 == 0 { magnitude } else { -magnitude })
}

/// Every byte as two.
fn encode_text(text: &str, into: &mut Vec<u8>) {
    into.extend(text.bytes().flat_map(|byte| [byte & 0x7F, byte >> 7]));
}

/// `None` where half a byte is missing, or more than a byte is there. A byte that is no UTF-8
/// becomes a question mark: a text does not grow on the way, so what was read fits into a message
/// again.
fn decode_text(bytes: &[u8]) -> Option<String> {
    let (pairs, rest) = bytes.as_chunks::<2>();
    let byte = |[low, high]: &[u8; 2]| (*high < 2).then(|| low | high << 7);
    let text: Vec<u8> = pairs.iter().map(byte).collect::<Option<_>>()?;
    let readable =
        |chunk: Utf8Chunk<'_>| format!("{}{}", chunk.valid(), "?".repeat(chunk.invalid().len()));
    rest.is_empty().then(|| text.utf8_chunks().map(readable).collect())
}

fn low(bits: u32) -> u8 {
    u8::try_from(bits & 0x7F).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_one_number_without_room_is_refused() {
        let refused = encode_i32("steps", i32::MIN).expect_err("no room").to_string();
        assert!(refused.contains("steps is -2147483648"), "{refused}");
        assert_eq!(decode_i32([0, 0, 0, 0, 0x10]), None);
        assert_eq!(decode_i32([0, 0, 0, 0, 0x08]), Some(0), "minus nothing");
    }

    #[test]
    fn a_text_that_is_no_utf_8_keeps_its_length() {
        let bytes: Vec<u8> =
            b"a\xE9\xFFz".iter().flat_map(|byte| [byte & 0x7F, byte >> 7]).collect();
        assert_eq!(decode_text(&bytes).as_deref(), Some("a??z"));
    }

    proptest! {
        #[test]
        fn whole_numbers_and_back(value in -i32::MAX..=i32::MAX) {
            let bytes = encode_i32("value", value).expect("it has room");
            prop_assert!(bytes.iter().all(|byte| *byte < 0x80));
            prop_assert_eq!(decode_i32(bytes), Some(value));
        }

        #[test]
        fn texts_and_back(text in "\\PC*") {
            let mut bytes = Vec::new();
            encode_text(&text, &mut bytes);
            prop_assert!(bytes.iter().all(|byte| *byte < 0x80));
            prop_assert_eq!(decode_text(&bytes), Some(text));
        }
    }
}
