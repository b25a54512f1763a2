use std::{
    io,
    sync::mpsc::{self, Receiver, TryRecvError},
    thread,
};

use foxhunt_core::Clock;
use foxhunt_wire::{ByteStream, Endpoint};

/// Pause in seconds after a failure before an endpoint is opened again.
const RETRY_S: f64 = 1.0;

type Opened = io::Result<Box<dyn ByteStream + Send>>;

/// An endpoint that is opened again when it failed: a cable that was pulled and put back.
///
/// It is opened again by a thread of its own, which ends when the system has answered: a host that
/// is switched off keeps nobody waiting.
pub struct Reconnecting<C> {
    endpoint: Endpoint,
    clock: C,
    stream: Option<Box<dyn ByteStream + Send>>,
    opening: Option<Receiver<Opened>>,
    connections: u32,
    /// Time of the next attempt.
    retry_at: f64,
    /// Last error of the endpoint.
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
    /// Any error of the system, with the name of the port or address.
    pub fn open(endpoint: Endpoint, clock: C) -> io::Result<Self> {
        let stream = Some(endpoint.open()?);
        let failure = String::new();
        Ok(Self { endpoint, clock, stream, opening: None, connections: 1, retry_at: 0.0, failure })
    }

    fn with<T>(&mut self, act: impl FnOnce(&mut dyn ByteStream) -> io::Result<T>) -> io::Result<T> {
        let now = self.clock.now();
        if self.stream.is_none() {
            self.reopen(now)?;
        }
        let Some(stream) = &mut self.stream else { return Err(self.gone()) };
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

    /// Goes on with opening it again; an error where that has failed.
    fn reopen(&mut self, now: f64) -> io::Result<()> {
        let Some(opening) = &self.opening else {
            if now >= self.retry_at {
                let (endpoint, (sender, opening)) = (self.endpoint.clone(), mpsc::channel());
                // The receiver may be gone by the time it is open.
                thread::spawn(move || sender.send(endpoint.open()));
                self.opening = Some(opening);
            }
            return Ok(());
        };
        let opened = match opening.try_recv() {
            Err(TryRecvError::Empty) => return Ok(()),
            Err(TryRecvError::Disconnected) => Err(io::Error::other("it could not be opened")),
            Ok(opened) => opened,
        };
        self.opening = None;
        match opened {
            Ok(stream) => {
                self.stream = Some(stream);
                self.connections = self.connections.saturating_add(1);
                Ok(())
            }
            Err(error) => Err(self.failed(now, error)),
        }
    }

    fn gone(&self) -> io::Error {
        let text = format!("{} is gone: {}", self.endpoint, self.failure);
        io::Error::new(io::ErrorKind::NotConnected, text)
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

    fn renew(&mut self) {
        if self.stream.take().is_some() {
            self.failure = "it was given up".to_owned();
            self.retry_at = self.clock.now();
        }
    }

    fn is_open(&self) -> bool {
        self.stream.as_ref().is_some_and(|stream| stream.is_open())
    }

    fn pin(&mut self) -> io::Result<()> {
        self.with(|stream| stream.pin())
    }

    fn unpin(&mut self) -> io::Result<()> {
        self.with(|stream| stream.unpin())
    }

    fn peer(&self) -> Option<std::net::SocketAddr> {
        self.stream.as_ref()?.peer()
    }

    fn sender(&self) -> Option<std::net::SocketAddr> {
        self.stream.as_ref()?.sender()
    }
}
