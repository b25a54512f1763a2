//! Streams of bytes that never block.

mod endpoint;
#[cfg(unix)]
mod pty;
mod shared;
mod tcp;
mod udp;

use std::{
    cell::RefCell,
    collections::VecDeque,
    io,
    net::SocketAddr,
    rc::{Rc, Weak},
};

pub use endpoint::{Endpoint, EndpointError, SerialStream};
#[cfg(unix)]
pub use pty::PtyStream;
pub use shared::{SharedPort, SharedStream};
pub use tcp::{TcpServerStream, TcpStream};
pub use udp::UdpStream;

/// A stream of bytes, or of datagrams, to and from a device. It never waits for the other side.
///
/// An error means that the device is gone for now; a stream that [comes back](Self::connections)
/// may be used again.
///
/// A stream that keeps a record of what is sent over another one:
///
/// ```
/// use std::io;
///
/// use foxhunt_wire::{ByteStream, memory_pair};
///
/// struct Recorded<S> {
///     stream: S,
///     sent: Vec<u8>,
/// }
///
/// impl<S: ByteStream> ByteStream for Recorded<S> {
///     fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
///         self.stream.receive(into)
///     }
///
///     fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
///         self.sent.extend(bytes);
///         self.stream.send(bytes)
///     }
///
///     fn connections(&self) -> u32 {
///         self.stream.connections()
///     }
/// }
///
/// let (near, mut far) = memory_pair();
/// let mut stream = Recorded { stream: near, sent: Vec::new() };
/// stream.send(b"ATDB\r")?;
/// let mut into = [0; 16];
/// assert_eq!(far.receive(&mut into)?, 5);
/// assert_eq!(stream.sent, b"ATDB\r");
/// assert_eq!(stream.receive(&mut into)?, 0, "nothing has come");
/// # Ok::<(), io::Error>(())
/// ```
pub trait ByteStream {
    /// Takes received bytes, at most as many as `into` holds, and returns their number; 0 where
    /// there is nothing now. A datagram that is longer than `into` is cut.
    ///
    /// # Errors
    ///
    /// Any error of the port; an end of the stream is [`io::ErrorKind::UnexpectedEof`].
    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize>;

    /// Sends all of `bytes`, as one datagram where there are datagrams.
    ///
    /// # Errors
    ///
    /// Any error of the port. [`io::ErrorKind::NotConnected`] while nobody is known at the other
    /// end.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Number of times that it was opened. A driver that finds another number than before sets its
    /// device up again: it may have lost its power in between.
    fn connections(&self) -> u32 {
        1
    }

    /// Gives its other end up and opens it again, as if it had been lost: bytes still on their way
    /// from there are dropped. Has no effect unless overridden: for streams that cannot be opened
    /// again.
    fn renew(&mut self) {}

    /// Returns true if received bytes may come from anybody: each receipt is then a datagram of its
    /// own, which is not to be joined to another one. Streams that have one other end are not open.
    fn is_open(&self) -> bool {
        false
    }

    /// Makes the last sender the only one that is received and answered. Without effect where there
    /// is one other end.
    ///
    /// # Errors
    ///
    /// Any error of the port, which is open then as before.
    fn pin(&mut self) -> io::Result<()> {
        Ok(())
    }

    /// Opens it to anybody again. Bytes sent go to the last peer until another one is pinned.
    ///
    /// # Errors
    ///
    /// Any error of the port.
    fn unpin(&mut self) -> io::Result<()> {
        Ok(())
    }

    /// Returns the peer that was pinned last, to which answers go; `None` before the first, and for
    /// a stream with one other end.
    fn peer(&self) -> Option<SocketAddr> {
        None
    }

    /// Returns the sender of the last bytes received, if the stream is open.
    fn sender(&self) -> Option<SocketAddr> {
        None
    }
}

macro_rules! forward {
    ($pointer:ty) => {
        impl<T: ?Sized + ByteStream> ByteStream for $pointer {
            fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
                (**self).receive(into)
            }
            fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
                (**self).send(bytes)
            }
            fn connections(&self) -> u32 {
                (**self).connections()
            }
            fn renew(&mut self) {
                (**self).renew();
            }
            fn is_open(&self) -> bool {
                (**self).is_open()
            }
            fn pin(&mut self) -> io::Result<()> {
                (**self).pin()
            }
            fn unpin(&mut self) -> io::Result<()> {
                (**self).unpin()
            }
            fn peer(&self) -> Option<SocketAddr> {
                (**self).peer()
            }
            fn sender(&self) -> Option<SocketAddr> {
                (**self).sender()
            }
        }
    };
}

forward!(&mut T);

forward!(Box<T>);

/// One end of a pair in memory: bytes are there as soon as they are sent.
#[derive(Debug)]
pub struct MemoryStream {
    inbox: Rc<RefCell<VecDeque<u8>>>,
    /// Gone when the other end is dropped: a pulled cable.
    outbox: Weak<RefCell<VecDeque<u8>>>,
}

impl ByteStream for MemoryStream {
    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let mut inbox = self.inbox.borrow_mut();
        let count = into.len().min(inbox.len());
        if count == 0 && self.outbox.strong_count() == 0 {
            return Err(ended("the pair"));
        }
        for (to, from) in into.iter_mut().zip(inbox.drain(..count)) {
            *to = from;
        }
        Ok(count)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        let outbox = self.outbox.upgrade().ok_or_else(|| ended("the pair"))?;
        outbox.borrow_mut().extend(bytes);
        Ok(())
    }
}

/// The end of a stream that ends when its device is gone.
fn ended(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::UnexpectedEof, format!("{what} was closed at its other end"))
}

/// The result of a read: nothing now is no error, and a stream that ended is one.
fn taken(read: io::Result<usize>, what: &str) -> io::Result<usize> {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    match read {
        Ok(0) => Err(ended(what)),
        Err(error) if matches!(error.kind(), WouldBlock | TimedOut | Interrupted) => Ok(0),
        other => other,
    }
}

/// Two ends, each of which receives the bytes sent at the other.
#[must_use]
pub fn memory_pair() -> (MemoryStream, MemoryStream) {
    let a = Rc::default();
    let b = Rc::default();
    let to_a = Rc::downgrade(&a);
    let to_b = Rc::downgrade(&b);
    (MemoryStream { inbox: a, outbox: to_b }, MemoryStream { inbox: b, outbox: to_a })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_sent_is_received_once_and_a_pulled_end_is_reported() {
        let (mut here, mut there) = memory_pair();
        let mut into = [0; 2];
        assert_eq!(there.receive(&mut into).expect("it works"), 0);
        here.send(&[1, 2, 3]).expect("it works");
        assert_eq!((there.receive(&mut into).expect("it works"), into), (2, [1, 2]));
        assert_eq!((there.receive(&mut into).expect("it works"), into[0]), (1, 3));
        here.send(&[4]).expect("it works");
        drop(here);
        assert_eq!(
            (there.receive(&mut into).expect("it works"), into[0]),
            (1, 4),
            "it was delivered"
        );
        assert_eq!(
            there.receive(&mut into).expect_err("it is refused").kind(),
            io::ErrorKind::UnexpectedEof
        );
        assert!(there.send(&[5]).is_err());
    }
}
