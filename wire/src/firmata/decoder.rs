use std::marker::PhantomData;

use super::{
    Message,
    message::{END_SYSEX, SYSEX},
};

/// Reads messages of one direction from a stream of bytes.
///
/// Whatever comes, it finds the next message after it: a byte of 0x80 or more begins a message, and
/// ends the one that it cut. It holds one message at most, of at most [`LONGEST`](Self::LONGEST)
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
