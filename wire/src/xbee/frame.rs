//! The content of a frame, and reading it from a frame's data.

use super::{
    Address16, Address64, AtCommand, AtStatus, DeliveryStatus, ModemStatus, TransmitStatus,
    fields::Fields,
};

/// Longest data of a frame that is sent or accepted, in bytes: more than any 2.4 GHz radio of the
/// family carries. A length beyond it is taken for garbage.
pub const LONGEST_DATA: usize = 512;

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

    /// Returns the first byte of the frame: its type.
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

    /// Returns the frame's data: all bytes under the checksum, the first one included.
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

impl Frame {
    /// Content of a frame's data, the type included. Unknown types are kept as they are; bytes
    /// after the last field of a frame of fixed length are left out.
    ///
    /// # Errors
    ///
    /// [`FrameError::NoSuchLength`] without any data; [`FrameError::Short`] if fields are missing.
    pub fn from_data(data: &[u8]) -> Result<Self, FrameError> {
        let Some((frame_type, rest)) = data.split_first() else {
            return Err(FrameError::NoSuchLength { length: 0 });
        };
        parsed(*frame_type, &mut Fields(rest))
            .ok_or(FrameError::Short { frame_type: *frame_type, length: data.len() })
    }
}

/// `None` if fields are missing. Fields are read in the order in which they stand here.
fn parsed(frame_type: u8, f: &mut Fields<'_>) -> Option<Frame> {
    Some(match frame_type {
        0x00 => Frame::Transmit64 {
            id: f.byte()?,
            to: f.address64()?,
            options: f.byte()?,
            data: f.rest(),
        },
        0x01 => Frame::Transmit16 {
            id: f.byte()?,
            to: f.address16()?,
            options: f.byte()?,
            data: f.rest(),
        },
        0x08 => Frame::AtCommand { id: f.byte()?, command: f.command()?, parameter: f.rest() },
        0x09 => {
            Frame::QueuedAtCommand { id: f.byte()?, command: f.command()?, parameter: f.rest() }
        }
        0x10 => Frame::Transmit {
            id: f.byte()?,
            to64: f.address64()?,
            to16: f.address16()?,
            broadcast_radius: f.byte()?,
            options: f.byte()?,
            data: f.rest(),
        },
        0x11 => Frame::ExplicitTransmit {
            id: f.byte()?,
            to64: f.address64()?,
            to16: f.address16()?,
            source_endpoint: f.byte()?,
            destination_endpoint: f.byte()?,
            cluster: f.word()?,
            profile: f.word()?,
            broadcast_radius: f.byte()?,
            options: f.byte()?,
            data: f.rest(),
        },
        0x17 => Frame::RemoteAtCommand {
            id: f.byte()?,
            to64: f.address64()?,
            to16: f.address16()?,
            options: f.byte()?,
            command: f.command()?,
            parameter: f.rest(),
        },
        0x80 => Frame::Receive64 {
            from: f.address64()?,
            rssi_neg_dbm: f.byte()?,
            options: f.byte()?,
            data: f.rest(),
        },
        0x81 => Frame::Receive16 {
            from: f.address16()?,
            rssi_neg_dbm: f.byte()?,
            options: f.byte()?,
            data: f.rest(),
        },
        0x88 => Frame::AtResponse {
            id: f.byte()?,
            command: f.command()?,
            status: AtStatus(f.byte()?),
            value: f.rest(),
        },
        0x89 => Frame::TransmitStatus { id: f.byte()?, status: TransmitStatus(f.byte()?) },
        0x8A => Frame::ModemStatus { status: ModemStatus(f.byte()?) },
        0x8B => Frame::DeliveryStatus {
            id: f.byte()?,
            to16: f.address16()?,
            retries: f.byte()?,
            delivery: DeliveryStatus(f.byte()?),
            discovery: f.byte()?,
        },
        0x90 => Frame::Receive {
            from64: f.address64()?,
            from16: f.address16()?,
            options: f.byte()?,
            data: f.rest(),
        },
        0x91 => Frame::ExplicitReceive {
            from64: f.address64()?,
            from16: f.address16()?,
            source_endpoint: f.byte()?,
            destination_endpoint: f.byte()?,
            cluster: f.word()?,
            profile: f.word()?,
            options: f.byte()?,
            data: f.rest(),
        },
        0x97 => Frame::RemoteAtResponse {
            id: f.byte()?,
            from64: f.address64()?,
            from16: f.address16()?,
            command: f.command()?,
            status: AtStatus(f.byte()?),
            value: f.rest(),
        },
        _ => Frame::Unknown { frame_type, data: f.rest() },
    })
}

/// Reason that bytes are no frame, or a frame has no bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// It does not begin as frames do.
    #[error("a frame begins with 7E, not {found:02X}")]
    Delimiter {
        /// First byte received.
        found: u8,
    },
    /// The frame's length is not the declared one.
    #[error("a frame of {actual} bytes of data declares {declared}")]
    Length {
        /// The declared length.
        declared: usize,
        /// Length of its data.
        actual: usize,
    },
    /// It declares, or has, a length that no frame has.
    #[error("a frame with {length} bytes of data; there are at least 1 and at most {LONGEST_DATA}")]
    NoSuchLength {
        /// The length of its data.
        length: usize,
    },
    /// Bytes were changed on the way.
    #[error("a frame's checksum is {declared:02X}; its data have {computed:02X}")]
    Checksum {
        /// The declared checksum.
        declared: u8,
        /// The checksum of its data.
        computed: u8,
    },
    /// The next frame began, or the line fell quiet, before it was complete.
    #[error("a frame was cut after {bytes} bytes")]
    Cut {
        /// Number of bytes received, the delimiter included, unescaped.
        bytes: usize,
    },
    /// It is too short for its type.
    #[error("{length} bytes of data are too few for a frame of type {frame_type:02X}")]
    Short {
        /// Type of the frame: its first byte.
        frame_type: u8,
        /// The length of its data.
        length: usize,
    },
}
