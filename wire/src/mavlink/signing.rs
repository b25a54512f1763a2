use std::{fmt, str::FromStr};

use ::mavlink::MAVLinkV2MessageRaw;
use serde::{Deserialize, Serialize};

/// The secret that both ends of a signed link share: 64 hexadecimal digits in a file, the SHA-256
/// of a passphrase where other programs take one. Never shown.
#[derive(Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct SigningKey([u8; 32]);

/// Error of a text that is no key.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a signing key has 64 hexadecimal digits; this has {length} characters{}", if *.length == 64 { ", not all of them digits" } else { "" })]
pub struct SigningKeyError {
    length: usize,
}

impl SigningKey {
    /// A key of these bytes.
    #[must_use]
    pub fn new(bytes: [u8; 32]) -> Self {
        Self(bytes)
    }

    /// Returns the bytes of the key, which are secret.
    #[must_use]
    pub fn bytes(&self) -> &[u8; 32] {
        &self.0
    }
}

impl fmt::Debug for SigningKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("SigningKey(…)")
    }
}

impl FromStr for SigningKey {
    type Err = SigningKeyError;

    fn from_str(text: &str) -> Result<Self, SigningKeyError> {
        let wrong = SigningKeyError { length: text.chars().count() };
        let mut key = [0; 32];
        if text.len() != 64 || !text.is_ascii() {
            return Err(wrong);
        }
        for (byte, digits) in key.iter_mut().zip(text.as_bytes().chunks_exact(2)) {
            let digits = std::str::from_utf8(digits).map_err(|_| wrong)?;
            // from_str_radix would take a sign.
            if !digits.bytes().all(|digit| digit.is_ascii_hexdigit()) {
                return Err(wrong);
            }
            *byte = u8::from_str_radix(digits, 16).map_err(|_| wrong)?;
        }
        Ok(Self(key))
    }
}

impl TryFrom<String> for SigningKey {
    type Error = SigningKeyError;

    fn try_from(text: String) -> Result<Self, SigningKeyError> {
        text.parse()
    }
}

impl From<SigningKey> for String {
    fn from(key: SigningKey) -> Self {
        key.0.iter().map(|byte| format!("{byte:02x}")).collect()
    }
}

/// Signatures of the frames of one link (<https://mavlink.io/en/guide/message_signing.html>).
#[derive(Clone, Debug)]
pub struct Signing {
    key: SigningKey,
    link_id: u8,
    /// The newest timestamp sent or received, in 10 µs since 2015.
    timestamp: u64,
    /// The newest of every stream: link, system and component.
    streams: Vec<((u8, u32, u8), u64)>,
}

/// 1 January 2015 in seconds of UNIX time.
const EPOCH_UNIX_S: f64 = 1_420_070_400.0;

/// Timestamps in a second.
const PER_SECOND: f64 = 1e5;

/// Largest lag of a stream's first timestamp behind ours: a minute.
const MOST_BEHIND: u64 = 6_000_000;

/// Maximum number of streams; frames of further ones are refused.
const MOST_STREAMS: usize = 64;

impl Signing {
    /// Signs with `key`, as the link `link_id`.
    #[must_use]
    pub fn new(key: SigningKey, link_id: u8) -> Self {
        Self { key, link_id, timestamp: 0, streams: Vec::new() }
    }

    /// Brings the timestamp up to the time `unix_s`.
    fn advance(&mut self, unix_s: f64) {
        let ticks = ((unix_s - EPOCH_UNIX_S) * PER_SECOND).clamp(0.0, 2.8e14);
        #[expect(clippy::cast_possible_truncation, reason = "within 48 bits by the clamp")]
        let ticks = ticks as u64;
        self.timestamp = self.timestamp.max(ticks);
    }

    /// Signs a frame that was serialised for it.
    pub(super) fn sign(&mut self, frame: &mut MAVLinkV2MessageRaw, unix_s: f64) {
        self.timestamp += 1;
        self.advance(unix_s);
        *frame.signature_link_id_mut() = self.link_id;
        let [a, b, c, d, e, f, _, _] = self.timestamp.to_le_bytes();
        frame.signature_timestamp_bytes_mut().copy_from_slice(&[a, b, c, d, e, f]);
        let mut signature = [0; 6];
        frame.calculate_signature(&self.key.0, &mut signature);
        frame.signature_value_mut().copy_from_slice(&signature);
    }

    /// Returns true if a frame is signed with the key and newer than all of its stream.
    pub(super) fn accepts(&mut self, frame: &MAVLinkV2MessageRaw, unix_s: f64) -> bool {
        if frame.incompatibility_flags() & 1 == 0 {
            return false;
        }
        let mut signature = [0; 6];
        frame.calculate_signature(&self.key.0, &mut signature);
        if signature != frame.signature_value() {
            return false;
        }
        self.advance(unix_s);
        let timestamp = frame.signature_timestamp();
        let full = self.streams.len() >= MOST_STREAMS;
        let stream = (frame.signature_link_id(), frame.system_id(), frame.component_id());
        match self.streams.iter_mut().find(|(known, _)| *known == stream) {
            Some((_, newest)) if timestamp <= *newest => return false,
            Some((_, newest)) => *newest = timestamp,
            None if timestamp + MOST_BEHIND < self.timestamp => return false,
            None if full => return false,
            None => self.streams.push((stream, timestamp)),
        }
        self.timestamp = self.timestamp.max(timestamp);
        true
    }
}
