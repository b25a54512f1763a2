use std::io;

use foxhunt_wire::{
    ByteStream,
    xbee::{ApiMode, Decoder, Frame},
};

use super::XbeeError;

/// Time in seconds after which a frame that stops in the middle was cut.
const QUIET_S: f64 = 0.1;
/// Bytes in one read, and most reads in one poll, so that it ends.
const CHUNK: usize = 512;
const CHUNKS: usize = 32;

/// The radio's end of the serial line.
#[derive(Debug)]
pub(super) struct Link<S> {
    pub(super) stream: S,
    decoder: Decoder,
    connections: u32,
    received_at: f64,
    last_id: u8,
    /// Number of broken frames; then bytes outside of frames on decoders before this one.
    pub(super) bad_frames: u64,
    skipped_before: u64,
}

impl<S: ByteStream> Link<S> {
    pub(super) fn new(stream: S) -> Self {
        let connections = stream.connections();
        let decoder = Decoder::new(ApiMode::Escaped);
        Self {
            stream,
            decoder,
            connections,
            received_at: 0.0,
            last_id: 1,
            bad_frames: 0,
            skipped_before: 0,
        }
    }

    /// Returns true if the stream was opened again since the last call.
    pub(super) fn reopened(&mut self) -> bool {
        let connections = self.stream.connections();
        let reopened = connections != self.connections;
        self.connections = connections;
        reopened
    }

    /// Reads and writes frames in another way from now on.
    pub(super) fn set_mode(&mut self, mode: ApiMode) {
        self.skipped_before = self.skipped();
        self.decoder = Decoder::new(mode);
    }

    pub(super) fn mode(&self) -> ApiMode {
        self.decoder.mode()
    }

    /// Returns the number of bytes that belonged to no frame.
    pub(super) fn skipped(&self) -> u64 {
        self.skipped_before + self.decoder.skipped()
    }

    /// Returns the bytes that have come. A failure after some bytes is returned the next time.
    pub(super) fn read(&mut self) -> Result<Vec<u8>, XbeeError> {
        let mut bytes = Vec::new();
        let mut chunk = [0; CHUNK];
        for _ in 0..CHUNKS {
            match self.stream.receive(&mut chunk) {
                Ok(0) => break,
                Ok(count) => bytes.extend(chunk.iter().take(count)),
                Err(_) if !bytes.is_empty() => break,
                Err(error) => return Err(XbeeError::Stream(error)),
            }
        }
        Ok(bytes)
    }

    /// The frames that are complete with these bytes.
    pub(super) fn frames(&mut self, bytes: &[u8], now: f64) -> Vec<Frame> {
        let mut decoded = Vec::new();
        if bytes.is_empty() {
            if self.decoder.is_waiting() && now - self.received_at > QUIET_S {
                decoded = self.decoder.give_up();
            }
        } else {
            self.received_at = now;
            decoded = self.decoder.push(bytes);
        }
        let wrong = decoded.iter().filter(|outcome| outcome.is_err()).count();
        self.bad_frames += u64::try_from(wrong).unwrap_or(u64::MAX);
        decoded.into_iter().flatten().collect()
    }

    /// Writes a frame.
    pub(super) fn send(&mut self, frame: &Frame) -> Result<(), XbeeError> {
        let bytes = frame
            .encode(self.decoder.mode())
            .map_err(|error| io::Error::new(io::ErrorKind::InvalidInput, error));
        bytes.and_then(|bytes| self.stream.send(&bytes)).map_err(XbeeError::Stream)
    }

    /// A number for a question, unlike the last 254; 0 would request no answer, and 1 belongs to
    /// the first question of all.
    pub(super) fn id(&mut self) -> u8 {
        self.last_id = if self.last_id == u8::MAX { 2 } else { self.last_id + 1 };
        self.last_id
    }
}
