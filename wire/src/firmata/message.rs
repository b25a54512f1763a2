use super::FirmataError;

/// One direction's messages.
pub trait Message: Sized {
    /// Number of bytes of data after a status byte; `None` where no message begins with it.
    fn data_length(status: u8) -> Option<usize>;

    /// The message of a status byte and its data, the missing ones 0; `None` if there is no such
    /// message.
    fn from_short(status: u8, data: [u8; 2]) -> Option<Self>;

    /// The message of the payload between F0 and F7, all below 0x80; `None` if there is no such
    /// message.
    fn from_sysex(payload: &[u8]) -> Option<Self>;

    /// Appends its bytes.
    ///
    /// # Errors
    ///
    /// [`FirmataError`] where a number has no room in its message; nothing is appended then.
    fn encode(&self, into: &mut Vec<u8>) -> Result<(), FirmataError>;
}

/// First and last byte of a system exclusive message.
pub(super) const SYSEX: u8 = 0xF0;
pub(super) const END_SYSEX: u8 = 0xF7;

/// Bytes that follow F0.
pub(super) const STEPPER: u8 = 0x62;
pub(super) const ANALOG_MAPPING_QUERY: u8 = 0x69;
pub(super) const ANALOG_MAPPING: u8 = 0x6A;
pub(super) const CAPABILITY_QUERY: u8 = 0x6B;
pub(super) const CAPABILITIES: u8 = 0x6C;
pub(super) const PIN_STATE: u8 = 0x6E;
pub(super) const TEXT: u8 = 0x71;
pub(super) const FIRMWARE: u8 = 0x79;

/// First bytes of short messages.
pub(super) const DIGITAL: u8 = 0x90;
pub(super) const REPORT_DIGITAL: u8 = 0xD0;
pub(super) const PIN_MODE: u8 = 0xF4;
pub(super) const VERSION: u8 = 0xF9;
pub(super) const RESET: u8 = 0xFF;

/// Bytes that follow F0 62 in both directions.
pub(super) const REPORT: u8 = 0x06;
pub(super) const DONE: u8 = 0x0A;

/// Frames a payload.
pub(super) fn sysex(payload: &[u8], into: &mut Vec<u8>) {
    into.push(SYSEX);
    into.extend_from_slice(payload);
    into.push(END_SYSEX);
}
