use super::{
    AtStatus, DeliveryStatus, Frame, FrameError, ModemStatus, TransmitStatus, fields::Fields,
};

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
