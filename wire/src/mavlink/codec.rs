//! Frames into and out of bytes.

use mavlink::{
    MAV_STX, MAV_STX_V2, MAVLinkV2MessageRaw, MavHeader, MavlinkVersion, Message, calculate_crc,
    consts::MAX_FRAME_SIZE, dialects::ardupilotmega::MavMessage,
};

use super::Signing;

/// More bytes than that are not kept; one reads between one receipt and the next.
const MOST_BYTES: usize = 16 * 1024;

/// More senders than that are not counted for lost messages.
const MOST_SENDERS: usize = 32;

/// Flags of a frame: it is signed; its system number has 32 bits.
const SIGNED: u8 = 1;
const WIDE_SYSTEM: u8 = 2;

/// A telemetry radio's report of itself. It has no key, and nothing is flown by it.
const RADIO_STATUS: u32 = 109;

/// One end of a link: bytes to messages and messages to frames of MAVLink 2, signed where there is
/// a key. Without a key frames of MAVLink 1 are understood, too.
#[derive(Clone, Debug)]
pub struct Codec {
    reader: FrameReader,
    signing: Option<Signing>,
    system_id: u8,
    component_id: u8,
    sequence: u8,
}

impl Codec {
    /// An end that is this system and component.
    #[must_use]
    pub fn new(system_id: u8, component_id: u8) -> Self {
        Self { reader: FrameReader::default(), signing: None, system_id, component_id, sequence: 0 }
    }

    /// Signs all that is sent, and takes nothing that is not signed with the same key, but what a
    /// telemetry radio on the way reports of itself (RADIO_STATUS): radios have no keys.
    #[must_use]
    pub fn with_signing(mut self, signing: Signing) -> Self {
        self.signing = Some(signing);
        self
    }

    /// Takes bytes as they came: cut anywhere, several messages at once. Bytes that
    /// [`next_frame`](Self::next_frame) does not take are dropped beyond 16 KiB, the oldest first.
    pub fn push(&mut self, bytes: &[u8]) {
        self.reader.push(bytes);
    }

    /// The next message of the pushed bytes, at the UNIX time `unix_s`, which signatures need.
    pub fn next_frame(&mut self, unix_s: f64) -> Option<Frame> {
        self.reader.next(self.signing.as_mut(), unix_s)
    }

    /// The bytes of `message`, at the UNIX time `unix_s`.
    #[must_use]
    pub fn encode(&mut self, message: &MavMessage, unix_s: f64) -> Vec<u8> {
        let header = MavHeader {
            system_id: u32::from(self.system_id),
            component_id: self.component_id,
            sequence: self.sequence,
        };
        self.sequence = self.sequence.wrapping_add(1);
        let mut raw = MAVLinkV2MessageRaw::new();
        if let Some(signing) = &mut self.signing {
            raw.serialize_message_for_signing(header, message);
            signing.sign(&mut raw, unix_s);
        } else {
            raw.serialize_message(header, message);
        }
        raw.raw_bytes().to_vec()
    }

    /// Forgets a frame that was begun, because the stream was reopened.
    pub fn restart(&mut self) {
        self.reader.restart();
    }

    /// Counts of the messages and bytes received so far.
    #[must_use]
    pub fn counts(&self) -> FrameCounts {
        self.reader.counts()
    }
}

/// A message and who sent it.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// System, component and sequence number of the sender.
    pub header: MavHeader,
    /// Message of the frame.
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
struct FrameReader {
    buffer: Vec<u8>,
    /// Index at which the search for the next frame begins.
    start: usize,
    counts: FrameCounts,
    /// The last sequence number of each system and component.
    sequences: Vec<((u32, u8), u8)>,
}

/// Kind of frame at the beginning of some bytes.
enum Candidate {
    Unfinished,
    Nothing,
    Whole { version: MavlinkVersion, header_end: usize, payload_end: usize, end: usize },
}

impl FrameReader {
    fn counts(&self) -> FrameCounts {
        self.counts
    }

    /// Forgets a frame that was begun, and all sequence numbers: the stream was reopened.
    fn restart(&mut self) {
        self.buffer.clear();
        self.start = 0;
        self.sequences.clear();
    }

    fn push(&mut self, bytes: &[u8]) {
        self.buffer.drain(..self.start);
        self.start = 0;
        self.buffer.extend_from_slice(bytes);
        let excess = self.buffer.len().saturating_sub(MOST_BYTES);
        self.buffer.drain(..excess);
        self.counts.garbage_bytes += excess as u64;
    }

    fn next(&mut self, mut signing: Option<&mut Signing>, unix_s: f64) -> Option<Frame> {
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

#[cfg(test)]
mod tests {
    use mavlink::dialects::ardupilotmega::{
        ATTITUDE_DATA, HEARTBEAT_DATA, MavAutopilot, MavModeFlag, MavState, MavType,
        RADIO_STATUS_DATA,
    };
    use proptest::prelude::*;

    use super::*;
    use crate::mavlink::SigningKey;

    const NOW: f64 = 1.8e9;

    fn messages(codec: &mut Codec) -> Vec<MavMessage> {
        std::iter::from_fn(|| codec.next_frame(NOW)).map(|frame| frame.message).collect()
    }

    fn attitude(yaw: f32) -> MavMessage {
        MavMessage::ATTITUDE(ATTITUDE_DATA { yaw, ..ATTITUDE_DATA::default() })
    }

    fn signed(byte: u8) -> Codec {
        Codec::new(1, 1).with_signing(Signing::new(SigningKey::new([byte; 32]), 3))
    }

    #[test]
    fn frames_are_those_of_pymavlink() {
        // heartbeat_encode(6, 8, 192, 0, 4, 3) of system 255, component 190; and the same signed
        // with the key 0x42… on link 7 at the timestamp 1 000 001.
        const PLAIN: [u8; 21] = [
            0xfd, 0x09, 0x00, 0x00, 0x00, 0xff, 0xbe, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
            0x06, 0x08, 0xc0, 0x04, 0x03, 0xe4, 0x73,
        ];
        const SIGNED: [u8; 34] = [
            0xfd, 0x09, 0x01, 0x00, 0x00, 0xff, 0xbe, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00,
            0x06, 0x08, 0xc0, 0x04, 0x03, 0x03, 0x8b, 0x07, 0x41, 0x42, 0x0f, 0x00, 0x00, 0x00,
            0x88, 0xee, 0x40, 0x32, 0x8b, 0x19,
        ];
        const UNIX_S: f64 = 1_420_070_410.000_015;
        let message = MavMessage::HEARTBEAT(HEARTBEAT_DATA {
            custom_mode: 0,
            mavtype: MavType::MAV_TYPE_GCS,
            autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
            base_mode: MavModeFlag::from_bits_retain(192),
            system_status: MavState::MAV_STATE_ACTIVE,
            mavlink_version: 3,
        });
        let ours = || Codec::new(255, 190);
        let key = || Signing::new(SigningKey::new([0x42; 32]), 7);
        assert_eq!(ours().encode(&message, UNIX_S), PLAIN);
        assert_eq!(ours().with_signing(key()).encode(&message, UNIX_S), SIGNED);
        let mut reader = Codec::new(1, 1).with_signing(key());
        reader.push(&SIGNED);
        let header = reader.next_frame(UNIX_S).expect("a frame").header;
        assert_eq!((header.system_id, header.component_id, header.sequence), (255, 190, 0));
    }

    #[test]
    fn a_key_refuses_what_is_not_signed_with_it_or_comes_twice() {
        let mut ours = signed(1);
        let mut theirs = signed(2);
        let mut plain = Codec::new(1, 1);
        let good = ours.encode(&attitude(1.0), NOW);
        let mut reader = signed(1);
        reader.push(&theirs.encode(&attitude(2.0), NOW));
        reader.push(&plain.encode(&attitude(3.0), NOW));
        reader.push(&good);
        assert_eq!(messages(&mut reader), [attitude(1.0)]);
        assert_eq!(reader.counts().refused, 2);
        reader.push(&good);
        assert_eq!(messages(&mut reader), [], "a recording is played back");
        let mut late = signed(1);
        late.push(&signed(1).encode(&attitude(4.0), NOW - 100.0));
        assert_eq!(messages(&mut late), [], "an old recording");
        // A receiver without a key decodes signed frames, too.
        plain.push(&good);
        assert_eq!(messages(&mut plain), [attitude(1.0)]);
    }

    #[test]
    fn a_signed_link_receives_its_radio() {
        // SiK radios speak MAVLink 1 as well.
        const OLD: [u8; 17] = [
            0xfe, 0x09, 0x01, 0x33, 0x44, 0x6d, 0x00, 0x00, 0x00, 0x00, 0xc9, 0x00, 0x00, 0x00,
            0x00, 0xfa, 0x85,
        ];
        let report =
            |rssi| MavMessage::RADIO_STATUS(RADIO_STATUS_DATA { rssi, ..Default::default() });
        let mut radio = Codec::new(51, 68);
        let mut reader = signed(1);
        reader.push(&radio.encode(&report(200), NOW));
        reader.push(&OLD);
        reader.push(&signed(2).encode(&report(9), NOW));
        reader.push(&radio.encode(&attitude(1.0), NOW));
        assert_eq!(messages(&mut reader), [report(200), report(201)]);
        assert_eq!(reader.counts().refused, 2, "signed with another key; no radio's");
    }

    #[test]
    fn losses_garbage_and_overflow_are_counted() {
        let mut sender = Codec::new(9, 1);
        let mut reader = Codec::new(255, 190);
        let frames: Vec<_> = (0..6).map(|_| sender.encode(&attitude(0.5), NOW)).collect();
        for frame in [&frames[0], &frames[1], &frames[4]] {
            reader.push(frame);
        }
        reader.push(&[0xfd; 5]);
        reader.push(&frames[5]);
        assert_eq!(messages(&mut reader).len(), 4);
        let counts = reader.counts();
        assert_eq!((counts.messages, counts.lost, counts.garbage_bytes), (4, 2, 5));
        for _ in 0..100 {
            reader.push(&[0x55; 1000]);
        }
        assert!(reader.counts().garbage_bytes >= 100_000 - 16 * 1024);
        assert_eq!(messages(&mut reader), []);
    }

    proptest! {
        #[test]
        fn messages_come_through_garbage_and_cuts(
            yaws in prop::collection::vec(-10.0f32..10.0, 1..8),
            noise in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..40), 8),
            cut in 1usize..60,
            key in any::<bool>(),
        ) {
            let (mut sender, mut reader) =
                if key { (signed(7), signed(7)) } else { (Codec::new(1, 1), Codec::new(1, 1)) };
            let mut bytes = Vec::new();
            for (yaw, noise) in yaws.iter().zip(&noise) {
                // No frame may begin in the noise: it would take the true one for its payload
                // until that has come whole.
                bytes.extend(noise.iter().map(|byte| if *byte >= 0xfd { 0 } else { *byte }));
                bytes.extend(sender.encode(&attitude(*yaw), NOW));
            }
            let mut received = Vec::new();
            for piece in bytes.chunks(cut) {
                reader.push(piece);
                received.extend(messages(&mut reader));
            }
            let sent: Vec<_> = yaws.iter().map(|yaw| attitude(*yaw)).collect();
            prop_assert_eq!(received, sent);
        }

        #[test]
        fn nothing_that_comes_is_too_much(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
            let mut reader = Codec::new(1, 1);
            reader.push(&bytes);
            // Frames of any message with a right checksum are found after it.
            reader.push(&[0; 600]);
            reader.push(&Codec::new(2, 1).encode(&attitude(1.5), NOW));
            prop_assert_eq!(messages(&mut reader).pop(), Some(attitude(1.5)));
        }
    }
}
