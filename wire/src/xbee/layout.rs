/// Longest data of a frame that is sent or accepted, in bytes: more than any 2.4 GHz radio of the
/// family carries. A length beyond it is taken for garbage.
pub const LONGEST_DATA: usize = 512;

/// First byte of a frame.
pub(super) const DELIMITER: u8 = 0x7E;
/// Byte before an escaped one.
pub(super) const ESCAPE: u8 = 0x7D;
/// Bits that escaping flips.
pub(super) const FLIP: u8 = 0x20;
/// Bytes of the delimiter and the length, before the data.
pub(super) const HEAD: usize = 3;
