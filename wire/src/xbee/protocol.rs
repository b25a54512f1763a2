use std::fmt;

use serde::{Deserialize, Serialize};

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

/// The kinds of module that differ in how they number their firmware: the first byte of `HV`.
const SERIES_1: [u8; 2] = [0x17, 0x18];
const SERIES_2: [u8; 3] = [0x19, 0x1A, 0x1E];
const S2C_P5: u8 = 0x53;

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

#[cfg(test)]
mod tests {
    use super::*;

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
