use super::{
    Address16, Address64, AtCommand, AtStatus, DeliveryStatus, ModemStatus, TransmitStatus,
};

/// Content of a frame. The number of its type stands before each; `id` pairs a question with its
/// answer, and 0 requests none.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
#[expect(missing_docs, reason = "fields are called as in the radio's manual")]
pub enum Frame {
    /// 00: send to a 64-bit address (802.15.4).
    Transmit64 { id: u8, to: Address64, options: u8, data: Vec<u8> },
    /// 01: send to a 16-bit address (802.15.4).
    Transmit16 { id: u8, to: Address16, options: u8, data: Vec<u8> },
    /// 08: query or set something of the radio itself.
    AtCommand { id: u8, command: AtCommand, parameter: Vec<u8> },
    /// 09: like 08, but applied only along with the next command that is.
    QueuedAtCommand { id: u8, command: AtCommand, parameter: Vec<u8> },
    /// 10: send (Zigbee, `DigiMesh`).
    Transmit {
        id: u8,
        to64: Address64,
        to16: Address16,
        broadcast_radius: u8,
        options: u8,
        data: Vec<u8>,
    },
    /// 11: send to an endpoint of the application layer (Zigbee, `DigiMesh`).
    ExplicitTransmit {
        id: u8,
        to64: Address64,
        to16: Address16,
        source_endpoint: u8,
        destination_endpoint: u8,
        cluster: u16,
        profile: u16,
        broadcast_radius: u8,
        options: u8,
        data: Vec<u8>,
    },
    /// 17: query or set something of another radio. Option 2 applies it at once.
    RemoteAtCommand {
        id: u8,
        to64: Address64,
        to16: Address16,
        options: u8,
        command: AtCommand,
        parameter: Vec<u8>,
    },
    /// 80: received from a 64-bit address, with the power in −dBm (802.15.4).
    Receive64 { from: Address64, rssi_neg_dbm: u8, options: u8, data: Vec<u8> },
    /// 81: received from a 16-bit address, with the power in −dBm (802.15.4).
    Receive16 { from: Address16, rssi_neg_dbm: u8, options: u8, data: Vec<u8> },
    /// 88: the radio's own answer.
    AtResponse { id: u8, command: AtCommand, status: AtStatus, value: Vec<u8> },
    /// 89: the result of 00 or 01.
    TransmitStatus { id: u8, status: TransmitStatus },
    /// 8A: something happened to the radio.
    ModemStatus { status: ModemStatus },
    /// 8B: the result of 10 or 11.
    DeliveryStatus { id: u8, to16: Address16, retries: u8, delivery: DeliveryStatus, discovery: u8 },
    /// 90: received (Zigbee, `DigiMesh`).
    Receive { from64: Address64, from16: Address16, options: u8, data: Vec<u8> },
    /// 91: received, with the application layer's fields (Zigbee, `DigiMesh`).
    ExplicitReceive {
        from64: Address64,
        from16: Address16,
        source_endpoint: u8,
        destination_endpoint: u8,
        cluster: u16,
        profile: u16,
        options: u8,
        data: Vec<u8>,
    },
    /// 97: another radio's answer.
    RemoteAtResponse {
        id: u8,
        from64: Address64,
        from16: Address16,
        command: AtCommand,
        status: AtStatus,
        value: Vec<u8>,
    },
    /// Any other, as it came: its first byte, and the rest.
    Unknown { frame_type: u8, data: Vec<u8> },
}

impl Frame {
    /// A query to the radio itself.
    #[must_use]
    pub fn at(id: u8, command: AtCommand) -> Self {
        Self::AtCommand { id, command, parameter: Vec::new() }
    }

    /// Its first byte.
    #[must_use]
    pub fn frame_type(&self) -> u8 {
        match self {
            Self::Transmit64 { .. } => 0x00,
            Self::Transmit16 { .. } => 0x01,
            Self::AtCommand { .. } => 0x08,
            Self::QueuedAtCommand { .. } => 0x09,
            Self::Transmit { .. } => 0x10,
            Self::ExplicitTransmit { .. } => 0x11,
            Self::RemoteAtCommand { .. } => 0x17,
            Self::Receive64 { .. } => 0x80,
            Self::Receive16 { .. } => 0x81,
            Self::AtResponse { .. } => 0x88,
            Self::TransmitStatus { .. } => 0x89,
            Self::ModemStatus { .. } => 0x8A,
            Self::DeliveryStatus { .. } => 0x8B,
            Self::Receive { .. } => 0x90,
            Self::ExplicitReceive { .. } => 0x91,
            Self::RemoteAtResponse { .. } => 0x97,
            Self::Unknown { frame_type, .. } => *frame_type,
        }
    }

    /// Its data: all bytes under the checksum, the first one included.
    #[must_use]
    pub fn data(&self) -> Vec<u8> {
        let mut out = vec![self.frame_type()];
        match self {
            Self::Transmit64 { id, to, options, data } => {
                out.push(*id);
                out.extend(to.0.to_be_bytes());
                out.push(*options);
                out.extend(data);
            }
            Self::Transmit16 { id, to, options, data } => {
                out.push(*id);
                out.extend(to.0.to_be_bytes());
                out.push(*options);
                out.extend(data);
            }
            Self::AtCommand { id, command, parameter }
            | Self::QueuedAtCommand { id, command, parameter } => {
                out.push(*id);
                out.extend(command.0);
                out.extend(parameter);
            }
            Self::Transmit { id, to64, to16, broadcast_radius, options, data } => {
                out.push(*id);
                out.extend(to64.0.to_be_bytes());
                out.extend(to16.0.to_be_bytes());
                out.extend([*broadcast_radius, *options]);
                out.extend(data);
            }
            Self::ExplicitTransmit {
                id,
                to64,
                to16,
                source_endpoint,
                destination_endpoint,
                cluster,
                profile,
                broadcast_radius,
                options,
                data,
            } => {
                out.push(*id);
                out.extend(to64.0.to_be_bytes());
                out.extend(to16.0.to_be_bytes());
                out.extend([*source_endpoint, *destination_endpoint]);
                out.extend(cluster.to_be_bytes());
                out.extend(profile.to_be_bytes());
                out.extend([*broadcast_radius, *options]);
                out.extend(data);
            }
            Self::RemoteAtCommand { id, to64, to16, options, command, parameter } => {
                out.push(*id);
                out.extend(to64.0.to_be_bytes());
                out.extend(to16.0.to_be_bytes());
                out.push(*options);
                out.extend(command.0);
                out.extend(parameter);
            }
            Self::Receive64 { from, rssi_neg_dbm, options, data } => {
                out.extend(from.0.to_be_bytes());
                out.extend([*rssi_neg_dbm, *options]);
                out.extend(data);
            }
            Self::Receive16 { from, rssi_neg_dbm, options, data } => {
                out.extend(from.0.to_be_bytes());
                out.extend([*rssi_neg_dbm, *options]);
                out.extend(data);
            }
            Self::AtResponse { id, command, status, value } => {
                out.push(*id);
                out.extend(command.0);
                out.push(status.0);
                out.extend(value);
            }
            Self::TransmitStatus { id, status } => out.extend([*id, status.0]),
            Self::ModemStatus { status } => out.push(status.0),
            Self::DeliveryStatus { id, to16, retries, delivery, discovery } => {
                out.push(*id);
                out.extend(to16.0.to_be_bytes());
                out.extend([*retries, delivery.0, *discovery]);
            }
            Self::Receive { from64, from16, options, data } => {
                out.extend(from64.0.to_be_bytes());
                out.extend(from16.0.to_be_bytes());
                out.push(*options);
                out.extend(data);
            }
            Self::ExplicitReceive {
                from64,
                from16,
                source_endpoint,
                destination_endpoint,
                cluster,
                profile,
                options,
                data,
            } => {
                out.extend(from64.0.to_be_bytes());
                out.extend(from16.0.to_be_bytes());
                out.extend([*source_endpoint, *destination_endpoint]);
                out.extend(cluster.to_be_bytes());
                out.extend(profile.to_be_bytes());
                out.push(*options);
                out.extend(data);
            }
            Self::RemoteAtResponse { id, from64, from16, command, status, value } => {
                out.push(*id);
                out.extend(from64.0.to_be_bytes());
                out.extend(from16.0.to_be_bytes());
                out.extend(command.0);
                out.push(status.0);
                out.extend(value);
            }
            Self::Unknown { data, .. } => out.extend(data),
        }
        out
    }
}
