use chrono::{Datelike, NaiveDateTime, Timelike};
use foxhunt_wire::FixQuality;

use super::epoch::{Epoch, whole};

/// The beginning of GPS time in milliseconds of UNIX time, less its lead over UTC since 2017.
const GPS_EPOCH_MS: i64 = 315_964_800_000 - 18_000;

/// The longest request that is read, in bytes of payload.
const LONGEST: usize = 1024;

/// The requests to a receiver by u-blox, and its settings (u-blox F9 HPG 1.32 interface
/// description, UBX-22008968).
#[derive(Clone, Debug, Default)]
pub(super) struct Host {
    bytes: Vec<u8>,
    /// True if NAV-PVT is on. It is off as it comes from the factory.
    pub(super) sends_pvt: bool,
}

impl Host {
    /// Takes bytes of the host; what is answered to them.
    pub(super) fn take(&mut self, bytes: &[u8]) -> Vec<u8> {
        self.bytes.extend(bytes);
        let mut answer = Vec::new();
        loop {
            let sync = self.bytes.windows(2).position(|pair| pair == [0xb5, 0x62]);
            // The last byte may be the first of the next message.
            let before = sync.unwrap_or(self.bytes.len().saturating_sub(1));
            self.bytes.drain(..before);
            let [_, _, class, id, low, high, rest @ ..] = self.bytes.as_slice() else { break };
            let length = usize::from(u16::from_le_bytes([*low, *high]));
            if length > LONGEST {
                self.bytes.drain(..2);
                continue;
            }
            let Some((payload, [a, b, ..])) = rest.split_at_checked(length) else { break };
            if checksum(&self.bytes[2..6 + length]) != [*a, *b] {
                self.bytes.drain(..2);
                continue;
            }
            let class = *class;
            let id = *id;
            let payload = payload.to_vec();
            self.bytes.drain(..8 + length);
            answer.extend(self.obey(class, id, &payload));
        }
        answer
    }

    fn obey(&mut self, class: u8, id: u8, payload: &[u8]) -> Vec<u8> {
        let obeyed = match (class, id, payload) {
            // CFG-MSG: on this port, or on all six.
            (0x06, 0x01, [0x01, 0x07, rates @ ..]) if matches!(rates.len(), 1 | 6) => {
                self.sends_pvt = rates.iter().any(|rate| *rate > 0);
                true
            }
            // CFG-VALSET, after version, layers and two reserved bytes.
            (0x06, 0x8a, [_, _, _, _, items @ ..]) => self.set(items).is_some(),
            (0x06, ..) => false,
            (0x0a, 0x04, []) => return version(),
            _ => return Vec::new(),
        };
        frame(0x05, u8::from(obeyed), &[class, id])
    }

    /// Sets what is known of a list of keys and values; `None` where it is no such list.
    fn set(&mut self, mut items: &[u8]) -> Option<()> {
        while !items.is_empty() {
            let (key, rest) = items.split_first_chunk::<4>()?;
            let key = u32::from_le_bytes(*key);
            // Bits 28 to 30 are the size of the value.
            let size = match key >> 28 & 7 {
                1 | 2 => 1,
                3 => 2,
                4 => 4,
                5 => 8,
                _ => return None,
            };
            let (value, rest) = rest.split_at_checked(size)?;
            // CFG-MSGOUT-UBX_NAV_PVT on I2C, UART1, UART2, USB and SPI.
            if (0x2091_0006..=0x2091_000a).contains(&key) {
                self.sends_pvt = value.iter().any(|rate| *rate > 0);
            }
            items = rest;
        }
        Some(())
    }
}

/// MON-VER.
fn version() -> Vec<u8> {
    let mut payload = Vec::new();
    let texts = [("EXT CORE 1.00 (emulated)", 30), ("00190000", 10), ("PROTVER=27.31", 30)];
    for (text, length) in texts {
        payload.extend(text.bytes().chain(std::iter::repeat(0)).take(length));
    }
    frame(0x0a, 0x04, &payload)
}

/// NAV-PVT.
pub(super) fn nav_pvt(epoch: &Epoch) -> Vec<u8> {
    let time: NaiveDateTime = epoch.date_time();
    let week_ms = (epoch.utc_ms - GPS_EPOCH_MS).rem_euclid(604_800_000);
    let [month, day, hour, min, sec] =
        [time.month(), time.day(), time.hour(), time.minute(), time.second()]
            .map(|part| u8::try_from(part).unwrap_or(u8::MAX));
    let (fix_type, flags) = match epoch.quality {
        FixQuality::None => (0, 0x00),
        FixQuality::Estimated => (1, 0x01),
        FixQuality::Autonomous => (3, 0x01),
        FixQuality::Differential => (3, 0x03),
        FixQuality::RtkFloat => (3, 0x43),
        FixQuality::RtkFixed => (3, 0x83),
    };
    let place = epoch.place;
    let lon_deg = if place.lon_deg > 180.0 { place.lon_deg - 360.0 } else { place.lon_deg };
    let horizontal = epoch.sigma_m.x.hypot(epoch.sigma_m.y);
    let (speed, course) = epoch.speed_course();
    let east = epoch.velocity.x;
    let north = epoch.velocity.y;
    let up = epoch.velocity.z;
    let (_, pdop) = epoch.vdop_pdop();
    let mut p = Vec::with_capacity(92);
    p.extend(unsigned(week_ms));
    p.extend(u16::try_from(time.year()).unwrap_or(0).to_le_bytes());
    // Date and time valid and fully resolved; 20 ns.
    p.extend([month, day, hour, min, sec, 0x07]);
    p.extend(unsigned(20));
    p.extend(signed(i64::from(time.nanosecond())));
    p.extend([fix_type, flags, 0xe0, epoch.satellites]);
    for value in [lon_deg * 1e7, place.lat_deg * 1e7, place.alt_m * 1e3] {
        p.extend(signed(whole(value)));
    }
    p.extend(signed(whole((place.alt_m - epoch.geoid_m) * 1e3)));
    p.extend(unsigned(whole(horizontal * 1e3)));
    p.extend(unsigned(whole(epoch.sigma_m.z * 1e3)));
    for value in [north * 1e3, east * 1e3, -up * 1e3, speed * 1e3, course * 1e5] {
        p.extend(signed(whole(value)));
    }
    // 0.1 m/s and 180°: what its velocity rests on is not modelled.
    p.extend(unsigned(100));
    p.extend(unsigned(18_000_000));
    p.extend(u16::try_from(whole(pdop * 100.0)).unwrap_or(9999).to_le_bytes());
    p.push(u8::from(!epoch.has_fix()));
    p.resize(92, 0);
    frame(0x01, 0x07, &p)
}

fn unsigned(value: i64) -> [u8; 4] {
    u32::try_from(value).unwrap_or(u32::MAX).to_le_bytes()
}

fn signed(value: i64) -> [u8; 4] {
    i32::try_from(value).unwrap_or(i32::MAX).to_le_bytes()
}

/// A UBX message.
fn frame(class: u8, id: u8, payload: &[u8]) -> Vec<u8> {
    let length = u16::try_from(payload.len()).unwrap_or(0).to_le_bytes();
    let mut bytes = vec![0xb5, 0x62, class, id];
    bytes.extend(length);
    bytes.extend(payload);
    let sum = checksum(&bytes[2..]);
    bytes.extend(sum);
    bytes
}

/// The eight-bit Fletcher sum of everything after the two that begin a message.
fn checksum(bytes: &[u8]) -> [u8; 2] {
    bytes.iter().fold([0, 0], |[a, b]: [u8; 2], byte| {
        let a = a.wrapping_add(*byte);
        [a, b.wrapping_add(a)]
    })
}
