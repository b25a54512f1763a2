use std::{
    io::{self, Read, Write},
    net::{self, ToSocketAddrs},
    time::Duration,
};

use super::{ByteStream, byte_stream::taken};

/// A TCP connection.
#[derive(Debug)]
pub struct TcpStream {
    stream: net::TcpStream,
    name: String,
}

/// Maximum time for a server to accept a connection.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(2);

impl TcpStream {
    /// Connects to `host:port`.
    ///
    /// # Errors
    ///
    /// Any error of the system, with the address.
    pub fn connect(address: &str) -> io::Result<Self> {
        let named = |error: io::Error| io::Error::new(error.kind(), format!("{address}: {error}"));
        let mut last = io::Error::new(io::ErrorKind::NotFound, format!("{address}: no such host"));
        for to in address.to_socket_addrs().map_err(named)? {
            match net::TcpStream::connect_timeout(&to, CONNECT_TIMEOUT) {
                Ok(stream) => return Self::accepted(stream).map_err(named),
                Err(error) => last = named(error),
            }
        }
        Err(last)
    }

    /// Takes over a connection that a server has accepted.
    ///
    /// # Errors
    ///
    /// Any error of the system.
    pub fn accepted(stream: net::TcpStream) -> io::Result<Self> {
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?;
        let name = stream.peer_addr().map_or_else(|_| "the peer".into(), |to| to.to_string());
        Ok(Self { stream, name })
    }
}

impl ByteStream for TcpStream {
    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
        taken(self.stream.read(into), &self.name)
    }

    /// A peer that takes nothing any more is an error, [`io::ErrorKind::WouldBlock`].
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.stream.write_all(bytes)
    }
}
