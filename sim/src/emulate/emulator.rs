use std::io;

/// A device of a simulated world behind a stream of bytes.
pub trait Emulator {
    /// Takes what was sent to it, and sends what is due at the world's present time. Never
    /// blocks; to be called whenever time has passed, and as often as needed.
    ///
    /// # Errors
    ///
    /// Any error of its stream; it may be called again.
    fn serve(&mut self) -> io::Result<()>;
}
