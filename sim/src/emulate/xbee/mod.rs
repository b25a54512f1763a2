//! An XBee on a stream, whose RSSI comes from a world: its registers, the air between radios, and
//! the text mode.

mod device;

pub use device::{EmulatedXbee, EmulatedXbeeConfig};

use std::collections::BTreeMap;

use foxhunt_core::{BeaconId, Radio};
use foxhunt_wire::xbee::{
    Address16, Address64, AtCommand, AtStatus, DeliveryStatus, Frame, Protocol, TransmitStatus,
};

use crate::SimRadio;

/// The commands that can be set, besides the mode.
const SETTABLE: [&[u8; 2]; 16] = [
    b"AP", b"NI", b"MY", b"ID", b"CH", b"CE", b"NT", b"NO", b"SM", b"BD", b"DH", b"DL", b"PL",
    b"AO", b"MM", b"SC",
];

/// Commands that act rather than query.
const ACTIONS: [&[u8; 2]; 3] = [b"AC", b"CN", b"WR"];

/// The most packets that a radio keeps until they are sent.
const MOST_WAITING: usize = 64;

/// Silence that the line needs before `+++`, and until it is answered, in seconds (`GT`).
const GUARD_S: f64 = 1.0;

/// Commands are taken for this time after the last one, in seconds (`CT`).
const COMMAND_S: f64 = 10.0;

/// A radio's answers to AT commands.
#[derive(Clone, Debug)]
struct Registers {
    values: BTreeMap<[u8; 2], Vec<u8>>,
}

impl Registers {
    fn new(firmware: Protocol, ap: u8, long: Address64, short: Address16, name: &str) -> Self {
        let (version, short) = match firmware {
            Protocol::Ieee802154 => ([0x20, 0x03], short),
            Protocol::DigiMesh => ([0x90, 0x02], Address16::UNKNOWN),
            _ => ([0x40, 0x60], short),
        };
        let address = long.0.to_be_bytes();
        let mut values: BTreeMap<[u8; 2], Vec<u8>> = [
            (*b"AP", vec![ap]),
            (*b"HV", vec![0x2E, 0x47]),
            (*b"VR", version.to_vec()),
            (*b"SH", address[..4].to_vec()),
            (*b"SL", address[4..].to_vec()),
            (*b"MY", short.0.to_be_bytes().to_vec()),
            (*b"NI", name.as_bytes().to_vec()),
            (*b"ID", vec![0x33, 0x32]),
            (*b"CH", vec![0x0C]),
            (*b"CE", vec![0]),
            (*b"NT", vec![0x03]),
            (*b"NO", vec![0]),
            (*b"SM", vec![0]),
            (*b"BD", vec![0, 0, 0, 6]),
            (*b"DH", vec![0, 0, 0, 0]),
            (*b"DL", vec![0, 0, 0, 0]),
            (*b"PL", vec![4]),
            (*b"AI", vec![0]),
            // Nothing was received yet.
            (*b"DB", vec![0]),
            (*b"%V", vec![0x0C, 0xE4]),
        ]
        .into();
        if firmware == Protocol::Zigbee {
            values.insert(*b"OP", vec![0, 0, 0, 0, 0, 0, 0x33, 0x32]);
            values.insert(*b"OI", vec![0x1A, 0x2B]);
        }
        if firmware != Protocol::Ieee802154 {
            values.insert(*b"AO", vec![0]);
        }
        Self { values }
    }

    /// Queries, where there is no parameter; otherwise sets.
    fn query(&mut self, command: AtCommand, parameter: &[u8]) -> (AtStatus, Vec<u8>) {
        let key = command.0;
        if ACTIONS.contains(&&key) {
            return (AtStatus::OK, Vec::new());
        }
        let Some(value) = self.values.get_mut(&key) else {
            return (AtStatus::INVALID_COMMAND, Vec::new());
        };
        if parameter.is_empty() {
            return (AtStatus::OK, value.clone());
        }
        let longest = if key == *b"NI" { 20 } else { 8 };
        let wrong_mode = key == *b"AP" && !matches!(parameter, [0..=2]);
        if !SETTABLE.contains(&&key) || parameter.len() > longest || wrong_mode {
            return (AtStatus::INVALID_PARAMETER, Vec::new());
        }
        *value = parameter.to_vec();
        (AtStatus::OK, Vec::new())
    }

    /// The API mode that is set.
    fn ap(&self) -> u8 {
        self.values.get(b"AP").and_then(|value| value.first()).copied().unwrap_or(0)
    }

    /// A packet came in with this power.
    fn received(&mut self, neg_dbm: u8) {
        self.values.insert(*b"DB", vec![neg_dbm]);
    }

    /// Returns the name of the radio, its `NI`.
    fn name(&self) -> &[u8] {
        self.values.get(b"NI").map_or(&[], Vec::as_slice)
    }
}

/// A packet or a command to a beacon.
#[derive(Clone, Debug)]
struct Outgoing {
    /// Nobody has the address where this is absent.
    beacon: Option<BeaconId>,
    payload: Payload,
}

#[derive(Clone, Debug)]
enum Payload {
    /// A packet, which the beacon sends back; by its short address.
    Packet { id: u8, data: Vec<u8>, short: bool },
    /// A question to the beacon's radio.
    Command { id: u8, command: AtCommand, parameter: Vec<u8>, to64: Address64, to16: Address16 },
    /// A search for the radios that are there.
    Discovery { id: u8 },
    /// The end of a discovery.
    Discovered { id: u8 },
}

/// The packets to beacons, one after the other, and their answers through a world.
#[derive(Debug)]
struct Air {
    radio: SimRadio,
    firmware: Protocol,
    beacons: Vec<Registers>,
    /// The first one was sent, until then, where a time stands.
    waiting: std::collections::VecDeque<Outgoing>,
    until: Option<f64>,
    no_answer_s: f64,
}

impl Air {
    fn new(radio: SimRadio, firmware: Protocol, names: &[String], no_answer_s: f64) -> Self {
        let beacons = (0..).zip(names).map(|(number, name)| {
            let (long, short) = xbee_address(BeaconId(number));
            Registers::new(firmware, 1, long, short, name)
        });
        let beacons = beacons.collect();
        Self { radio, firmware, beacons, waiting: <_>::default(), until: None, no_answer_s }
    }

    fn beacons(&self) -> impl Iterator<Item = BeaconId> + use<> {
        (0..u16::try_from(self.beacons.len()).unwrap_or(u16::MAX)).map(BeaconId)
    }

    /// Returns the beacon that has these addresses.
    fn beacon_at(&self, to64: Address64, to16: Address16) -> Option<BeaconId> {
        self.beacons().find(|beacon| {
            let (long, short) = xbee_address(*beacon);
            long == to64 || to64 == Address64::UNKNOWN && short == to16
        })
    }

    /// Queues a packet; false where there is no room for it.
    fn enqueue(&mut self, payload: Outgoing) -> bool {
        let room = self.waiting.len() < MOST_WAITING;
        if room {
            self.waiting.push_back(payload);
        }
        room
    }

    /// Discards what is queued.
    fn reset(&mut self) {
        self.waiting.clear();
        self.until = None;
    }

    /// The frames that the radio reports at the time `now`; `own` keeps the answers' level.
    fn advance(&mut self, own: &mut Registers, now: f64) -> Vec<Frame> {
        let mut sent = Vec::new();
        while let Some(first) = self.waiting.front() {
            let requested = first.beacon;
            let until = if let Some(until) = self.until {
                until
            } else {
                if let Some(beacon) = requested {
                    // A beacon that the world does not have stays silent.
                    let _ = self.radio.request(beacon);
                }
                let until = now + self.no_answer_s;
                self.until = Some(until);
                until
            };
            let level = match requested {
                Some(_) => self.radio.poll().ok().flatten(),
                None => None,
            };
            let ends = matches!(first.payload, Payload::Discovered { .. });
            if level.is_none() && !ends && now < until {
                break;
            }
            self.until = None;
            let Some(Outgoing { beacon, payload }) = self.waiting.pop_front() else { break };
            match (beacon, level) {
                (Some(beacon), Some(level)) => {
                    let incoming = neg_dbm(level);
                    own.received(incoming);
                    sent.extend(self.answered(beacon, incoming, payload));
                }
                _ => sent.extend(self.unanswered(beacon, payload)),
            }
        }
        sent
    }

    /// Returns the frames that come if a beacon was received.
    fn answered(&mut self, beacon: BeaconId, incoming: u8, payload: Payload) -> Vec<Frame> {
        let (long, short_address) = xbee_address(beacon);
        let from16 = match self.firmware {
            Protocol::DigiMesh => Address16::UNKNOWN,
            _ => short_address,
        };
        let mesh = self.firmware != Protocol::Ieee802154;
        let Some(registers) = self.beacons.get_mut(usize::from(beacon.0)) else {
            return Vec::new();
        };
        // The way back is as long as the way there.
        registers.received(incoming);
        match payload {
            Payload::Packet { id, data, .. } if mesh => vec![
                delivery(id, from16, DeliveryStatus::SUCCESS),
                Frame::Receive { from64: long, from16, options: 1, data },
            ],
            Payload::Packet { id, data, short } => {
                let rssi_neg_dbm = incoming;
                let options = 0;
                let received = if short {
                    Frame::Receive16 { from: short_address, rssi_neg_dbm, options, data }
                } else {
                    Frame::Receive64 { from: long, rssi_neg_dbm, options, data }
                };
                vec![Frame::TransmitStatus { id, status: TransmitStatus::SUCCESS }, received]
            }
            Payload::Command { id, command, parameter, .. } => {
                let (status, value) = registers.query(command, &parameter);
                vec![Frame::RemoteAtResponse { id, from64: long, from16, command, status, value }]
            }
            Payload::Discovery { id } => {
                let mut value = from16.0.to_be_bytes().to_vec();
                value.extend(long.0.to_be_bytes());
                if !mesh {
                    value.push(incoming);
                }
                value.extend(registers.name());
                value.push(0);
                if mesh {
                    // No parent, a router, nothing special; Digi's profile and number.
                    value.extend([0xFF, 0xFE, 1, 0, 0xC1, 0x05, 0x10, 0x1E]);
                }
                vec![Frame::AtResponse { id, command: AtCommand::ND, status: AtStatus::OK, value }]
            }
            Payload::Discovered { .. } => Vec::new(),
        }
    }

    /// Returns the frame that comes if nobody was received.
    fn unanswered(&self, beacon: Option<BeaconId>, payload: Payload) -> Option<Frame> {
        match payload {
            Payload::Packet { id, .. } if self.firmware == Protocol::Ieee802154 => {
                Some(Frame::TransmitStatus { id, status: TransmitStatus::NO_ACK })
            }
            Payload::Packet { id, .. } => {
                let unknown = DeliveryStatus(0x24);
                let delivery_status =
                    if beacon.is_some() { DeliveryStatus::NO_NETWORK_ACK } else { unknown };
                Some(delivery(id, Address16::UNKNOWN, delivery_status))
            }
            Payload::Command { id, command, to64, to16, .. } => Some(Frame::RemoteAtResponse {
                id,
                from64: to64,
                from16: to16,
                command,
                status: AtStatus::NO_ANSWER,
                value: Vec::new(),
            }),
            Payload::Discovery { .. } => None,
            Payload::Discovered { id } => {
                let command = AtCommand::ND;
                let status = AtStatus::OK;
                Some(Frame::AtResponse { id, command, status, value: Vec::new() })
            }
        }
    }
}

/// A radio that is not in an API mode: what comes is sent on the air, but for commands after `+++`.
#[derive(Debug, Default)]
struct Text {
    received_at: f64,
    /// `+++` came after silence; answered then, if nothing follows.
    entering: Option<f64>,
    /// Commands are taken until then.
    commands_until: Option<f64>,
    line: Vec<u8>,
}

impl Text {
    /// Takes what has come; the radio's answer.
    fn take_in(&mut self, bytes: &[u8], own: &mut Registers, now: f64) -> Vec<u8> {
        let mut sent = Vec::new();
        self.commands_until = self.commands_until.filter(|until| now < *until);
        if self.commands_until.is_none() && !bytes.is_empty() {
            let quiet = now - self.received_at >= GUARD_S;
            self.entering = (bytes == b"+++" && quiet).then_some(now + GUARD_S);
            self.received_at = now;
        } else if self.commands_until.is_some() {
            for byte in bytes {
                if *byte == b'\r' {
                    self.commands_until = Some(now + COMMAND_S);
                    sent.extend(self.command(own));
                } else if self.line.len() < 64 {
                    self.line.push(*byte);
                }
            }
        }
        if self.entering.is_some_and(|at| now >= at) {
            self.entering = None;
            self.commands_until = Some(now + COMMAND_S);
            self.line.clear();
            sent.extend(b"OK\r");
        }
        sent
    }

    /// Executes the line.
    fn command(&mut self, own: &mut Registers) -> Vec<u8> {
        let line = core::mem::take(&mut self.line);
        let (Some(b"AT"), Some(&[a, b])) =
            (line.get(..2), line.get(2..4).and_then(<[u8]>::first_chunk))
        else {
            return b"ERROR\r".to_vec();
        };
        let command = AtCommand([a, b]);
        if command.0 == *b"CN" {
            self.commands_until = None;
        }
        let text = String::from_utf8_lossy(line.get(4..).unwrap_or_default()).trim().to_owned();
        let parameter = match (text.as_str(), u32::from_str_radix(&text, 16)) {
            ("", _) => Vec::new(),
            (_, Ok(number)) if number < 256 => vec![number.to_be_bytes()[3]],
            (_, Ok(number)) => number.to_be_bytes().to_vec(),
            _ => return b"ERROR\r".to_vec(),
        };
        match own.query(command, &parameter) {
            (AtStatus::OK, value) if value.is_empty() => b"OK\r".to_vec(),
            (AtStatus::OK, value) => {
                let hex: String = value.iter().map(|byte| format!("{byte:02X}")).collect();
                let short = hex.trim_start_matches('0');
                format!("{}\r", if short.is_empty() { "0" } else { short }).into_bytes()
            }
            _ => b"ERROR\r".to_vec(),
        }
    }
}

fn delivery(id: u8, to16: Address16, delivery: DeliveryStatus) -> Frame {
    Frame::DeliveryStatus { id, to16, retries: 0, delivery, discovery: 0 }
}

/// A level as radios report it: whole −dBm in a byte, in which 0 means nothing.
fn neg_dbm(level: f64) -> u8 {
    let whole = libm::round(-level).clamp(1.0, 255.0);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 1 to 255")]
    {
        whole as u8
    }
}

/// The addresses of a beacon in an emulated network, of 64 bits and of 16.
#[must_use]
pub fn xbee_address(beacon: BeaconId) -> (Address64, Address16) {
    let number = beacon.0;
    (Address64(0x0013_A200_4B00_0000 | u64::from(number)), Address16(0x5000 ^ number))
}

/// The address of the radio of a drone.
fn drone_address(drone: usize) -> Address64 {
    Address64(0x0013_A200_4D00_0000 | u64::try_from(drone & 0xFFFF).unwrap_or(0))
}
