//! Streams of bytes that never block.

mod byte_stream;
mod endpoint;
mod memory;
#[cfg(unix)]
mod pty;
mod serial;
mod shared;
mod tcp;
mod tcp_server;
mod udp;

pub use byte_stream::ByteStream;
pub use endpoint::{Endpoint, EndpointError};
pub use memory::{MemoryStream, memory_pair};
#[cfg(unix)]
pub use pty::PtyStream;
pub use serial::SerialStream;
pub use shared::{SharedPort, SharedStream};
pub use tcp::TcpStream;
pub use tcp_server::TcpServerStream;
pub use udp::UdpStream;
