use std::io;

use foxhunt_wire::{
    ByteStream,
    firmata::{Decoder, Message, Reply, Request, StepperRequest},
};

/// Messages to and from the Arduino. A motor that turns is stopped when it is dropped.
#[derive(Debug)]
pub(super) struct Link<S: ByteStream> {
    stream: S,
    device: u8,
    decoder: Decoder<Reply>,
    connections: u32,
    bytes: u64,
    /// Queries of the position whose answers have not come.
    unanswered: u32,
    /// Queries since the last answer.
    silent: u32,
    /// True if the motor was sent somewhere, and is not known to stand.
    may_turn: bool,
}

/// More than this is not taken in at once, so that a stream that never ends does not hold up
/// anyone.
const MOST_READS: usize = 64;
/// Number of times that the last stop is sent, as no answer is awaited.
const LAST_STOPS: u32 = 3;

impl<S: ByteStream> Link<S> {
    pub(super) fn new(stream: S, device: u8) -> Self {
        let connections = stream.connections();
        let decoder = Decoder::default();
        Self {
            stream,
            device,
            decoder,
            connections,
            bytes: 0,
            unanswered: 0,
            silent: 0,
            may_turn: false,
        }
    }

    /// Returns the replies that have come.
    pub(super) fn receive(&mut self) -> io::Result<Vec<Reply>> {
        let mut replies = Vec::new();
        let mut into = [0; 256];
        for _ in 0..MOST_READS {
            let count = self.stream.receive(&mut into)?;
            if count == 0 {
                break;
            }
            self.bytes = self.bytes.saturating_add(u64::try_from(count).unwrap_or(u64::MAX));
            let bytes = into.iter().take(count);
            replies.extend(bytes.filter_map(|byte| self.decoder.push(*byte)));
        }
        Ok(replies)
    }

    /// Returns true if the stream was opened again since the last call.
    pub(super) fn was_reopened(&mut self) -> bool {
        let before = std::mem::replace(&mut self.connections, self.stream.connections());
        before != self.connections
    }

    pub(super) fn send(&mut self, request: Request) -> io::Result<()> {
        let mut bytes = Vec::new();
        let invalid = |error| io::Error::new(io::ErrorKind::InvalidInput, error);
        request.encode(&mut bytes).map_err(invalid)?;
        self.stream.send(&bytes)
    }

    pub(super) fn order(&mut self, request: StepperRequest) -> io::Result<()> {
        match request {
            StepperRequest::Report => {
                self.unanswered = self.unanswered.saturating_add(1);
                self.silent = self.silent.saturating_add(1);
            }
            StepperRequest::To(_) => self.may_turn = true,
            _ => {}
        }
        self.send(Request::Stepper { device: self.device, request })
    }

    /// Counts an answer to a query of the position.
    pub(super) fn was_answered(&mut self) {
        self.unanswered = self.unanswered.saturating_sub(1);
        self.silent = 0;
    }

    /// Returns the number of queries of the position since the last one that was answered.
    pub(super) fn silent(&self) -> u32 {
        self.silent
    }

    /// Returns the number of open queries of the position: one may have been garbled into an order.
    pub(super) fn unanswered(&self) -> u32 {
        self.unanswered
    }

    /// Waits for no answer to older queries any more.
    pub(super) fn forget_queries(&mut self) {
        self.unanswered = 0;
    }

    pub(super) fn may_turn(&self) -> bool {
        self.may_turn
    }

    /// The motor is known to stand.
    pub(super) fn has_stopped(&mut self) {
        self.may_turn = false;
    }

    /// Returns the number of bytes that have come.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Returns the number of unreadable messages.
    pub(super) fn rejected(&self) -> u64 {
        self.decoder.rejected()
    }
}

impl<S: ByteStream> Drop for Link<S> {
    fn drop(&mut self) {
        if self.may_turn {
            for _ in 0..LAST_STOPS {
                // Nobody is left to whom a failure could be returned.
                let _ = self.order(StepperRequest::Stop);
            }
        }
    }
}
