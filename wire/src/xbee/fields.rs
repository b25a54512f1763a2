//! Fields of frames: addresses, commands, statuses, and the radio's protocol.

use std::{fmt, str::FromStr};

use serde::{Deserialize, Serialize};

/// The kinds of module that differ in how they number their firmware: the first byte of `HV`.
const SERIES_1: [u8; 2] = [0x17, 0x18];
const SERIES_2: [u8; 3] = [0x19, 0x1A, 0x1E];
const S2C_P5: u8 = 0x53;

/// A radio's 64-bit address, which it was made with: `SH` and `SL`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Address64(pub u64);

impl Address64 {
    /// Everyone.
    pub const BROADCAST: Self = Self(0xFFFF);
    /// Placeholder where the 16-bit address counts instead.
    pub const UNKNOWN: Self = Self(u64::MAX);
}

/// A radio's 16-bit address in its network: `MY`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Address16(pub u16);

impl Address16 {
    /// Placeholder where the 64-bit address counts instead.
    pub const UNKNOWN: Self = Self(0xFFFE);
}

/// One of the two, as it stands in configurations: 16 hexadecimal digits, or 4.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Address {
    /// A 64-bit one.
    Long(Address64),
    /// A 16-bit one.
    Short(Address16),
}

/// Error of a text that is no address.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{text:?} is not an XBee address: 16 hexadecimal digits (SH, then SL), or 4 (MY)")]
pub struct AddressError {
    text: String,
}

impl FromStr for Address {
    type Err = AddressError;

    fn from_str(text: &str) -> Result<Self, AddressError> {
        let wrong = || AddressError { text: text.to_owned() };
        if !text.bytes().all(|byte| byte.is_ascii_hexdigit()) {
            return Err(wrong());
        }
        match text.len() {
            16 => u64::from_str_radix(text, 16).map(|a| Self::Long(Address64(a))),
            4 => u16::from_str_radix(text, 16).map(|a| Self::Short(Address16(a))),
            _ => return Err(wrong()),
        }
        .map_err(|_| wrong())
    }
}

impl fmt::Display for Address64 {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016X}", self.0)
    }
}

impl fmt::Display for Address16 {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:04X}", self.0)
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Long(address) => address.fmt(f),
            Self::Short(address) => address.fmt(f),
        }
    }
}

impl TryFrom<String> for Address {
    type Error = AddressError;

    fn try_from(text: String) -> Result<Self, AddressError> {
        text.parse()
    }
}

impl From<Address> for String {
    fn from(address: Address) -> Self {
        address.to_string()
    }
}

/// The two letters of an AT command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct AtCommand(pub [u8; 2]);

impl AtCommand {
    /// The API mode: 0 transparent, 1 plain frames, 2 escaped frames.
    pub const AP: Self = Self(*b"AP");
    /// The power of the last packet that was received, from whomever, in −dBm.
    pub const DB: Self = Self(*b"DB");
    /// The hardware's version; its first byte is the kind of module.
    pub const HV: Self = Self(*b"HV");
    /// The 16-bit address.
    pub const MY: Self = Self(*b"MY");
    /// Looks for other radios.
    pub const ND: Self = Self(*b"ND");
    /// The radio's name.
    pub const NI: Self = Self(*b"NI");
    /// The upper half of the 64-bit address.
    pub const SH: Self = Self(*b"SH");
    /// The lower half of the 64-bit address.
    pub const SL: Self = Self(*b"SL");
    /// The firmware's version.
    pub const VR: Self = Self(*b"VR");
}

impl fmt::Display for AtCommand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0.escape_ascii())
    }
}

/// The protocol of a firmware on the air, which decides which frames there are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Protocol {
    /// Plain 802.15.4: the power stands in every received frame.
    #[serde(rename = "802.15.4")]
    Ieee802154,
    /// Zigbee.
    #[default]
    Zigbee,
    /// `DigiMesh`.
    DigiMesh,
}

impl fmt::Display for Protocol {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Ieee802154 => "802.15.4",
            Self::Zigbee => "Zigbee",
            Self::DigiMesh => "DigiMesh",
        })
    }
}

impl Protocol {
    /// The protocol of a module of kind `hardware` (the first byte of `HV`) with `firmware` (`VR`):
    /// the first digit of the firmware's version, whose meaning depends on the module (Digi,
    /// "Firmware variants"; as in digi-xbee).
    #[must_use]
    pub fn of(hardware: u8, firmware: u16) -> Self {
        let digit = firmware >> 12;
        match digit {
            8 if SERIES_1.contains(&hardware) => Self::DigiMesh,
            _ if SERIES_1.contains(&hardware) => Self::Ieee802154,
            _ if SERIES_2.contains(&hardware) => Self::Zigbee,
            0xC if hardware == S2C_P5 => Self::Ieee802154,
            0xB if hardware == S2C_P5 => Self::DigiMesh,
            2 => Self::Ieee802154,
            3 | 8 | 9 => Self::DigiMesh,
            _ => Self::Zigbee,
        }
    }
}

/// The status of an AT command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct AtStatus(pub u8);

impl AtStatus {
    /// It was executed.
    pub const OK: Self = Self(0);
    /// It failed.
    pub const ERROR: Self = Self(1);
    /// There is no such command.
    pub const INVALID_COMMAND: Self = Self(2);
    /// The command's parameter is out of range.
    pub const INVALID_PARAMETER: Self = Self(3);
    /// The other radio, which was to execute it, does not answer.
    pub const NO_ANSWER: Self = Self(4);
}

impl fmt::Display for AtStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = match self.0 {
            0 => "done",
            1 => "error",
            2 => "invalid command",
            3 => "invalid parameter",
            4 => "the other radio does not answer",
            other => return write!(f, "status {other:#04x}"),
        };
        f.write_str(text)
    }
}

/// The status of a packet that was sent with a Zigbee or `DigiMesh` firmware: the delivery byte
/// of frame 8B.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct DeliveryStatus(pub u8);

impl DeliveryStatus {
    /// It was delivered.
    pub const SUCCESS: Self = Self(0x00);
    /// The network's acknowledgement did not come.
    pub const NO_NETWORK_ACK: Self = Self(0x21);

    /// Returns true if nobody at that address answers: no acknowledgement, no such address, no
    /// route.
    #[must_use]
    pub fn is_silence(self) -> bool {
        matches!(self.0, 0x01 | 0x21 | 0x24 | 0x25)
    }
}

impl fmt::Display for DeliveryStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = match self.0 {
            0x00 => "delivered",
            0x01 => "no acknowledgement from the next radio",
            0x02 => "the channel was not free",
            0x03 => "purged before it was sent",
            0x15 => "invalid destination endpoint",
            0x21 => "no acknowledgement from the network",
            0x22 => "not joined to a network",
            0x23 => "addressed to itself",
            0x24 => "no such address",
            0x25 => "no route",
            0x2C => "invalid request",
            0x31 => "internal error",
            0x32 => "the radio lacks resources",
            0x74 => "the payload is too long",
            other => return write!(f, "delivery status {other:#04x}"),
        };
        f.write_str(text)
    }
}

/// The status of a packet that was sent with an 802.15.4 firmware: frame 89.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct TransmitStatus(pub u8);

impl TransmitStatus {
    /// It was sent, and acknowledged where that was requested.
    pub const SUCCESS: Self = Self(0);
    /// No acknowledgement came.
    pub const NO_ACK: Self = Self(1);

    /// Returns true if nobody at that address answers.
    #[must_use]
    pub fn is_silence(self) -> bool {
        matches!(self.0, 0x01 | 0x21)
    }
}

impl fmt::Display for TransmitStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = match self.0 {
            0x00 => "sent",
            0x01 => "no acknowledgement",
            0x02 => "the channel was not free",
            0x03 => "purged before it was sent",
            0x21 => "no acknowledgement from the network",
            0x22 => "not joined to a network",
            0x31 => "internal error",
            0x32 => "the radio lacks resources",
            0x74 => "the payload is too long",
            other => return write!(f, "transmit status {other:#04x}"),
        };
        f.write_str(text)
    }
}

/// An event of the radio itself: frame 8A.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ModemStatus(pub u8);

impl ModemStatus {
    /// It was switched on.
    pub const HARDWARE_RESET: Self = Self(0);
    /// The watchdog reset the radio.
    pub const WATCHDOG_RESET: Self = Self(1);

    /// Returns true if the radio has just started.
    #[must_use]
    pub fn is_reset(self) -> bool {
        self == Self::HARDWARE_RESET || self == Self::WATCHDOG_RESET
    }
}

impl fmt::Display for ModemStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = match self.0 {
            0x00 => "hardware reset",
            0x01 => "watchdog reset",
            0x02 => "joined a network",
            0x03 => "left its network",
            0x06 => "coordinator started",
            0x0D => "the supply's voltage is too high",
            other => return write!(f, "modem status {other:#04x}"),
        };
        f.write_str(text)
    }
}

/// Takes a frame's data apart, front to back.
pub(super) struct Fields<'a>(pub &'a [u8]);

impl Fields<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (head, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(*head)
    }

    pub(super) fn byte(&mut self) -> Option<u8> {
        self.take().map(|[byte]| byte)
    }

    pub(super) fn word(&mut self) -> Option<u16> {
        self.take().map(u16::from_be_bytes)
    }

    pub(super) fn address64(&mut self) -> Option<Address64> {
        self.take().map(|bytes| Address64(u64::from_be_bytes(bytes)))
    }

    pub(super) fn address16(&mut self) -> Option<Address16> {
        self.word().map(Address16)
    }

    pub(super) fn command(&mut self) -> Option<AtCommand> {
        self.take().map(AtCommand)
    }

    /// Takes the remaining bytes.
    pub(super) fn rest(&mut self) -> Vec<u8> {
        core::mem::take(&mut self.0).to_vec()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_read_as_they_are_written() {
        for text in ["0013A20040AABBCC", "5001", "FFFE", "000000000000FFFF"] {
            assert_eq!(text.parse::<Address>().expect("an address").to_string(), text);
        }
        assert_eq!("abcd".parse(), Ok(Address::Short(Address16(0xABCD))));
        for text in ["", "13A20040AABBCC", "0013A20040AABBCX", "+001", "0x5001", "ß01"] {
            let error = text.parse::<Address>().expect_err("no address").to_string();
            assert!(error.contains(&format!("{text:?}")), "{error}");
        }
    }

    #[test]
    fn firmwares_are_distinguished() {
        for (hardware, firmware, protocol) in [
            (0x22, 0x4060, Protocol::Zigbee),
            (0x2E, 0x2003, Protocol::Ieee802154),
            (0x2D, 0x9002, Protocol::DigiMesh),
            (0x17, 0x10EC, Protocol::Ieee802154),
            (0x17, 0x8064, Protocol::DigiMesh),
            (0x19, 0x21A7, Protocol::Zigbee),
            (0x42, 0x1010, Protocol::Zigbee),
            (0x42, 0x200D, Protocol::Ieee802154),
            (0x42, 0x300D, Protocol::DigiMesh),
        ] {
            assert_eq!(Protocol::of(hardware, firmware), protocol, "{hardware:x} {firmware:x}");
        }
    }
}
