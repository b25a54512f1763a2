use foxhunt_core::BeaconId;
use foxhunt_wire::xbee::{Address, Address16, Address64, AtCommand, Frame, Protocol};

use super::{XbeeConfig, XbeeError, XbeeQuestion};

/// The one question that is outstanding.
#[derive(Clone, Debug)]
pub(super) struct Outstanding {
    pub(super) beacon: BeaconId,
    pub(super) address: Address,
    pub(super) stage: Stage,
}

/// Stage of the question.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Stage {
    /// To be sent, not before then.
    Queued { from: f64 },
    /// Sent with this number; its answer begins with `token`, and is waited for until then.
    Sent { id: u8, token: Vec<u8>, until: f64 },
    /// Answered; the radio was queried for the power with this number.
    Answered { id: u8, until: f64 },
}

/// The query that a radio with this firmware sends.
pub(super) fn manner(config: &XbeeConfig, protocol: Protocol) -> Result<XbeeQuestion, XbeeError> {
    let frames_have_rssi = protocol == Protocol::Ieee802154;
    if protocol == Protocol::DigiMesh {
        let short = config.beacons.iter().find(|address| matches!(address, Address::Short(_)));
        if let Some(address) = short {
            return Err(XbeeError::Address { address: *address });
        }
    }
    match config.question {
        XbeeQuestion::Auto if frames_have_rssi => Ok(XbeeQuestion::ReceivedRssi),
        XbeeQuestion::Auto => Ok(XbeeQuestion::TransmitDb),
        question @ XbeeQuestion::ReceivedRssi if !frames_have_rssi => {
            Err(XbeeError::Question { protocol, question })
        }
        question => Ok(question),
    }
}

/// The frame of a query, and what its answer begins with.
pub(super) fn query(
    config: &XbeeConfig,
    protocol: Protocol,
    manner: XbeeQuestion,
    address: Address,
    id: u8,
    number: u16,
) -> (Frame, Vec<u8>) {
    let (to64, to16) = match address {
        Address::Long(to) => (to, Address16::UNKNOWN),
        Address::Short(to) => (Address64::UNKNOWN, to),
    };
    if manner == XbeeQuestion::RemoteDb {
        let command = AtCommand::DB;
        let parameter = Vec::new();
        let frame = Frame::RemoteAtCommand { id, to64, to16, options: 0, command, parameter };
        return (frame, Vec::new());
    }
    let mut data = config.payload.clone().into_bytes();
    let mut token = Vec::new();
    if config.echoed {
        data.extend(number.to_be_bytes());
        token.clone_from(&data);
    }
    let frame = match (protocol, address) {
        (Protocol::Ieee802154, Address::Long(to)) => Frame::Transmit64 { id, to, options: 0, data },
        (Protocol::Ieee802154, Address::Short(to)) => {
            Frame::Transmit16 { id, to, options: 0, data }
        }
        _ => Frame::Transmit { id, to64, to16, broadcast_radius: 0, options: 0, data },
    };
    (frame, token)
}

/// A packet that came over the air: from whom, what it brought, and its power in −dBm where the
/// frame reports that.
pub(super) struct Packet<'a> {
    from64: Option<Address64>,
    from16: Option<Address16>,
    pub(super) data: &'a [u8],
    pub(super) rssi_neg_dbm: Option<u8>,
}

impl<'a> Packet<'a> {
    /// `None` for what the radio reports of itself.
    pub(super) fn of(frame: &'a Frame) -> Option<Self> {
        let (from64, from16, data, rssi_neg_dbm) = match frame {
            Frame::Receive64 { from, rssi_neg_dbm, data, .. } => {
                (Some(*from), None, data.as_slice(), Some(*rssi_neg_dbm))
            }
            Frame::Receive16 { from, rssi_neg_dbm, data, .. } => {
                (None, Some(*from), data.as_slice(), Some(*rssi_neg_dbm))
            }
            Frame::Receive { from64, from16, data, .. }
            | Frame::ExplicitReceive { from64, from16, data, .. } => {
                (Some(*from64), Some(*from16), data.as_slice(), None)
            }
            Frame::RemoteAtResponse { from64, from16, .. } => {
                (Some(*from64), Some(*from16), &[][..], None)
            }
            // Samples of inputs, node identifications, and what else is received.
            Frame::Unknown { frame_type: 0x82..=0x87 | 0x8E | 0x92..=0xAF, data } => {
                (None, None, data.as_slice(), None)
            }
            _ => return None,
        };
        Some(Self { from64, from16, data, rssi_neg_dbm })
    }

    pub(super) fn is_from(&self, address: Address) -> bool {
        match address {
            Address::Long(address) => self.from64 == Some(address),
            Address::Short(address) => self.from16 == Some(address),
        }
    }
}
