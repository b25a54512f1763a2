use std::io;

use foxhunt_wire::{
    ByteStream,
    firmata::{Decoder, Message, Reply, Request, StepperRequest},
};

/// Messages to and from the Arduino.
#[derive(Debug)]
pub(super) struct Link<S> {
    stream: S,
    device: u8,
    decoder: Decoder<Reply>,
    connections: u32,
}

/// More than this is not taken in at once, so that a stream that never ends does not hold up
/// anyone.
const MOST_READS: usize = 64;

impl<S: ByteStream> Link<S> {
    pub(super) fn new(stream: S, device: u8) -> Self {
        let connections = stream.connections();
        Self { stream, device, decoder: Decoder::default(), connections }
    }

    /// What has come.
    pub(super) fn receive(&mut self) -> io::Result<Vec<Reply>> {
        let (mut replies, mut into) = (Vec::new(), [0; 256]);
        for _ in 0..MOST_READS {
            let count = self.stream.receive(&mut into)?;
            if count == 0 {
                break;
            }
            let bytes = into.iter().take(count);
            replies.extend(bytes.filter_map(|byte| self.decoder.push(*byte)));
        }
        Ok(replies)
    }

    /// Whether it was opened again since the last call.
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
        self.send(Request::Stepper { device: self.device, request })
    }

    /// How many messages were unreadable.
    pub(super) fn rejected(&self) -> u64 {
        self.decoder.rejected()
    }
}
