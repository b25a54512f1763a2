use std::{
    fmt,
    net::IpAddr,
    path::{Path, PathBuf},
    str::FromStr,
};

use serde::{Deserialize, Serialize};

use crate::host::is_this_computer;

/// Addresses that events in Cursor on Target are sent to, and the certificates for them.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CotConfig {
    /// Addresses of servers and teams, such as `tls://tak.example:8089` or `udp://239.2.3.1:6969`.
    pub to: Vec<CotAddress>,
    /// Certificates of the authorities that may have signed the server's, as PEM or PKCS#12.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ca: Option<PathBuf>,
    /// One's own certificate, as PEM, or with its key as PKCS#12.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cert: Option<PathBuf>,
    /// Key of one's own certificate, as PEM; the one beside the certificate if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub key: Option<PathBuf>,
    /// Name in the server's certificate; the host of the address if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub server_name: Option<String>,
    /// Address of the network card that datagrams leave by; the system chooses if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from: Option<IpAddr>,
}

/// An address with its transport: `tcp://HOST:PORT`, `tls://HOST:PORT` or `udp://HOST:PORT`.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct CotAddress {
    /// Transport to the host.
    pub transport: CotTransport,
    /// Name or number of the host, without brackets.
    pub host: String,
    /// Port of the host.
    pub port: u16,
}

/// A transport of events.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum CotTransport {
    /// A stream to a server, not encrypted. Port 8087 unless given.
    Tcp,
    /// A stream to a server, encrypted and checked by certificates. Port 8089 unless given.
    Tls,
    /// Datagrams to a host or a multicast group, not encrypted. Port 6969 unless given.
    Udp,
}

impl CotTransport {
    const ALL: [(&'static str, Self, u16); 3] =
        [("tcp", Self::Tcp, 8087), ("tls", Self::Tls, 8089), ("udp", Self::Udp, 6969)];

    fn name(self) -> &'static str {
        let found = Self::ALL.iter().find(|(_, known, _)| *known == self);
        found.map_or("", |(name, ..)| name)
    }
}

/// Reason why events cannot be sent.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CotError {
    /// An address cannot be one.
    #[error("{given:?} is not the address of a TAK server or team: {reason}")]
    Address {
        /// The text.
        given: String,
        /// Reason.
        reason: &'static str,
    },
    /// A setting does not fit the addresses.
    #[error("{name}: {reason}")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// Reason.
        reason: &'static str,
    },
    /// A file with certificates or a key is of no use.
    #[error("{}: {reason}", file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// Reason.
        reason: String,
    },
    /// The system does not start a thread, or TLS has no use for the certificates.
    #[error("{what}: {reason}")]
    Open {
        /// Thing that cannot be opened.
        what: String,
        /// Reason.
        reason: String,
    },
}

impl CotConfig {
    /// Refuses settings that contradict each other, before any file is read.
    ///
    /// # Errors
    ///
    /// [`CotError::Setting`] names the setting.
    pub fn check(&self) -> Result<(), CotError> {
        let refused = |name, reason| Err(CotError::Setting { name, reason });
        let has = |transport| self.to.iter().any(|address| address.transport == transport);
        if self.to.is_empty() {
            return refused("to", "at least one address is needed");
        }
        if !has(CotTransport::Tls) {
            for (name, is_given) in [
                ("ca", self.ca.is_some()),
                ("cert", self.cert.is_some()),
                ("key", self.key.is_some()),
                ("server_name", self.server_name.is_some()),
            ] {
                if is_given {
                    return refused(name, "only an address that begins with tls:// has use for it");
                }
            }
        } else if self.ca.is_none() {
            return refused(
                "ca",
                "an address that begins with tls:// needs the certificates that the server's is \
                 checked by",
            );
        }
        if self.key.is_some() && self.cert.is_none() {
            return refused("key", "a key needs its certificate: cert");
        }
        if self.from.is_some() && !has(CotTransport::Udp) {
            return refused("from", "only an address that begins with udp:// has use for it");
        }
        Ok(())
    }

    /// Returns the settings with relative paths taken from a folder.
    #[must_use]
    pub fn in_folder(self, folder: &Path) -> Self {
        let there = |path: Option<PathBuf>| path.map(|path| folder.join(path));
        Self { ca: there(self.ca), cert: there(self.cert), key: there(self.key), ..self }
    }
}

impl CotAddress {
    /// Returns true if others on the way can read and change what is sent.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.transport != CotTransport::Tls && !is_this_computer(&self.host)
    }
}

impl fmt::Display for CotAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { transport, host, port } = self;
        let name = transport.name();
        match host.contains(':') {
            true => write!(f, "{name}://[{host}]:{port}"),
            false => write!(f, "{name}://{host}:{port}"),
        }
    }
}

impl FromStr for CotAddress {
    type Err = CotError;

    fn from_str(text: &str) -> Result<Self, CotError> {
        let refused = |reason| CotError::Address { given: text.to_owned(), reason };
        let transport = "it begins with tcp://, tls:// or udp://";
        let (scheme, rest) = text.split_once("://").ok_or_else(|| refused(transport))?;
        let found = CotTransport::ALL.iter().find(|(name, ..)| scheme.eq_ignore_ascii_case(name));
        let (_, transport, usual) = *found.ok_or_else(|| refused(transport))?;
        let rest = rest.strip_suffix('/').unwrap_or(rest);
        let (host, port) = match rest.strip_prefix('[') {
            Some(rest) => {
                let (host, port) = rest.split_once(']').ok_or_else(|| refused("] is missing"))?;
                match port.strip_prefix(':') {
                    Some(port) => (host, Some(port)),
                    None if port.is_empty() => (host, None),
                    None => return Err(refused("a port follows a colon")),
                }
            }
            None => match rest.split_once(':') {
                Some((host, port)) => (host, Some(port)),
                None => (rest, None),
            },
        };
        let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '_' | ':' | '%');
        if host.is_empty() || !host.chars().all(plain) {
            return Err(refused("the host is a name or a number"));
        }
        let port = port.map_or(Ok(usual), str::parse);
        let port = port.ok().filter(|port| *port > 0);
        let port = port.ok_or_else(|| refused("the port is a number from 1 to 65535"))?;
        Ok(Self { transport, host: host.to_owned(), port })
    }
}

impl TryFrom<String> for CotAddress {
    type Error = CotError;

    fn try_from(text: String) -> Result<Self, CotError> {
        text.parse()
    }
}

impl From<CotAddress> for String {
    fn from(address: CotAddress) -> Self {
        address.to_string()
    }
}
