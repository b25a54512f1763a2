use std::io;

use foxhunt_core::Clock;
use foxhunt_wire::{ByteStream, Endpoint};

/// How long after a failure an endpoint is opened again, in seconds.
const RETRY_S: f64 = 1.0;

/// An endpoint that is opened again when it failed: a cable that was pulled and put back.
pub struct Reconnecting<C> {
    endpoint: Endpoint,
    clock: C,
    stream: Option<Box<dyn ByteStream>>,
    connections: u32,
    /// When it is tried again.
    retry_at: f64,
    /// What it said last.
    failure: String,
}

impl<C> std::fmt::Debug for Reconnecting<C> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Reconnecting")
            .field("endpoint", &self.endpoint)
            .field("open", &self.stream.is_some())
            .field("connections", &self.connections)
            .finish_non_exhaustive()
    }
}

impl<C: Clock> Reconnecting<C> {
    /// Opens `endpoint`.
    ///
    /// # Errors
    ///
    /// Whatever the system says, with the name of the port or address.
    pub fn open(endpoint: Endpoint, clock: C) -> io::Result<Self> {
        let stream = Some(endpoint.open()?);
        let failure = String::new();
        Ok(Self { endpoint, clock, stream, connections: 1, retry_at: 0.0, failure })
    }

    fn with<T>(&mut self, act: impl FnOnce(&mut dyn ByteStream) -> io::Result<T>) -> io::Result<T> {
        let now = self.clock.now();
        if self.stream.is_none() {
            if now < self.retry_at {
                let text = format!("{} is gone: {}", self.endpoint, self.failure);
                return Err(io::Error::new(io::ErrorKind::NotConnected, text));
            }
            match self.endpoint.open() {
                Ok(stream) => {
                    self.stream = Some(stream);
                    self.connections = self.connections.saturating_add(1);
                }
                Err(error) => return Err(self.failed(now, error)),
            }
        }
        let Some(stream) = &mut self.stream else { unreachable!("it was opened above") };
        match act(stream.as_mut()) {
            // Nobody there yet, or no room now, is no reason to open it again.
            Err(error)
                if !matches!(
                    error.kind(),
                    io::ErrorKind::NotConnected | io::ErrorKind::WouldBlock
                ) =>
            {
                self.stream = None;
                Err(self.failed(now, error))
            }
            other => other,
        }
    }

    fn failed(&mut self, now: f64, error: io::Error) -> io::Error {
        self.retry_at = now + RETRY_S;
        self.failure = error.to_string();
        error
    }
}

impl<C: Clock> ByteStream for Reconnecting<C> {
    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
        self.with(|stream| stream.receive(into))
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.with(|stream| stream.send(bytes))
    }

    fn connections(&self) -> u32 {
        self.connections
    }
}
