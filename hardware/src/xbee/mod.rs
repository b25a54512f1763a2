//! XBee radios, the beacon's counterpart under the drone: settings, state, and the link to one.

mod examine;
mod radio;
mod setup;

pub use radio::{XbeeCounts, XbeeRadio};

use std::{fmt, io};

use foxhunt_core::parameter::{FieldError, positive};
use foxhunt_wire::{
    ByteStream,
    xbee::{Address, Address16, Address64, ApiMode, AtCommand, AtStatus, Decoder, Frame, Protocol},
};
use serde::{Deserialize, Serialize};

/// The longest payload: with number and head it fits every firmware's packet, encrypted or not.
const LONGEST_PAYLOAD: usize = 60;

/// Time in seconds after which a frame that stops in the middle was cut.
const QUIET_S: f64 = 0.1;

/// Bytes in one read, and most reads in one poll, so that it ends.
const CHUNK: usize = 512;
const CHUNKS: usize = 32;

/// Queries of beacons through an XBee.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct XbeeConfig {
    /// The beacons' addresses, in the order of the hunt's beacons: 16 hexadecimal digits (`SH`,
    /// then `SL`), or 4 (`MY`).
    pub beacons: Vec<Address>,
    /// The query to a beacon, and where the power of its answer stands.
    pub question: XbeeQuestion,
    /// Payload of a question to a beacon that a program answers for.
    pub payload: String,
    /// Such an answer begins with what was sent, so that two bytes of number behind the payload
    /// separate a late answer from a new one. Where it does not, a beacon that left a question
    /// without an answer is not queried again before another time-out has passed.
    pub echoed: bool,
    /// Time for which a beacon's answer is awaited, in seconds.
    pub answer_timeout_s: f64,
    /// Time for which the radio's own answer is awaited while it is set up, in seconds; it is
    /// queried three times.
    pub setup_timeout_s: f64,
}

/// The query to a beacon.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum XbeeQuestion {
    /// [`ReceivedRssi`](Self::ReceivedRssi) with an 802.15.4 firmware, otherwise
    /// [`TransmitDb`](Self::TransmitDb).
    #[default]
    Auto,
    /// A packet, which the beacon's program answers; the power stands in the frame that brings the
    /// answer. 802.15.4 firmware.
    ReceivedRssi,
    /// A packet, which the beacon's program answers; then the radio is queried for the power of the
    /// last packet (`DB`). A sample is dropped if another packet came in between.
    TransmitDb,
    /// The beacon's radio is queried for the power at which it received the question (remote `DB`):
    /// no program is needed at the beacon.
    RemoteDb,
}

/// No beacons, as of a radio that is only examined; the question by the firmware; `ASK`, echoed;
/// 0.4 s for an answer, 0.5 s for the radio's own.
impl Default for XbeeConfig {
    fn default() -> Self {
        Self {
            beacons: Vec::new(),
            question: XbeeQuestion::Auto,
            payload: "ASK".into(),
            echoed: true,
            answer_timeout_s: 0.4,
            setup_timeout_s: 0.5,
        }
    }
}

impl XbeeConfig {
    /// Checks the ranges of all settings.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names the first field that cannot.
    pub fn check(&self) -> Result<(), FieldError> {
        for (index, beacon) in self.beacons.iter().enumerate() {
            let field = format!("beacons[{index}]");
            let everyone = [
                Address::Long(Address64::BROADCAST),
                Address::Long(Address64::UNKNOWN),
                Address::Short(Address16(u16::MAX)),
                Address::Short(Address16::UNKNOWN),
            ];
            if everyone.contains(beacon) {
                return Err(FieldError::new(field, beacon, "the address of one radio"));
            }
            if self.beacons.iter().take(index).any(|other| other == beacon) {
                return Err(FieldError::new(field, beacon, "unlike those before it"));
            }
        }
        let length = self.payload.len();
        if !(1..=LONGEST_PAYLOAD).contains(&length) {
            let value = format_args!("{length} bytes long");
            return Err(FieldError::new("payload", value, "1 to 60 bytes long"));
        }
        positive("answer_timeout_s", self.answer_timeout_s)?;
        positive("setup_timeout_s", self.setup_timeout_s)?;
        Ok(())
    }
}

/// Identity that a radio reported when it was set up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct XbeeIdentity {
    /// API mode of the radio.
    pub mode: ApiMode,
    /// The firmware's version, `VR`.
    pub firmware: u16,
    /// The hardware's version, `HV`.
    pub hardware: u16,
    /// The firmware's protocol on the air.
    pub protocol: Protocol,
    /// Address of the radio, `SH` and `SL`.
    pub address: Address64,
}

impl fmt::Display for XbeeIdentity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ap = match self.mode {
            ApiMode::Plain => 1,
            ApiMode::Escaped => 2,
        };
        let Self { firmware, hardware, protocol, address, .. } = self;
        write!(f, "{protocol} firmware {firmware:04X}, hardware {hardware:04X}, AP {ap}, {address}")
    }
}

/// Error of an XBee: why it does not do what is requested. The call may be repeated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum XbeeError {
    /// The port failed.
    #[error("the XBee's port: {0}")]
    Stream(#[source] io::Error),
    /// It sends nothing at all.
    #[error(
        "the XBee does not answer: check its power, the port and its speed (BD, which must be the \
         port's baud rate)"
    )]
    NotAnswering,
    /// It is not in an API mode.
    #[error(
        "the XBee's AP is {ap}, and it must be 1 or 2: set it with XCTU (API without or with \
         escapes), or with +++, ATAP 1, ATWR in a terminal"
    )]
    Mode {
        /// API mode of the radio, `AP`.
        ap: u8,
    },
    /// It refuses a question about itself.
    #[error("the XBee refuses {command}: {status}")]
    Refused {
        /// The refused command.
        command: AtCommand,
        /// Status that it returned.
        status: AtStatus,
    },
    /// The firmware has no such query.
    #[error("an XBee with {protocol} firmware cannot be used with question {question:?}")]
    Question {
        /// Protocol of the firmware on the air.
        protocol: Protocol,
        /// The query.
        question: XbeeQuestion,
    },
    /// The firmware knows no such addresses.
    #[error(
        "beacon address {address} is of 16 bits, which DigiMesh firmware does not have: use SH \
         and SL"
    )]
    Address {
        /// The beacon's address.
        address: Address,
    },
    /// There is no such beacon.
    #[error("there is no address of beacon {beacon}; there are {beacons}, counted from 0")]
    Beacon {
        /// Requested beacon.
        beacon: u16,
        /// Number of beacons.
        beacons: usize,
    },
    /// The question did not go out.
    #[error("the question to {address} did not go out: {reason}")]
    NotSent {
        /// To whom.
        address: Address,
        /// The radio's status.
        reason: String,
    },
    /// The beacon's radio does not report its `DB`.
    #[error("{address} refuses DB: {status}")]
    RemoteRefused {
        /// Address of the beacon's radio.
        address: Address,
        /// Status that it returned.
        status: AtStatus,
    },
}

/// The radio's end of the serial line.
#[derive(Debug)]
struct Link<S> {
    stream: S,
    decoder: Decoder,
    connections: u32,
    received_at: f64,
    last_id: u8,
    /// Number of broken frames; then bytes outside of frames on decoders before this one.
    bad_frames: u64,
    skipped_before: u64,
}

impl<S: ByteStream> Link<S> {
    fn new(stream: S) -> Self {
        let connections = stream.connections();
        let decoder = Decoder::new(ApiMode::Escaped);
        Self {
            stream,
            decoder,
            connections,
            received_at: 0.0,
            last_id: 1,
            bad_frames: 0,
            skipped_before: 0,
        }
    }

    /// Returns true if the stream was opened again since the last call.
    fn reopened(&mut self) -> bool {
        let connections = self.stream.connections();
        let reopened = connections != self.connections;
        self.connections = connections;
        reopened
    }

    /// Reads and writes frames in another way from now on.
    fn set_mode(&mut self, mode: ApiMode) {
        self.skipped_before = self.skipped();
        self.decoder = Decoder::new(mode);
    }

    fn mode(&self) -> ApiMode {
        self.decoder.mode()
    }

    /// Returns the number of bytes that belonged to no frame.
    fn skipped(&self) -> u64 {
        self.skipped_before + self.decoder.skipped()
    }

    /// Returns the bytes that have come. A failure after some bytes is returned the next time.
    fn read(&mut self) -> Result<Vec<u8>, XbeeError> {
        let mut bytes = Vec::new();
        let mut chunk = [0; CHUNK];
        for _ in 0..CHUNKS {
            match self.stream.receive(&mut chunk) {
                Ok(0) => break,
                Ok(count) => bytes.extend(chunk.iter().take(count)),
                Err(_) if !bytes.is_empty() => break,
                Err(error) => return Err(XbeeError::Stream(error)),
            }
        }
        Ok(bytes)
    }

    /// The frames that are complete with these bytes.
    fn frames(&mut self, bytes: &[u8], now: f64) -> Vec<Frame> {
        let mut decoded = Vec::new();
        if bytes.is_empty() {
            if self.decoder.is_waiting() && now - self.received_at > QUIET_S {
                decoded = self.decoder.give_up();
            }
        } else {
            self.received_at = now;
            decoded = self.decoder.push(bytes);
        }
        let wrong = decoded.iter().filter(|outcome| outcome.is_err()).count();
        self.bad_frames += u64::try_from(wrong).unwrap_or(u64::MAX);
        decoded.into_iter().flatten().collect()
    }

    /// Writes a frame.
    fn send(&mut self, frame: &Frame) -> Result<(), XbeeError> {
        let bytes = frame
            .encode(self.decoder.mode())
            .map_err(|error| io::Error::new(io::ErrorKind::InvalidInput, error));
        bytes.and_then(|bytes| self.stream.send(&bytes)).map_err(XbeeError::Stream)
    }

    /// A number for a question, unlike the last 254; 0 would request no answer, and 1 belongs to
    /// the first question of all.
    fn id(&mut self) -> u8 {
        self.last_id = if self.last_id == u8::MAX { 2 } else { self.last_id + 1 };
        self.last_id
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_is_named_with_its_value() {
        let beacons = |list: &[&str]| list.iter().map(|a| a.parse().expect("an address")).collect();
        let good = XbeeConfig { beacons: beacons(&["0013A20040AABBCC"]), ..XbeeConfig::default() };
        assert_eq!(good.check(), Ok(()));
        let cases = [
            (XbeeConfig { beacons: beacons(&["0001", "FFFE"]), ..good.clone() }, "[1] is FFFE"),
            (XbeeConfig { beacons: beacons(&["0001", "0001"]), ..good.clone() }, "[1] is 0001"),
            (XbeeConfig { payload: String::new(), ..good.clone() }, "payload is 0 bytes"),
            (XbeeConfig { answer_timeout_s: -1.0, ..good.clone() }, "answer_timeout_s is -1"),
            (XbeeConfig { setup_timeout_s: f64::NAN, ..good }, "setup_timeout_s is NaN"),
        ];
        for (config, text) in cases {
            let error = config.check().expect_err("it is wrong").to_string();
            assert!(error.contains(text), "{error}");
        }
    }

    #[test]
    fn a_file_names_what_differs_from_the_default() {
        let text = r#"{"beacons": ["0013a20040aabbcc", "5001"], "question": "remote-db"}"#;
        let config: XbeeConfig = serde_json::from_str(text).expect("it is in order");
        assert_eq!(config.question, XbeeQuestion::RemoteDb);
        assert_eq!(config.beacons[0].to_string(), "0013A20040AABBCC");
        assert!(serde_json::from_str::<XbeeConfig>(r#"{"beacon": []}"#).is_err());
        assert!(serde_json::from_str::<XbeeConfig>(r#"{"beacons": ["x"]}"#).is_err());
    }
}
