/// Header that a server of rtl_tcp sends first: 12 bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RtlTcpHeader {
    /// The kind of tuner; 5 is an R820T.
    pub tuner: u32,
    /// Number of steps of its gain.
    pub gains: u32,
}

/// Error of a server whose first bytes are no header of rtl_tcp.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the server begins with {found:02X?}, and rtl_tcp with \"RTL0\"")]
pub struct RtlTcpError {
    found: [u8; 4],
}

impl RtlTcpHeader {
    /// Its length in bytes.
    pub const LENGTH: usize = 12;

    /// Its bytes.
    #[must_use]
    pub fn encode(&self) -> [u8; Self::LENGTH] {
        let [a, b, c, d] = self.tuner.to_be_bytes();
        let [e, f, g, h] = self.gains.to_be_bytes();
        [b'R', b'T', b'L', b'0', a, b, c, d, e, f, g, h]
    }

    /// The header that these bytes are.
    ///
    /// # Errors
    ///
    /// [`RtlTcpError`] if it begins otherwise.
    pub fn decode(bytes: [u8; Self::LENGTH]) -> Result<Self, RtlTcpError> {
        let [r, t, l, zero, a, b, c, d, e, f, g, h] = bytes;
        let found = [r, t, l, zero];
        if found != *b"RTL0" {
            return Err(RtlTcpError { found });
        }
        let tuner = u32::from_be_bytes([a, b, c, d]);
        let gains = u32::from_be_bytes([e, f, g, h]);
        Ok(Self { tuner, gains })
    }
}

/// A command of a client of rtl_tcp: a number, and a value of 32 bits, big endian.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RtlTcpCommand {
    /// 01: the frequency in the middle, in Hz.
    Frequency(u32),
    /// 02: samples per second.
    SampleRate(u32),
    /// 03: the gain is set by hand; otherwise by the tuner.
    ManualGain(bool),
    /// 04: the gain, in tenths of a dB.
    Gain(i32),
    /// 05: the correction of the oscillator, in parts per million.
    Correction(i32),
    /// 08: the digital gain control of the converter.
    DigitalGain(bool),
    /// Any other.
    Other(u8, u32),
}

impl RtlTcpCommand {
    /// Length of a command in bytes.
    pub const LENGTH: usize = 5;

    /// Its bytes.
    #[must_use]
    pub fn encode(self) -> [u8; Self::LENGTH] {
        let (number, value) = match self {
            Self::Frequency(hz) => (1, hz.to_be_bytes()),
            Self::SampleRate(hz) => (2, hz.to_be_bytes()),
            Self::ManualGain(on) => (3, u32::from(on).to_be_bytes()),
            Self::Gain(tenths) => (4, tenths.to_be_bytes()),
            Self::Correction(ppm) => (5, ppm.to_be_bytes()),
            Self::DigitalGain(on) => (8, u32::from(on).to_be_bytes()),
            Self::Other(number, value) => (number, value.to_be_bytes()),
        };
        let [a, b, c, d] = value;
        [number, a, b, c, d]
    }

    /// The command that these bytes are.
    #[must_use]
    pub fn decode(bytes: [u8; Self::LENGTH]) -> Self {
        let [number, value @ ..] = bytes;
        let unsigned = u32::from_be_bytes(value);
        let signed = i32::from_be_bytes(value);
        match number {
            1 => Self::Frequency(unsigned),
            2 => Self::SampleRate(unsigned),
            3 => Self::ManualGain(unsigned != 0),
            4 => Self::Gain(signed),
            5 => Self::Correction(signed),
            8 => Self::DigitalGain(unsigned != 0),
            _ => Self::Other(number, unsigned),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_bytes_are_those_of_the_original() {
        let header = RtlTcpHeader { tuner: 5, gains: 29 };
        assert_eq!(header.encode(), *b"RTL0\0\0\0\x05\0\0\0\x1d");
        assert_eq!(RtlTcpHeader::decode(header.encode()), Ok(header));
        let error = RtlTcpHeader::decode(*b"HTTP/1.1 400").expect_err("it is none");
        assert!(error.to_string().contains("48, 54"), "{error}");
        assert_eq!(RtlTcpCommand::Frequency(433_920_000).encode(), [1, 0x19, 0xDD, 0x18, 0]);
        assert_eq!(RtlTcpCommand::Gain(-10).encode(), [4, 0xFF, 0xFF, 0xFF, 0xF6]);
    }

    proptest! {
        #[test]
        fn commands_come_back(bytes: [u8; 5]) {
            let command = RtlTcpCommand::decode(bytes);
            prop_assert_eq!(RtlTcpCommand::decode(command.encode()), command);
        }
    }
}
