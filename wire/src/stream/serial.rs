use std::{io, time::Duration};

use super::{ByteStream, byte_stream::taken};

/// A serial port: 8 data bits, no parity, one stop bit, no flow control. Reading never waits; a
/// port that takes nothing any more holds a write up for half a second before it fails.
#[derive(Debug)]
pub struct SerialStream {
    port: serial2::SerialPort,
    name: String,
}

/// Maximum time for a port to accept bytes before it counts as dead.
const WRITE_TIMEOUT: Duration = Duration::from_millis(500);

impl SerialStream {
    /// Opens a port such as `/dev/ttyUSB0` or `COM3`; bytes that had come in before are dropped.
    ///
    /// # Errors
    ///
    /// Any error of the system, with the port's name.
    pub fn open(name: &str, baud: u32) -> io::Result<Self> {
        let named = |error: io::Error| io::Error::new(error.kind(), format!("{name}: {error}"));
        let mut port = serial2::SerialPort::open(name, baud).map_err(named)?;
        port.set_read_timeout(Duration::ZERO).map_err(named)?;
        port.set_write_timeout(WRITE_TIMEOUT).map_err(named)?;
        port.discard_buffers().map_err(named)?;
        Ok(Self { port, name: name.to_owned() })
    }

    /// The ports that this machine has now.
    ///
    /// # Errors
    ///
    /// Any error of the system.
    pub fn available() -> io::Result<Vec<String>> {
        let mut ports: Vec<String> = serial2::SerialPort::available_ports()?
            .into_iter()
            .map(|path| path.to_string_lossy().into_owned())
            .collect();
        ports.sort();
        Ok(ports)
    }
}

impl ByteStream for SerialStream {
    fn receive(&mut self, into: &mut [u8]) -> io::Result<usize> {
        taken(self.port.read(into), &self.name)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.port.write_all(bytes)
    }
}
