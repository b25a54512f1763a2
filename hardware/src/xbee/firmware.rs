use std::fmt;

use foxhunt_wire::xbee::{Address64, ApiMode};

/// What a firmware speaks on the air, which decides which frames there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum XbeeProtocol {
    /// Plain 802.15.4: the power stands in every received frame.
    Ieee802154,
    /// Zigbee.
    Zigbee,
    /// `DigiMesh`.
    DigiMesh,
}

impl fmt::Display for XbeeProtocol {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Ieee802154 => "802.15.4",
            Self::Zigbee => "Zigbee",
            Self::DigiMesh => "DigiMesh",
        })
    }
}

/// The kinds of module that differ in how they number their firmware: the first byte of `HV`.
const SERIES_1: [u8; 2] = [0x17, 0x18];
const SERIES_2: [u8; 3] = [0x19, 0x1A, 0x1E];
const S2C_P5: u8 = 0x53;

impl XbeeProtocol {
    /// What a module of kind `hardware` (the first byte of `HV`) speaks with `firmware` (`VR`):
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

/// What a radio said of itself when it was set up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct XbeeIdentity {
    /// Its API mode.
    pub mode: ApiMode,
    /// The firmware's version, `VR`.
    pub firmware: u16,
    /// The hardware's version, `HV`.
    pub hardware: u16,
    /// What the firmware speaks.
    pub protocol: XbeeProtocol,
    /// Its address, `SH` and `SL`.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn firmwares_are_told_apart() {
        for (hardware, firmware, protocol) in [
            (0x22, 0x4060, XbeeProtocol::Zigbee),
            (0x2E, 0x2003, XbeeProtocol::Ieee802154),
            (0x2D, 0x9002, XbeeProtocol::DigiMesh),
            (0x17, 0x10EC, XbeeProtocol::Ieee802154),
            (0x17, 0x8064, XbeeProtocol::DigiMesh),
            (0x19, 0x21A7, XbeeProtocol::Zigbee),
            (0x42, 0x1010, XbeeProtocol::Zigbee),
            (0x42, 0x200D, XbeeProtocol::Ieee802154),
            (0x42, 0x300D, XbeeProtocol::DigiMesh),
        ] {
            assert_eq!(XbeeProtocol::of(hardware, firmware), protocol, "{hardware:x} {firmware:x}");
        }
    }
}
