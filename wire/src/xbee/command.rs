use std::fmt;

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
