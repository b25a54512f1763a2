//! TCP, as a client and as a server of one client.

use std::{
    io::{self, Read, Write},
    net::{self, SocketAddr, TcpListener, ToSocketAddrs},
    time::Duration,
};

use super::{ByteStream, taken};

/// Maximum time for a server to accept a connection.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(2);

/// A TCP connection.
#[derive(Debug)]
pub struct TcpStream {
    stream: net::TcpStream,
    name: String,
}

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

/// A TCP port of this machine that serves one client at a time: the latest.
#[derive(Debug)]
pub struct TcpServerStream {
    listener: TcpListener,
    client: Option<TcpStream>,
    connections: u32,
}

impl TcpServerStream {
    /// Listens at `address`.
    ///
    /// # Errors
    ///
    /// Any error of the system, with the address.
    pub fn listen(address: &str) -> io::Result<Self> {
        let named = |error: io::Error| io::Error::new(error.kind(), format!("{address}: {error}"));
        let listener = TcpListener::bind(address).map_err(named)?;
        listener.set_nonblocking(true)?;
        Ok(Self { listener, client: None, connections: 0 })
    }

    /// Address at which it listens.
    ///
    /// # Errors
    ///
    /// Any error of the system.
    pub fn local_address(&self) -> io::Result<SocketAddr> {
        self.listener.local_addr()
    }

    /// Takes the client that has come last, if one has.
    fn accept(&mut self) -> io::Result<()> {
        use io::ErrorKind::{ConnectionAborted, Interrupted, WouldBlock};
        loop {
            match self.listener.accept() {
                Ok((client, _)) => {
                    self.client = Some(TcpStream::accepted(client)?);
                    self.connections = self.connections.saturating_add(1);
                }
                Err(error) if error.kind() == WouldBlock => return Ok(()),
                // A client that went before it was met.
                Err(error) if matches!(error.kind(), ConnectionAborted | Interrupted) => {}
                Err(error) => return Err(error),
            }
        }
    }
}

impl ByteStream for TcpServerStream {
    /// A client that goes is no error: the next one may come.
    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
        self.accept()?;
        let Some(client) = &mut self.client else { return Ok(0) };
        Ok(client.receive(into).unwrap_or_else(|_| {
            self.client = None;
            0
        }))
    }

    /// A client that takes nothing any more is let go.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.accept()?;
        let none = || io::Error::new(io::ErrorKind::NotConnected, "nobody has connected");
        self.client.as_mut().ok_or_else(none)?.send(bytes).map_err(|_| {
            self.client = None;
            none()
        })
    }

    /// Number of clients so far; 0 before the first.
    fn connections(&self) -> u32 {
        self.connections
    }
}

#[cfg(test)]
mod tests {
    use std::thread;

    use super::*;

    /// Returns the first bytes that come within a second.
    fn next(stream: &mut dyn ByteStream) -> Vec<u8> {
        let mut into = [0; 16];
        for _ in 0..1000 {
            match stream.receive(&mut into).expect("it is open") {
                0 => thread::sleep(Duration::from_millis(1)),
                count => return into[..count].to_vec(),
            }
        }
        Vec::new()
    }

    #[test]
    fn clients_are_served_one_after_the_other() {
        let mut server = TcpServerStream::listen("127.0.0.1:0").expect("a free port");
        let address = server.local_address().expect("bound").to_string();
        let nobody = server.send(b"early").expect_err("nobody is there");
        assert_eq!((nobody.kind(), server.connections()), (io::ErrorKind::NotConnected, 0));
        for client_number in 1..=2 {
            let mut client = TcpStream::connect(&address).expect("it listens");
            client.send(b"question").expect("connected");
            assert_eq!(next(&mut server), b"question");
            assert_eq!(server.connections(), client_number);
            server.send(b"answer").expect("connected");
            assert_eq!(next(&mut client), b"answer");
        }
        assert_eq!(next(&mut server), b"", "both have gone, which is no error");
        assert!(TcpServerStream::listen(&address).is_err_and(|e| e.to_string().contains(&address)));
    }
}
