use std::{io, net::SocketAddr};

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

    /// Gives its other end up and opens it again, as if it had been lost: what is still on its way
    /// from there is dropped. Without effect, unless overridden, where it cannot be opened again.
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

    /// Returns the peer that was pinned last, which is the one that is answered; `None` before the
    /// first, and where there is one other end.
    fn peer(&self) -> Option<SocketAddr> {
        None
    }

    /// Returns the sender of the last bytes received, where it is open.
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

/// The end of a stream that ends when its device is gone.
pub(super) fn ended(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::UnexpectedEof, format!("{what} was closed at its other end"))
}

/// The result of a read: nothing now is no error, and a stream that ended is one.
pub(super) fn taken(read: io::Result<usize>, what: &str) -> io::Result<usize> {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    match read {
        Ok(0) => Err(ended(what)),
        Err(error) if matches!(error.kind(), WouldBlock | TimedOut | Interrupted) => Ok(0),
        other => other,
    }
}
