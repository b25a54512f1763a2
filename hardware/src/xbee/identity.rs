use std::fmt;

use foxhunt_wire::xbee::{Address64, ApiMode, Protocol};

/// Identity that a radio reported when it was set up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct XbeeIdentity {
    /// Its API mode.
    pub mode: ApiMode,
    /// The firmware's version, `VR`.
    pub firmware: u16,
    /// The hardware's version, `HV`.
    pub hardware: u16,
    /// The firmware's protocol on the air.
    pub protocol: Protocol,
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
