use ::mavlink::{
    MAV_STX, MAV_STX_V2, MAVLinkV2MessageRaw, MavHeader, MavlinkVersion, Message, calculate_crc,
    consts::MAX_FRAME_SIZE, dialects::ardupilotmega::MavMessage,
};

use super::Signing;

/// A message and who sent it.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// System, component and sequence number of the sender.
    pub header: MavHeader,
    /// Its message.
    pub message: MavMessage,
}

/// Counts of the messages and bytes that came over a link.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct FrameCounts {
    /// Messages understood.
    pub messages: u64,
    /// Messages that the sequence numbers miss.
    pub lost: u64,
    /// Bytes that were part of no frame, or of one with a wrong checksum.
    pub garbage_bytes: u64,
    /// Frames with a right checksum whose content this dialect does not know.
    pub unreadable: u64,
    /// Frames refused because they were not signed, not with our key, or a second time.
    pub refused: u64,
}

/// Frames out of bytes that may be cut anywhere, with garbage in between.
#[derive(Clone, Debug, Default)]
pub(super) struct FrameReader {
    buffer: Vec<u8>,
    /// Index at which the search for the next frame begins.
    start: usize,
    counts: FrameCounts,
    /// The last sequence number of each system and component.
    sequences: Vec<((u32, u8), u8)>,
}

/// More bytes than that are not kept; one reads between one receipt and the next.
const MOST_BYTES: usize = 16 * 1024;

/// More senders than that are not counted for lost messages.
const MOST_SENDERS: usize = 32;

/// Flags of a frame: it is signed; its system number has 32 bits.
const SIGNED: u8 = 1;
const WIDE_SYSTEM: u8 = 2;

/// A telemetry radio's report of itself. It has no key, and nothing is flown by it.
const RADIO_STATUS: u32 = 109;

/// Kind of frame at the beginning of some bytes.
enum Candidate {
    Unfinished,
    Nothing,
    Whole { version: MavlinkVersion, header_end: usize, payload_end: usize, end: usize },
}

impl FrameReader {
    pub(super) fn counts(&self) -> FrameCounts {
        self.counts
    }

    /// Forgets a frame that was begun, and all sequence numbers: the stream was reopened.
    pub(super) fn restart(&mut self) {
        self.buffer.clear();
        self.start = 0;
        self.sequences.clear();
    }

    pub(super) fn push(&mut self, bytes: &[u8]) {
        self.buffer.drain(..self.start);
        self.start = 0;
        self.buffer.extend_from_slice(bytes);
        let excess = self.buffer.len().saturating_sub(MOST_BYTES);
        self.buffer.drain(..excess);
        self.counts.garbage_bytes += excess as u64;
    }

    pub(super) fn next(&mut self, mut signing: Option<&mut Signing>, unix_s: f64) -> Option<Frame> {
        loop {
            let bytes = self.buffer.get(self.start..)?;
            let (version, header_end, payload_end, end) = match candidate(bytes) {
                Candidate::Unfinished => return None,
                Candidate::Nothing => {
                    self.start += 1;
                    self.counts.garbage_bytes += 1;
                    continue;
                }
                Candidate::Whole { version, header_end, payload_end, end } => {
                    (version, header_end, payload_end, end)
                }
            };
            let (Some(frame), Some(payload)) =
                (bytes.get(..end), bytes.get(header_end..payload_end))
            else {
                return None;
            };
            self.start += end;
            let mut raw = [0; MAX_FRAME_SIZE];
            raw.iter_mut().zip(frame).for_each(|(to, from)| *to = *from);
            let (header, id) = match version {
                MavlinkVersion::V2 => {
                    let raw = MAVLinkV2MessageRaw::from_bytes_unparsed(raw);
                    let radio = raw.message_id() == RADIO_STATUS && !is_signed(&raw);
                    let refuses = |signing: &mut &mut Signing| !signing.accepts(&raw, unix_s);
                    if !radio && signing.as_mut().is_some_and(refuses) {
                        self.counts.refused += 1;
                        continue;
                    }
                    (
                        header_of(raw.system_id(), raw.component_id(), raw.sequence()),
                        raw.message_id(),
                    )
                }
                MavlinkVersion::V1 => {
                    let [_, _, sequence, system, component, id, ..] = raw;
                    if signing.is_some() && u32::from(id) != RADIO_STATUS {
                        self.counts.refused += 1;
                        continue;
                    }
                    (header_of(u32::from(system), component, sequence), u32::from(id))
                }
            };
            let parsed = MavMessage::parse(version, id, payload);
            self.count_lost(&header);
            if let Ok(message) = parsed {
                self.counts.messages += 1;
                return Some(Frame { header, message });
            }
            self.counts.unreadable += 1;
        }
    }

    fn count_lost(&mut self, header: &MavHeader) {
        let sender = (header.system_id, header.component_id);
        let room = self.sequences.len() < MOST_SENDERS;
        match self.sequences.iter_mut().find(|(known, _)| *known == sender) {
            Some((_, last)) => {
                let missing = header.sequence.wrapping_sub(*last).wrapping_sub(1);
                // One that comes late or twice is not 255 lost ones.
                if missing < 128 {
                    self.counts.lost += u64::from(missing);
                }
                *last = header.sequence;
            }
            None if room => {
                self.sequences.push((sender, header.sequence));
            }
            None => {}
        }
    }
}

fn is_signed(frame: &MAVLinkV2MessageRaw) -> bool {
    frame.incompatibility_flags() & SIGNED != 0
}

fn header_of(system_id: u32, component_id: u8, sequence: u8) -> MavHeader {
    MavHeader { system_id, component_id, sequence }
}

/// Looks for a frame at the beginning of `bytes`
/// (<https://mavlink.io/en/guide/serialization.html>).
fn candidate(bytes: &[u8]) -> Candidate {
    let (version, flags) = match *bytes {
        [] => return Candidate::Unfinished,
        [MAV_STX, ..] => (MavlinkVersion::V1, 0),
        [MAV_STX_V2, _, flags, ..] if flags & !(SIGNED | WIDE_SYSTEM) == 0 => {
            (MavlinkVersion::V2, flags)
        }
        [MAV_STX_V2] | [MAV_STX_V2, _] => return Candidate::Unfinished,
        _ => return Candidate::Nothing,
    };
    let header_end = match version {
        MavlinkVersion::V1 => 6,
        MavlinkVersion::V2 if flags & WIDE_SYSTEM != 0 => 13,
        MavlinkVersion::V2 => 10,
    };
    let (Some(header), Some(length)) = (bytes.get(1..header_end), bytes.get(1)) else {
        return Candidate::Unfinished;
    };
    let payload_end = header_end + usize::from(*length);
    let signature = if flags & SIGNED == 0 { 0 } else { 13 };
    let end = payload_end + 2 + signature;
    let (Some(covered), Some([low, high]), Some(_)) =
        (bytes.get(1..payload_end), bytes.get(payload_end..payload_end + 2), bytes.get(..end))
    else {
        return Candidate::Unfinished;
    };
    let id = match (version, header) {
        (MavlinkVersion::V1, [.., id]) => u32::from(*id),
        (MavlinkVersion::V2, [.., low, middle, high]) => {
            u32::from_le_bytes([*low, *middle, *high, 0])
        }
        _ => return Candidate::Nothing,
    };
    if calculate_crc(covered, MavMessage::extra_crc(id)) != u16::from_le_bytes([*low, *high]) {
        return Candidate::Nothing;
    }
    Candidate::Whole { version, header_end, payload_end, end }
}
