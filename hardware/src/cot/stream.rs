use std::{
    io::{self, Read, Write},
    net::{Shutdown, SocketAddr, TcpStream},
    sync::Arc,
    thread,
    time::{Duration, Instant},
};

use rustls::{ClientConfig, ClientConnection, pki_types::ServerName};

/// Longest wait for a connection, and for a server to take a message.
const PATIENCE: Duration = Duration::from_secs(5);

/// Longest wait for a server to take the rest before the connection is closed.
const FAREWELL: Duration = Duration::from_secs(1);

/// Shortest wait for a server to refuse our certificate.
const SHORTEST_LOOK: Duration = Duration::from_millis(100);

/// Kind of the error for an alert of the server.
const ALERT: io::ErrorKind = io::ErrorKind::PermissionDenied;

/// Number of reads of a server's own messages at a time: one that sends all the time gets ours.
const MOST_READS: usize = 64;

/// A connection to a server, encrypted or not.
pub(super) struct Stream {
    tcp: TcpStream,
    tls: Option<Box<ClientConnection>>,
}

impl Stream {
    /// Connects to the first address that answers, and checks the server's certificate.
    pub(super) fn open(
        addresses: &[SocketAddr],
        tls: Option<(Arc<ClientConfig>, ServerName<'static>)>,
    ) -> io::Result<Self> {
        let mut failed = io::Error::other("the host has no address");
        let found = addresses.iter().find_map(|address| {
            TcpStream::connect_timeout(address, PATIENCE).map_err(|error| failed = error).ok()
        });
        let Some(mut tcp) = found else { return Err(failed) };
        tcp.set_nodelay(true)?;
        tcp.set_read_timeout(Some(PATIENCE))?;
        tcp.set_write_timeout(Some(PATIENCE))?;
        let mut tls = tls
            .map(|(config, name)| ClientConnection::new(config, name).map(Box::new))
            .transpose()
            .map_err(io::Error::other)?;
        let begun = Instant::now();
        if let Some(tls) = &mut tls {
            // A message of any length is written as a whole, before the next is taken.
            tls.set_buffer_limit(None);
            while tls.is_handshaking() {
                let _ = tls.complete_io(&mut tcp).map_err(refused)?;
            }
        }
        let mut stream = Self { tcp, tls };
        if stream.tls.is_some() {
            // In TLS 1.3 a server looks at our certificate when the handshake is over for us, and
            // what is sent to one that refuses it is lost.
            thread::sleep((2 * begun.elapsed()).clamp(SHORTEST_LOOK, PATIENCE));
            stream.drain().map_err(|error| {
                let why = match error.kind() {
                    ALERT => "the server refuses this certificate or the lack of one",
                    _ => {
                        "it ended right after the handshake; perhaps the server refuses this \
                         certificate or the lack of one"
                    }
                };
                io::Error::new(error.kind(), format!("{why}: {error}"))
            })?;
        }
        Ok(stream)
    }

    /// Returns the version of TLS.
    pub(super) fn about(&self) -> Option<String> {
        let version = self.tls.as_ref()?.protocol_version()?.as_str()?;
        Some(version.replace('_', " ").replacen("TLSv1 ", "TLS 1.", 1))
    }

    /// Writes a message as a whole.
    pub(super) fn send(&mut self, xml: &[u8]) -> io::Result<()> {
        let Some(tls) = &mut self.tls else { return self.tcp.write_all(xml).map_err(timely) };
        tls.writer().write_all(xml)?;
        while tls.wants_write() {
            let _ = tls.write_tls(&mut self.tcp).map_err(timely)?;
        }
        Ok(())
    }

    /// Drops what the server has sent.
    ///
    /// # Errors
    ///
    /// The connection is closed, or broken.
    pub(super) fn drain(&mut self) -> io::Result<()> {
        self.tcp.set_nonblocking(true)?;
        let drained = self.drop_received();
        self.tcp.set_nonblocking(false)?;
        drained
    }

    fn drop_received(&mut self) -> io::Result<()> {
        for _ in 0..MOST_READS {
            match self.read() {
                Ok(true) => {}
                Ok(false) => return Err(io::Error::other("the server has closed the connection")),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => return Ok(()),
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    /// Reads and drops a part. Returns false if the server has closed the connection.
    fn read(&mut self) -> io::Result<bool> {
        let Some(tls) = &mut self.tls else {
            return self.tcp.read(&mut [0; 16_384]).map(|read| read > 0);
        };
        let read = tls.read_tls(&mut self.tcp)?;
        let state = tls.process_new_packets().map_err(tls_error)?;
        let received = state.plaintext_bytes_to_read();
        let _ = io::copy(&mut tls.reader().take(received as u64), &mut io::sink())?;
        Ok(read > 0 && !state.peer_has_closed())
    }

    /// Closes the connection behind the last message. To close it with messages unread would break
    /// it, and the server would lose what is on its way.
    ///
    /// # Errors
    ///
    /// The server has broken the connection, as one does that refuses a certificate in TLS 1.3.
    pub(super) fn close(mut self) -> io::Result<()> {
        if let Some(tls) = &mut self.tls {
            tls.send_close_notify();
            while tls.wants_write() {
                let _ = tls.write_tls(&mut self.tcp)?;
            }
        }
        self.tcp.shutdown(Shutdown::Write)?;
        self.tcp.set_read_timeout(Some(FAREWELL))?;
        let end = Instant::now() + FAREWELL;
        while Instant::now() < end {
            match self.read() {
                Ok(true) => {}
                Ok(false) => break,
                // A server that stays has taken everything.
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => break,
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}

/// Adds the words for a server that is refused, or refuses.
fn refused(error: io::Error) -> io::Error {
    match error.downcast::<rustls::Error>() {
        Ok(error) => tls_error(error),
        Err(error) => timely(error),
    }
}

fn tls_error(error: rustls::Error) -> io::Error {
    let why = match &error {
        rustls::Error::InvalidCertificate(_) => "the server's certificate is refused: ",
        _ => "",
    };
    let kind = match &error {
        rustls::Error::AlertReceived(_) => ALERT,
        _ => io::ErrorKind::Other,
    };
    io::Error::new(kind, format!("{why}{error}"))
}

/// Names the server that takes nothing.
fn timely(error: io::Error) -> io::Error {
    match error.kind() {
        io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut => {
            io::Error::new(io::ErrorKind::TimedOut, "the server does not answer")
        }
        _ => error,
    }
}
