use std::{
    io,
    net::{SocketAddr, ToSocketAddrs, UdpSocket},
};

use super::ByteStream;

/// Datagrams to and from one peer: a known one, or the last sender until one is pinned. Opened
/// again it receives from anybody, and sends to the peer that was pinned until another one is.
///
/// To a pinned peer the socket is connected, so that the system itself drops what others send, and
/// a stranger's flood takes neither time nor room.
#[derive(Debug)]
pub struct UdpStream {
    socket: UdpSocket,
    peer: Option<SocketAddr>,
    /// True if any sender becomes the peer.
    learns: bool,
    /// True if the socket is connected to the peer.
    pinned: bool,
    /// True if the peer was pinned before, and still gets the answers.
    kept: bool,
    /// The sender of the last datagram.
    sender: Option<SocketAddr>,
    /// The address at which it listens to any sender.
    address: SocketAddr,
}

impl UdpStream {
    /// Listens at `address`, and answers the last sender, or the one [pinned](ByteStream::pin).
    ///
    /// # Errors
    ///
    /// Any error of the system, with the address.
    pub fn listen(address: &str) -> io::Result<Self> {
        let socket = bound(address)?;
        let address = socket.local_addr()?;
        let peer = None;
        let sender = None;
        Ok(Self { socket, peer, learns: true, pinned: false, kept: false, sender, address })
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
        let socket = bound(any)?;
        let address = socket.local_addr()?;
        let peer = Some(peer);
        let sender = None;
        Ok(Self { socket, peer, learns: false, pinned: false, kept: false, sender, address })
    }

    /// Address at which it listens.
    ///
    /// # Errors
    ///
    /// Any error of the system.
    pub fn local_address(&self) -> io::Result<SocketAddr> {
        self.socket.local_addr()
    }
}

/// Any free port of this machine alone.
const ANY: &str = "127.0.0.1:0";

/// Maximum number of other senders' datagrams that are thrown away at once.
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
                Ok((count, from)) if self.learns && !self.pinned => {
                    self.sender = Some(from);
                    if !self.kept {
                        self.peer = Some(from);
                    }
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
        let sent = match self.pinned {
            true => self.socket.send(bytes),
            false => self.socket.send_to(bytes, peer),
        };
        match sent {
            Err(error) if error.kind() == io::ErrorKind::ConnectionRefused => Ok(()),
            other => other.map(|_| ()),
        }
    }

    fn is_open(&self) -> bool {
        self.learns && !self.pinned
    }

    fn pin(&mut self) -> io::Result<()> {
        if let (Some(peer), true) = (self.sender, self.is_open()) {
            self.socket.connect(peer)?;
            (self.peer, self.pinned, self.kept) = (Some(peer), true, true);
        }
        Ok(())
    }

    fn unpin(&mut self) -> io::Result<()> {
        if self.pinned {
            // There is no way back from a connected socket that all systems have. The port is free
            // once the old one is closed; where it cannot be had it is tried again.
            self.socket = bound(ANY)?;
            self.socket = bound(&self.address.to_string())?;
            (self.pinned, self.sender) = (false, None);
        }
        Ok(())
    }

    fn peer(&self) -> Option<SocketAddr> {
        self.peer.filter(|_| self.kept)
    }

    fn sender(&self) -> Option<SocketAddr> {
        self.sender.filter(|_| self.is_open())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_listener_answers_the_last_sender() {
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

    #[test]
    fn a_pinned_peer_is_alone_until_it_is_let_go() {
        let mut server = UdpStream::listen("127.0.0.1:0").expect("it works");
        let address = server.local_address().expect("it works").to_string();
        let mut into = [0; 8];
        let open = || UdpStream::to(&address).expect("it works");
        let mut peer = open();
        let mut stranger = open();
        peer.send(b"peer").expect("it works");
        assert_eq!(server.receive(&mut into).expect("it works"), 4);
        server.pin().expect("it works");
        // More than the system keeps for a socket.
        for _ in 0..10_000 {
            stranger.send(b"x").expect("it works");
        }
        peer.send(b"again").expect("it works");
        assert_eq!(server.receive(&mut into).expect("it works"), 5, "nothing of the flood");
        server.send(b"answer").expect("it works");
        assert_eq!(stranger.receive(&mut into).expect("it works"), 0);
        assert_eq!(peer.receive(&mut into).expect("it works"), 6);
        let first = server.peer();
        server.unpin().expect("it works");
        stranger.send(b"me").expect("it works");
        assert_eq!(server.receive(&mut into).expect("it works"), 2);
        assert!(server.sender().is_some() && server.sender() != server.peer());
        // The one that was pinned is answered until another one is.
        server.send(b"you").expect("it works");
        assert_eq!(peer.receive(&mut into).expect("it works"), 3);
        assert_eq!(stranger.receive(&mut into).expect("it works"), 0);
        // The peer comes back at the same port.
        peer.send(b"peer").expect("it works");
        assert_eq!(server.receive(&mut into).expect("it works"), 4);
        assert!(first.is_some() && server.sender() == first);
        stranger.send(b"me").expect("it works");
        assert_eq!(server.receive(&mut into).expect("it works"), 2);
        server.pin().expect("it works");
        server.send(b"you").expect("it works");
        assert_eq!(stranger.receive(&mut into).expect("it works"), 3);
        assert!(server.peer() != first);
    }
}
