//! MAVLink messages as ground stations log them: each behind the time of its arrival, in
//! microseconds since 1970 (QGroundControl, Mission Planner, MAVProxy).

use std::collections::BTreeSet;

use foxhunt_wire::geodesy::Geodetic;

use super::log::{Fix, Levels, Log, binary_array, binary_number};

/// Times of the years 2001 to 2100 in microseconds.
const TIMES_US: std::ops::Range<u64> = 978_307_200_000_000..4_102_444_800_000_000;

/// `GLOBAL_POSITION_INT`, its length and the seed of its checksum (MAVLink's common.xml).
const POSITION: u32 = 33;
const POSITION_LENGTH: usize = 28;
const POSITION_SEED: u8 = 104;

/// `RC_CHANNELS`, `RADIO_STATUS` and `NAMED_VALUE_FLOAT`, each with the seed of its checksum.
const CHANNELS: (u32, u8) = (65, 118);
const RADIO: (u32, u8) = (109, 185);
const NAMED: (u32, u8) = (251, 170);

/// The longest payload of these.
const LONGEST: usize = 42;

/// First bytes of messages of MAVLink 1 and 2.
const MAVLINK_1: u8 = 0xfe;
const MAVLINK_2: u8 = 0xfd;

/// A message in a log.
struct Message<'b> {
    time_us: u64,
    id: u32,
    system: u8,
    payload: &'b [u8],
    /// Bytes from the time to the end.
    length: usize,
    /// Bytes that the checksum is of, and the checksum.
    checked: &'b [u8],
    checksum: u16,
}

/// Returns true for a file that begins with a time and a message.
pub(super) fn is_tlog(bytes: &[u8]) -> bool {
    message(bytes).is_some()
}

/// Reads the places of the only vehicle, and the levels. Damaged bytes are skipped up to the next
/// message.
pub(super) fn read(bytes: &[u8]) -> Result<Log, String> {
    let mut fixes = Vec::new();
    let mut levels = Levels::default();
    let mut systems = BTreeSet::new();
    let mut at = 0;
    while let Some(rest) = bytes.get(at..).filter(|rest| !rest.is_empty()) {
        let Some(message) = message(rest) else {
            at += 1;
            continue;
        };
        at += message.length;
        if message.id == POSITION && checksum(message.checked, POSITION_SEED) == message.checksum {
            systems.insert(message.system);
            fixes.extend(fix(&message));
        }
        take_levels(&message, &mut levels);
    }
    if systems.len() > 1 {
        let systems: Vec<String> = systems.iter().map(u8::to_string).collect();
        return Err(format!(
            "it holds the places of several vehicles (systems {}), and nothing tells whose levels \
             they are",
            systems.join(", ")
        ));
    }
    Ok(Log { fixes, levels })
}

/// Takes the levels of a message.
fn take_levels(message: &Message<'_>, levels: &mut Levels) {
    let known = [CHANNELS, RADIO, NAMED].into_iter().find(|(id, _)| *id == message.id);
    let Some((_, seed)) = known else { return };
    if checksum(message.checked, seed) != message.checksum {
        return;
    }
    // MAVLink 2 cuts off zeros at the end.
    let mut payload = [0; LONGEST];
    for (to, from) in payload.iter_mut().zip(message.payload) {
        *to = *from;
    }
    let time = seconds(message);
    let mut take = |name: &str, at: usize, kind: &str| {
        if let Some(number) = binary_number(&payload, at, kind) {
            levels.take(name, time, number);
        }
    };
    if message.id == CHANNELS.0 {
        take("RC_CHANNELS.rssi", 41, "uint8_t");
    } else if message.id == RADIO.0 {
        take("RADIO_STATUS.rssi", 4, "uint8_t");
        take("RADIO_STATUS.remrssi", 5, "uint8_t");
    } else {
        let name = payload.get(8..18).unwrap_or_default().split(|byte| *byte == 0).next();
        let name = String::from_utf8_lossy(name.unwrap_or_default());
        take(&format!("NAMED_VALUE_FLOAT.{name}"), 4, "float");
    }
}

/// The time of a message's arrival in seconds since 1970.
fn seconds(message: &Message<'_>) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "below 2^53")]
    let micros = message.time_us as f64;
    micros * 1e-6
}

fn fix(message: &Message<'_>) -> Option<Fix> {
    // MAVLink 2 cuts off zeros at the end.
    let mut payload = [0; POSITION_LENGTH];
    for (to, from) in payload.iter_mut().zip(message.payload) {
        *to = *from;
    }
    let number = |at: usize| binary_number(&payload, at, "int32_t");
    let place = Geodetic {
        lat_deg: number(4)? * 1e-7,
        lon_deg: number(8)? * 1e-7,
        alt_m: number(12)? * 1e-3,
    };
    Some(Fix { time: seconds(message), place })
}

/// The message with which bytes begin, behind its time.
fn message(bytes: &[u8]) -> Option<Message<'_>> {
    let time_us = u64::from_be_bytes(binary_array(bytes, 0)?);
    let frame = bytes.get(8..).filter(|_| TIMES_US.contains(&time_us))?;
    let length = usize::from(*frame.get(1)?);
    let (head, system, id, signature) = match *frame.first()? {
        MAVLINK_1 => (6, *frame.get(3)?, u32::from(*frame.get(5)?), 0),
        MAVLINK_2 => {
            let [low, middle, high] = binary_array(frame, 7)?;
            let is_signed = *frame.get(2)? & 1 == 1;
            let id = u32::from_le_bytes([low, middle, high, 0]);
            (10, *frame.get(5)?, id, if is_signed { 13 } else { 0 })
        }
        _ => return None,
    };
    let end = head + length;
    Some(Message {
        time_us,
        id,
        system,
        payload: frame.get(head..end)?,
        length: 8 + end + 2 + signature,
        checked: frame.get(1..end)?,
        checksum: u16::from_le_bytes(binary_array(frame, end)?),
    })
}

/// The checksum of a message (ITU X.25), its seed behind the bytes.
fn checksum(bytes: &[u8], seed: u8) -> u16 {
    let add = |sum: u16, byte: &u8| {
        let mut low = byte ^ sum.to_le_bytes()[0];
        low ^= low << 4;
        let low = u16::from(low);
        (sum >> 8) ^ (low << 8) ^ (low << 3) ^ (low >> 4)
    };
    bytes.iter().chain([&seed]).fold(0xffff, add)
}
