use super::{
    Frame, FrameError,
    layout::{DELIMITER, ESCAPE, FLIP, HEAD, LONGEST_DATA},
};

/// Encoding of frames on the serial line: the radio's parameter `AP`.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum ApiMode {
    /// `AP` 1: as they are.
    #[default]
    Plain,
    /// `AP` 2: bytes that begin a frame, and bytes that serial lines take for commands, are
    /// escaped.
    Escaped,
}

impl Frame {
    /// Its bytes on the line.
    ///
    /// # Errors
    ///
    /// [`FrameError::NoSuchLength`] if it is longer than [`LONGEST_DATA`].
    pub fn encode(&self, mode: ApiMode) -> Result<Vec<u8>, FrameError> {
        let data = self.data();
        let length = data.len();
        let short = u16::try_from(length).ok().filter(|_| length <= LONGEST_DATA);
        let declared = short.ok_or(FrameError::NoSuchLength { length })?;
        let mut out = Vec::with_capacity(length + HEAD + 1);
        out.push(DELIMITER);
        let checksum = checksum(&data);
        for byte in declared.to_be_bytes().into_iter().chain(data).chain([checksum]) {
            if mode == ApiMode::Escaped && matches!(byte, DELIMITER | ESCAPE | 0x11 | 0x13) {
                out.extend([ESCAPE, byte ^ FLIP]);
            } else {
                out.push(byte);
            }
        }
        Ok(out)
    }

    /// The frame that these bytes are, no more and no less.
    ///
    /// # Errors
    ///
    /// [`FrameError`] names what is wrong with them.
    pub fn decode(bytes: &[u8], mode: ApiMode) -> Result<Self, FrameError> {
        let found = *bytes.first().ok_or(FrameError::Cut { bytes: 0 })?;
        if found != DELIMITER {
            return Err(FrameError::Delimiter { found });
        }
        let bytes = match mode {
            ApiMode::Plain => bytes.to_vec(),
            ApiMode::Escaped => unescaped(bytes),
        };
        let [_, high, low, rest @ ..] = bytes.as_slice() else {
            return Err(FrameError::Cut { bytes: bytes.len() });
        };
        let declared = usize::from(u16::from_be_bytes([*high, *low]));
        let (last, data) = rest.split_last().ok_or(FrameError::Cut { bytes: bytes.len() })?;
        if declared != data.len() {
            return Err(FrameError::Length { declared, actual: data.len() });
        }
        checked(data, *last)
    }
}

/// 0xFF less the sum of the data.
fn checksum(data: &[u8]) -> u8 {
    !data.iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte))
}

/// The frame with these data, if they match the checksum.
pub(super) fn checked(data: &[u8], declared: u8) -> Result<Frame, FrameError> {
    let computed = checksum(data);
    if declared != computed {
        return Err(FrameError::Checksum { declared, computed });
    }
    Frame::from_data(data)
}

fn unescaped(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(bytes.len());
    let mut escaped = false;
    for byte in bytes {
        if *byte == ESCAPE && !escaped {
            escaped = true;
            continue;
        }
        out.push(if escaped { *byte ^ FLIP } else { *byte });
        escaped = false;
    }
    out
}
