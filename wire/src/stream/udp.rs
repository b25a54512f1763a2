use std::{
    io,
    net::{SocketAddr, ToSocketAddrs, UdpSocket},
};

use super::ByteStream;

/// Datagrams to and from one peer: a known one, or whoever spoke last.
#[derive(Debug)]
pub struct UdpStream {
    socket: UdpSocket,
    peer: Option<SocketAddr>,
    /// Whether whoever speaks is the peer.
    learns: bool,
}

impl UdpStream {
    /// Listens at `address`, and answers whoever spoke last.
    ///
    /// # Errors
    ///
    /// Any error of the system, with the address.
    pub fn listen(address: &str) -> io::Result<Self> {
        Ok(Self { socket: bound(address)?, peer: None, learns: true })
    }

    /// A socket that sends to `address`, and receives from it alone.
    ///
    /// # Errors
    ///
    /// Any error of the system, with the address.
    pub fn to(address: &str) -> io::Result<Self> {
        let named = |error: io::Error| io::Error::new(error.kind(), format!("{address}: {error}"));
        let mut peers = address.to_socket_addrs().map_err(named)?;
        let none = || io::Error::new(io::ErrorKind::NotFound, format!("{address}: no such host"));
        let peer = peers.next().ok_or_else(none)?;
        let any = if peer.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" };
        Ok(Self { socket: bound(any)?, peer: Some(peer), learns: false })
    }

    /// Where it listens.
    ///
    /// # Errors
    ///
    /// Any error of the system.
    pub fn local_address(&self) -> io::Result<SocketAddr> {
        self.socket.local_addr()
    }
}

/// How many datagrams of others are thrown away at once.
const STRANGERS: usize = 64;

fn bound(address: &str) -> io::Result<UdpSocket> {
    let named = |error: io::Error| io::Error::new(error.kind(), format!("{address}: {error}"));
    let socket = UdpSocket::bind(address).map_err(named)?;
    socket.set_nonblocking(true)?;
    Ok(socket)
}

impl ByteStream for UdpStream {
    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
        use io::ErrorKind::{ConnectionRefused, ConnectionReset, Interrupted, WouldBlock};
        // A stranger that floods the port keeps nobody here.
        for _ in 0..STRANGERS {
            match self.socket.recv_from(into) {
                Ok((count, from)) if self.learns => {
                    self.peer = Some(from);
                    return Ok(count);
                }
                Ok((count, from)) if self.peer == Some(from) => return Ok(count),
                Ok(_) => {}
                // What was sent before found nobody; the peer may come yet.
                Err(error) if matches!(error.kind(), ConnectionRefused | ConnectionReset) => {}
                Err(error) if matches!(error.kind(), WouldBlock | Interrupted) => return Ok(0),
                Err(error) => return Err(error),
            }
        }
        Ok(0)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let peer = self.peer.ok_or_else(|| {
            io::Error::new(io::ErrorKind::NotConnected, "nobody has spoken to this port yet")
        })?;
        match self.socket.send_to(bytes, peer) {
            Err(error) if error.kind() == io::ErrorKind::ConnectionRefused => Ok(()),
            other => other.map(|_| ()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_listener_answers_whoever_spoke_last() {
        let mut server = UdpStream::listen("127.0.0.1:0").expect("it works");
        assert_eq!(
            server.send(&[1]).expect_err("it is refused").kind(),
            io::ErrorKind::NotConnected
        );
        let address = server.local_address().expect("it works").to_string();
        let (mut first, mut second) = (
            UdpStream::to(&address).expect("it works"),
            UdpStream::to(&address).expect("it works"),
        );
        let mut into = [0; 8];
        for (client, word) in [(&mut first, b"one"), (&mut second, b"two")] {
            client.send(word).expect("it works");
            assert_eq!(server.receive(&mut into).expect("it works"), 3);
            server.send(&into[..3]).expect("it works");
            let mut back = [0; 8];
            assert_eq!((client.receive(&mut back).expect("it works"), &back[..3]), (3, &word[..]));
        }
        assert_eq!(first.receive(&mut into).expect("it works"), 0, "nothing more");
        assert!(UdpStream::to("nowhere").is_err());
    }
}
