use foxhunt_core::{BeaconId, Radio};
use foxhunt_wire::xbee::{
    Address16, Address64, AtCommand, AtStatus, DeliveryStatus, Frame, Protocol, TransmitStatus,
};

use super::{config::xbee_address, registers::Registers};
use crate::SimRadio;

/// A packet or a command to a beacon.
#[derive(Clone, Debug)]
pub(super) struct Outgoing {
    /// Nobody has the address where this is absent.
    pub(super) beacon: Option<BeaconId>,
    pub(super) payload: Payload,
}

#[derive(Clone, Debug)]
pub(super) enum Payload {
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
pub(super) struct Air {
    radio: SimRadio,
    firmware: Protocol,
    beacons: Vec<Registers>,
    /// The first one was sent, until then, where a time stands.
    waiting: std::collections::VecDeque<Outgoing>,
    until: Option<f64>,
    no_answer_s: f64,
}

/// The most packets that a radio keeps until they are sent.
const MOST_WAITING: usize = 64;

impl Air {
    pub(super) fn new(
        radio: SimRadio,
        firmware: Protocol,
        names: &[String],
        no_answer_s: f64,
    ) -> Self {
        let beacons = (0..).zip(names).map(|(number, name)| {
            let (long, short) = xbee_address(BeaconId(number));
            Registers::new(firmware, 1, long, short, name)
        });
        let beacons = beacons.collect();
        Self { radio, firmware, beacons, waiting: <_>::default(), until: None, no_answer_s }
    }

    pub(super) fn beacons(&self) -> impl Iterator<Item = BeaconId> + use<> {
        (0..u16::try_from(self.beacons.len()).unwrap_or(u16::MAX)).map(BeaconId)
    }

    /// Returns the beacon that has these addresses.
    pub(super) fn beacon_at(&self, to64: Address64, to16: Address16) -> Option<BeaconId> {
        self.beacons().find(|beacon| {
            let (long, short) = xbee_address(*beacon);
            long == to64 || to64 == Address64::UNKNOWN && short == to16
        })
    }

    /// Queues a packet; false where there is no room for it.
    pub(super) fn enqueue(&mut self, payload: Outgoing) -> bool {
        let room = self.waiting.len() < MOST_WAITING;
        if room {
            self.waiting.push_back(payload);
        }
        room
    }

    /// Discards what is queued.
    pub(super) fn reset(&mut self) {
        self.waiting.clear();
        self.until = None;
    }

    /// The frames that the radio reports at the time `now`; `own` keeps the answers' level.
    pub(super) fn advance(&mut self, own: &mut Registers, now: f64) -> Vec<Frame> {
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
