use std::{
    fmt, io,
    net::{Ipv4Addr, Ipv6Addr, SocketAddr, ToSocketAddrs, UdpSocket},
    sync::Arc,
    thread,
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};

use rustls::{ClientConfig, pki_types::ServerName};

use super::{
    config::{CotAddress, CotConfig, CotError, CotTransport},
    stream::Stream,
    tls,
};
use crate::outbox::{Outbox, Parcel};

/// Shortest pause before a lost address is tried again; each further one is twice as long.
const FIRST_PAUSE: Duration = Duration::from_secs(1);

/// Longest pause before a lost address is tried again.
const LONGEST_PAUSE: Duration = Duration::from_secs(30);

/// Time between two looks at what a server sends, and the shortest between two sends.
const TURN: Duration = Duration::from_millis(200);

/// Pause behind the first event of a connection: FreeTAKServer takes it for the introduction of the
/// client, and hangs up if others come along.
const INTRODUCTION: Duration = Duration::from_millis(500);

/// Largest payload of a datagram over IPv4, in bytes.
const MOST_DATAGRAM_BYTES: usize = 65_507;

/// Number of datagrams in a row, before receivers get a pause to take them.
const BURST: usize = 16;

/// Pause after a burst of datagrams.
const BURST_PAUSE: Duration = Duration::from_millis(5);

/// A message with the name of the thing that it is about.
#[derive(Clone, Debug, PartialEq)]
pub struct CotMessage {
    /// Name of the thing: a message replaces an earlier one of the same name.
    pub uid: String,
    /// The event as XML.
    pub xml: Vec<u8>,
    /// UNIX time from which on the message is not sent any more, in seconds.
    pub stale_unix_s: f64,
}

/// Sends events to TAK servers and teams, and connects again whenever a server is lost.
pub struct CotSender {
    lines: Vec<Line>,
}

/// An address with its messages.
struct Line {
    address: CotAddress,
    outbox: Arc<Outbox>,
}

impl fmt::Debug for CotSender {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let addresses = self.lines.iter().map(|line| &line.address);
        f.debug_list().entries(addresses).finish()
    }
}

impl CotSender {
    /// Reads the certificates, and connects in the background. `password` opens PKCS#12 files and
    /// encrypted keys.
    ///
    /// # Errors
    ///
    /// [`CotError`] names the setting or the file that is of no use. A server that is not there is
    /// no error.
    pub fn open(config: &CotConfig, password: Option<&str>) -> Result<Self, CotError> {
        config.check()?;
        let is_tls = |address: &CotAddress| address.transport == CotTransport::Tls;
        let tls =
            config.to.iter().any(is_tls).then(|| tls::client(config, password)).transpose()?;
        let mut sender = Self { lines: Vec::new() };
        for address in &config.to {
            let outbox = Arc::new(Outbox::default());
            let serving = Serving {
                address: address.clone(),
                outbox: Arc::clone(&outbox),
                tls: match &tls {
                    Some(tls) if is_tls(address) => Some((
                        Arc::clone(tls),
                        tls::name(config.server_name.as_deref(), &address.host)?,
                    )),
                    _ => None,
                },
                from: config.from,
            };
            let named = thread::Builder::new().name("cot".to_owned());
            let spawned = named.spawn(move || serving.serve());
            let open = |error: io::Error| CotError::Open {
                what: address.to_string(),
                reason: format!("its thread: {error}"),
            };
            let _ = spawned.map_err(open)?;
            sender.lines.push(Line { address: address.clone(), outbox });
        }
        Ok(sender)
    }

    /// Puts messages to be sent to every address. It never waits for a network.
    pub fn put(&self, messages: &[CotMessage]) {
        let now = unix_s();
        self.lines.iter().for_each(|line| line.outbox.put(messages.iter().map(parcel), now));
    }

    /// Returns remarks about the connections since the last call.
    #[must_use]
    pub fn take_remarks(&self) -> Vec<String> {
        let of = |line: &Line| {
            let remarks = line.outbox.take_remarks().into_iter();
            let address = line.address.to_string();
            remarks.map(move |remark| format!("{address}: {remark}"))
        };
        self.lines.iter().flat_map(of).collect()
    }

    /// Waits until every message is sent, for a while at most.
    ///
    /// # Errors
    ///
    /// The addresses that have not got everything, each with the reason.
    pub fn finish(self, within: Duration) -> Result<(), Vec<String>> {
        self.lines.iter().for_each(|line| line.outbox.close());
        let end = Instant::now() + within;
        let failed = self.lines.iter().filter_map(|line| {
            let left = end.saturating_duration_since(Instant::now());
            let failure = line.outbox.ended(left)?;
            Some(format!("{}: {failure}", line.address))
        });
        let failed: Vec<_> = failed.collect();
        if failed.is_empty() { Ok(()) } else { Err(failed) }
    }
}

impl Drop for CotSender {
    fn drop(&mut self) {
        self.lines.iter().for_each(|line| line.outbox.close());
    }
}

pub(super) fn parcel(message: &CotMessage) -> Parcel<'_> {
    let CotMessage { uid, xml, stale_unix_s } = message;
    Parcel { name: uid, bytes: xml, stale_unix_s: *stale_unix_s }
}

/// UNIX time in seconds.
fn unix_s() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64()
}

/// Data of an address's thread.
struct Serving {
    address: CotAddress,
    outbox: Arc<Outbox>,
    tls: Option<(Arc<ClientConfig>, ServerName<'static>)>,
    from: Option<std::net::IpAddr>,
}

impl Serving {
    fn serve(self) {
        let mut pause = FIRST_PAUSE;
        loop {
            let mut since = None;
            let served = match self.address.transport {
                CotTransport::Udp => self.datagrams(&mut since),
                CotTransport::Tcp | CotTransport::Tls => self.stream(&mut since),
            };
            let Err(error) = served else { break };
            // A server that takes a message and hangs up is not tried each second.
            if since.is_some_and(|since: Instant| since.elapsed() >= LONGEST_PAUSE) {
                pause = FIRST_PAUSE;
            }
            self.outbox.lost(error.to_string());
            if self.outbox.is_closed() {
                break;
            }
            self.outbox.pause(pause);
            pause = (pause * 2).min(LONGEST_PAUSE);
        }
        self.outbox.end();
    }

    /// The addresses of the host.
    fn resolved(&self) -> io::Result<Vec<SocketAddr>> {
        let found = (self.address.host.as_str(), self.address.port).to_socket_addrs()?;
        let found: Vec<_> = found.collect();
        if found.is_empty() { Err(io::Error::other("the host has no address")) } else { Ok(found) }
    }

    /// Sends over a stream until nothing more will come; an error if the server is lost. `since`
    /// becomes the time at which the connection was there.
    fn stream(&self, since: &mut Option<Instant>) -> io::Result<()> {
        let tls = self.tls.as_ref().map(|(config, name)| (Arc::clone(config), name.clone()));
        let mut stream = Stream::open(&self.resolved()?, tls)?;
        let remark = stream.about().map_or("connected".to_owned(), |it| format!("connected, {it}"));
        self.outbox.connected(remark);
        *since = Some(Instant::now());
        let mut is_new = true;
        loop {
            let messages = self.outbox.take(TURN, unix_s());
            if messages.is_empty() && self.outbox.is_closed() {
                if let Err(error) = stream.close() {
                    self.outbox.unclosed(&error);
                }
                return Ok(());
            }
            // The server sends everything of the others; where nobody reads it, it hangs up.
            stream.drain()?;
            for (uid, xml) in &messages {
                stream.send(xml)?;
                self.outbox.sent(uid, xml);
                if is_new {
                    thread::sleep(INTRODUCTION);
                    is_new = false;
                }
                stream.drain()?;
            }
            if !messages.is_empty() {
                self.rest();
            }
        }
    }

    /// Sends datagrams until nothing more will come; an error if the network does not take them.
    /// `since` becomes the time from which on it has taken them.
    fn datagrams(&self, since: &mut Option<Instant>) -> io::Result<()> {
        let to = self.resolved()?;
        let is_v4 = self.from.is_none_or(|from| from.is_ipv4());
        let fit = to.iter().find(|to| to.is_ipv4() == is_v4);
        let fit = fit.or_else(|| to.first().filter(|_| self.from.is_none()));
        let to = *fit.ok_or_else(|| {
            let family = if is_v4 { "IPv4" } else { "IPv6" };
            io::Error::other(format!("the host has no {family} address, but from is one"))
        })?;
        let any = match to {
            SocketAddr::V4(_) => Ipv4Addr::UNSPECIFIED.into(),
            SocketAddr::V6(_) => Ipv6Addr::UNSPECIFIED.into(),
        };
        // The source decides the card that a multicast datagram leaves by.
        let socket = UdpSocket::bind((self.from.unwrap_or(any), 0))?;
        loop {
            let messages = self.outbox.take(TURN, unix_s());
            if messages.is_empty() && self.outbox.is_closed() {
                return Ok(());
            }
            for (number, (uid, xml)) in (1..).zip(&messages) {
                if xml.len() > MOST_DATAGRAM_BYTES {
                    let bytes = xml.len();
                    self.outbox.remark(format!("{uid} has {bytes} bytes, too many for a datagram"));
                    // It would be too long again.
                    self.outbox.sent(uid, xml);
                    continue;
                }
                match socket.send_to(xml, to) {
                    Ok(_) => {}
                    // A host without a listener refuses the datagram before.
                    Err(error) if error.kind() == io::ErrorKind::ConnectionRefused => {}
                    Err(error) => return Err(error),
                }
                self.outbox.sent(uid, xml);
                if number % BURST == 0 {
                    thread::sleep(BURST_PAUSE);
                }
            }
            if !messages.is_empty() {
                if since.is_none() {
                    self.outbox.connected("sending".to_owned());
                    *since = Some(Instant::now());
                }
                self.rest();
            }
        }
    }

    /// Limits how often a thing that changes all the time is sent.
    fn rest(&self) {
        if !self.outbox.is_closed() {
            self.outbox.pause(TURN);
        }
    }
}
