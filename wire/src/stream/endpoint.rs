//! Endpoints by their names, and the serial ports among them.

use std::{fmt, io, str::FromStr, time::Duration};

use serde::{Deserialize, Serialize};

use super::{ByteStream, TcpStream, UdpStream, taken};

/// Maximum time for a port to accept bytes before it counts as dead.
const WRITE_TIMEOUT: Duration = Duration::from_millis(500);

/// Address of a device, as it stands in configurations: `serial:/dev/ttyUSB0:57600`,
/// `tcp:127.0.0.1:5760`, `udpin:127.0.0.1:14550` (answer the last sender) or
/// `udpout:192.168.1.1:5556`.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
#[non_exhaustive]
pub enum Endpoint {
    /// A serial port.
    Serial {
        /// The system's name of the port.
        port: String,
        /// Bits per second.
        baud: u32,
    },
    /// A server.
    Tcp {
        /// Host and port.
        address: String,
    },
    /// A UDP port of this machine to which others send.
    UdpIn {
        /// Address and port.
        address: String,
    },
    /// A UDP peer to which this machine sends.
    UdpOut {
        /// Host and port.
        address: String,
    },
}

impl Endpoint {
    /// Opens it.
    ///
    /// # Errors
    ///
    /// Any error of the system, with the name of the port or address.
    pub fn open(&self) -> io::Result<Box<dyn ByteStream + Send>> {
        Ok(match self {
            Self::Serial { port, baud } => Box::new(SerialStream::open(port, *baud)?),
            Self::Tcp { address } => Box::new(TcpStream::connect(address)?),
            Self::UdpIn { address } => Box::new(UdpStream::listen(address)?),
            Self::UdpOut { address } => Box::new(UdpStream::to(address)?),
        })
    }
}

/// Error of a text that names no endpoint.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{text:?} is no endpoint: serial:PORT:BAUD, tcp:HOST:PORT, udpin:ADDRESS:PORT or \
     udpout:HOST:PORT"
)]
pub struct EndpointError {
    text: String,
}

impl FromStr for Endpoint {
    type Err = EndpointError;

    fn from_str(text: &str) -> Result<Self, EndpointError> {
        let wrong = || EndpointError { text: text.to_owned() };
        let (kind, rest) = text.split_once(':').ok_or_else(wrong)?;
        // A Windows port has no colon either.
        let (name, number) = rest.rsplit_once(':').ok_or_else(wrong)?;
        if name.is_empty() {
            return Err(wrong());
        }
        if kind == "serial" {
            let baud = number.parse().ok().filter(|baud| *baud > 0).ok_or_else(wrong)?;
            return Ok(Self::Serial { port: name.to_owned(), baud });
        }
        let _port: u16 = number.parse().map_err(|_| wrong())?;
        let address = rest.to_owned();
        match kind {
            "tcp" => Ok(Self::Tcp { address }),
            "udpin" => Ok(Self::UdpIn { address }),
            "udpout" => Ok(Self::UdpOut { address }),
            _ => Err(wrong()),
        }
    }
}

impl fmt::Display for Endpoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Serial { port, baud } => write!(f, "serial:{port}:{baud}"),
            Self::Tcp { address } => write!(f, "tcp:{address}"),
            Self::UdpIn { address } => write!(f, "udpin:{address}"),
            Self::UdpOut { address } => write!(f, "udpout:{address}"),
        }
    }
}

impl TryFrom<String> for Endpoint {
    type Error = EndpointError;

    fn try_from(text: String) -> Result<Self, EndpointError> {
        text.parse()
    }
}

impl From<Endpoint> for String {
    fn from(endpoint: Endpoint) -> Self {
        endpoint.to_string()
    }
}

/// A serial port: 8 data bits, no parity, one stop bit, no flow control. Reading never waits; a
/// port that takes nothing any more holds a write up for half a second before it fails.
#[derive(Debug)]
pub struct SerialStream {
    port: serial2::SerialPort,
    name: String,
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn endpoints_are_read_as_they_are_written() {
        for text in [
            "serial:/dev/ttyUSB0:57600",
            "serial:COM3:115200",
            "tcp:127.0.0.1:5760",
            "udpin:0.0.0.0:14550",
            "udpout:[::1]:5556",
        ] {
            let endpoint: Endpoint = text.parse().expect("it works");
            assert_eq!(endpoint.to_string(), text);
        }
        for text in [
            "",
            "/dev/ttyUSB0",
            "serial:/dev/ttyUSB0",
            "serial::9600",
            "serial:/dev/x:0",
            "tcp:host",
            "tcp:host:70000",
            "udp:host:1",
        ] {
            let error = text.parse::<Endpoint>().expect_err("it is refused").to_string();
            assert!(error.contains(&format!("{text:?}")), "{error}");
        }
    }

    #[test]
    fn a_port_that_is_not_there_is_named() {
        let error =
            "serial:/dev/no-such-port:9600".parse::<Endpoint>().expect("it works").open().err();
        assert!(error.expect("it is refused").to_string().contains("/dev/no-such-port"));
    }
}
