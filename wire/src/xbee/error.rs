use super::LONGEST_DATA;

/// Reason that bytes are no frame, or a frame has no bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// It does not begin as frames do.
    #[error("a frame begins with 7E, not {found:02X}")]
    Delimiter {
        /// Its first byte.
        found: u8,
    },
    /// Its length is not the declared one.
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
        /// Its first byte.
        frame_type: u8,
        /// The length of its data.
        length: usize,
    },
}
