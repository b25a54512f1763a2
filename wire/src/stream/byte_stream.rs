use std::io;

/// A stream of bytes, or of datagrams, to and from a device. It never waits for the other side.
///
/// An error means that the device is gone for now; a stream that [comes back](Self::connections) may
/// be asked again.
pub trait ByteStream {
    /// Takes what has come, at most as much as `into` holds; 0 where there is nothing now. A
    /// datagram that is longer than `into` is cut.
    ///
    /// # Errors
    ///
    /// Whatever the port says; an end of the stream is [`io::ErrorKind::UnexpectedEof`].
    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize>;

    /// Sends all of `bytes`, as one datagram where there are datagrams.
    ///
    /// # Errors
    ///
    /// Whatever the port says. [`io::ErrorKind::NotConnected`] while nobody is known at the other
    /// end.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// How often it was opened. A driver that sees another number than before sets its device up
    /// anew: it may have lost its power in between.
    fn connections(&self) -> u32 {
        1
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
        }
    };
}

forward!(&mut T);
forward!(Box<T>);

/// The end of a stream that ends when its device is gone.
pub(super) fn ended(what: &str) -> io::Error {
    io::Error::new(io::ErrorKind::UnexpectedEof, format!("{what} was closed at its other end"))
}

/// What a read came to: nothing now is no error, and a stream that ended is one.
pub(super) fn taken(read: io::Result<usize>, what: &str) -> io::Result<usize> {
    use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
    match read {
        Ok(0) => Err(ended(what)),
        Err(error) if matches!(error.kind(), WouldBlock | TimedOut | Interrupted) => Ok(0),
        other => other,
    }
}
