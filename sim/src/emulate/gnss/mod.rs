//! A drone's GNSS receiver: its state at one moment, in the formats that receivers speak, NMEA, UBX
//! and gpsd's.

mod caster;
mod receiver;

pub use caster::{EmulatedCaster, EmulatedCasterConfig};
pub use receiver::{EmulatedGnss, EmulatedGnssConfig, EmulatedGnssKind};

use chrono::{DateTime, Datelike, NaiveDateTime, Timelike};
use foxhunt_wire::{
    FixQuality,
    geodesy::{Geodetic, radians_to_compass_deg},
};
use nalgebra::Vector3;

/// Knots in a metre per second.
const KNOTS: f64 = 3600.0 / 1852.0;

/// The beginning of GPS time in milliseconds of UNIX time, less its lead over UTC since 2017.
const GPS_EPOCH_MS: i64 = 315_964_800_000 - 18_000;

/// The longest request that is read, in bytes of payload.
const LONGEST_UBX: usize = 1024;

/// The greeting of gpsd.
const GPSD_VERSION: &str = "{\"class\":\"VERSION\",\"release\":\"3.25\",\"rev\":\"3.25\",\
                                  \"proto_major\":3,\"proto_minor\":15}\r\n";
const GPSD_DEVICE: &str = "{\"class\":\"DEVICE\",\"path\":\"emulated\",\"driver\":\"emulated\",\
                      \"activated\":\"2026-01-01T00:00:00.000Z\"}";

/// The longest request that is read, in bytes: gpsd allows 80.
const LONGEST_QUERY: usize = 256;

/// The state of a receiver at one moment, before it is put into bytes.
#[derive(Clone, Copy, Debug)]
struct Epoch {
    /// UNIX time in milliseconds.
    utc_ms: i64,
    /// Place of the receiver by its own measurement.
    place: Geodetic,
    quality: FixQuality,
    sigma_m: Vector3<f64>,
    /// East, North and Up in metres per second.
    velocity: Vector3<f64>,
    satellites: u8,
    hdop: f64,
    geoid_m: f64,
    /// Direction of the nose in degrees clockwise from North, if there is a compass.
    heading_deg: Option<f64>,
}

impl Epoch {
    fn has_fix(&self) -> bool {
        self.quality > FixQuality::None
    }

    fn date_time(&self) -> NaiveDateTime {
        DateTime::from_timestamp_millis(self.utc_ms).unwrap_or_default().naive_utc()
    }

    /// The time as NMEA has it: hhmmss.ss.
    fn hms(&self) -> String {
        let time = self.date_time();
        let hundredths = time.nanosecond() / 10_000_000;
        format!("{:02}{:02}{:02}.{hundredths:02}", time.hour(), time.minute(), time.second())
    }

    /// The date as NMEA has it: ddmmyy.
    fn dmy(&self) -> String {
        let date = self.date_time();
        format!("{:02}{:02}{:02}", date.day(), date.month(), date.year().rem_euclid(100))
    }

    /// The vertical and the position's dilution, in the usual proportion to the horizontal one.
    fn vdop_pdop(&self) -> (f64, f64) {
        let vdop = self.hdop * 1.6;
        (vdop, self.hdop.hypot(vdop))
    }

    /// Metres per second over ground, and the course in degrees clockwise from North.
    fn speed_course(&self) -> (f64, f64) {
        let east = self.velocity.x;
        let north = self.velocity.y;
        (east.hypot(north), radians_to_compass_deg(libm::atan2(north, east)))
    }
}

/// The requests to a receiver by u-blox, and its settings (u-blox F9 HPG 1.32 interface
/// description, UBX-22008968).
#[derive(Clone, Debug, Default)]
struct UbloxHost {
    bytes: Vec<u8>,
    /// True if NAV-PVT is on. It is off as it comes from the factory.
    sends_pvt: bool,
}

impl UbloxHost {
    /// Takes bytes of the host; what is answered to them.
    fn take(&mut self, bytes: &[u8]) -> Vec<u8> {
        self.bytes.extend(bytes);
        let mut answer = Vec::new();
        loop {
            let sync = self.bytes.windows(2).position(|pair| pair == [0xb5, 0x62]);
            // The last byte may be the first of the next message.
            let before = sync.unwrap_or(self.bytes.len().saturating_sub(1));
            self.bytes.drain(..before);
            let [_, _, class, id, low, high, rest @ ..] = self.bytes.as_slice() else { break };
            let length = usize::from(u16::from_le_bytes([*low, *high]));
            if length > LONGEST_UBX {
                self.bytes.drain(..2);
                continue;
            }
            let Some((payload, [a, b, ..])) = rest.split_at_checked(length) else { break };
            if ubx_checksum(&self.bytes[2..6 + length]) != [*a, *b] {
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
            (0x0a, 0x04, []) => return ubx_version(),
            _ => return Vec::new(),
        };
        ubx_frame(0x05, u8::from(obeyed), &[class, id])
    }

    /// Sets the known keys of a list of keys and values; `None` if the bytes are no such list.
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

/// A client of gpsd.
#[derive(Clone, Debug, Default)]
struct GpsdClient {
    request: Vec<u8>,
    /// True if it has requested reports.
    watches: bool,
}

impl GpsdClient {
    /// Takes bytes of the client; what is answered to them.
    fn take(&mut self, bytes: &[u8]) -> String {
        let mut answer = String::new();
        for &byte in bytes {
            match byte {
                b'?' => self.request = vec![byte],
                b';' | b'\n' if !self.request.is_empty() => {
                    let request = std::mem::take(&mut self.request);
                    answer += &self.answer(&String::from_utf8_lossy(&request));
                }
                _ if self.request.is_empty() || self.request.len() >= LONGEST_QUERY => {}
                _ if byte.is_ascii_whitespace() => {}
                _ => self.request.push(byte),
            }
        }
        answer
    }

    fn answer(&mut self, request: &str) -> String {
        let devices = || format!("{{\"class\":\"DEVICES\",\"devices\":[{GPSD_DEVICE}]}}\r\n");
        if request == "?VERSION" {
            return GPSD_VERSION.into();
        }
        if request == "?DEVICES" {
            return devices();
        }
        if let Some(wanted) = request.strip_prefix("?WATCH") {
            if wanted.starts_with('=') {
                self.watches = !wanted.contains("\"enable\":false");
            }
            let watches = self.watches;
            let watch =
                format!("{{\"class\":\"WATCH\",\"enable\":{watches},\"json\":{watches}}}\r\n");
            return devices() + &watch;
        }
        "{\"class\":\"ERROR\",\"message\":\"Unrecognized request\"}\r\n".into()
    }
}

/// The nearest whole number, within what fits.
#[expect(clippy::cast_possible_truncation, reason = "a float that is out of range saturates")]
fn whole(value: f64) -> i64 {
    value.round() as i64
}

/// The sentences of an epoch in the order in which receivers by u-blox send them: RMC, GGA, GSA,
/// GST (NMEA 0183 4.10; minutes with seven decimals, as RTK receivers do).
fn nmea_sentences(epoch: &Epoch) -> String {
    let all = [rmc(epoch), gga(epoch), gsa(epoch), gst(epoch)].map(|text| framed(&text)).concat();
    match epoch.heading_deg {
        Some(deg) => all + &framed(&format!("HEHDT,{deg:.2},T")),
        None => all,
    }
}

fn framed(text: &str) -> String {
    let sum = text.bytes().fold(0, |sum, byte| sum ^ byte);
    format!("${text}*{sum:02X}\r\n")
}

/// Latitude and longitude with their directions.
fn lat_lon(epoch: &Epoch) -> String {
    if !epoch.has_fix() {
        return ",,,".into();
    }
    let lat = epoch.place.lat_deg;
    let lon = epoch.place.lon_deg;
    let lon = if lon > 180.0 { lon - 360.0 } else { lon };
    let (lat_degrees, lat_minutes) = degrees_minutes(lat);
    let (lon_degrees, lon_minutes) = degrees_minutes(lon);
    let north = if lat < 0.0 { 'S' } else { 'N' };
    let east = if lon < 0.0 { 'W' } else { 'E' };
    format!("{lat_degrees:02}{lat_minutes},{north},{lon_degrees:03}{lon_minutes},{east}")
}

/// Whole degrees, and minutes with seven decimals; they are rounded together, so that there are no
/// 60 minutes.
fn degrees_minutes(deg: f64) -> (i64, String) {
    const MINUTE: i64 = 10_000_000;
    let all = whole(deg.abs() * 6e8);
    let rest = all % (60 * MINUTE);
    (all / (60 * MINUTE), format!("{:02}.{:07}", rest / MINUTE, rest % MINUTE))
}

fn rmc(epoch: &Epoch) -> String {
    let status = if epoch.has_fix() { 'A' } else { 'V' };
    let mode = match epoch.quality {
        FixQuality::None => 'N',
        FixQuality::Estimated => 'E',
        FixQuality::Autonomous => 'A',
        FixQuality::Differential => 'D',
        FixQuality::RtkFloat => 'F',
        FixQuality::RtkFixed => 'R',
    };
    let (speed, course) = epoch.speed_course();
    let moving =
        if epoch.has_fix() { format!("{:.3},{course:.2}", speed * KNOTS) } else { ",".into() };
    let hms = epoch.hms();
    let dmy = epoch.dmy();
    format!("GNRMC,{hms},{status},{},{moving},{dmy},,,{mode}", lat_lon(epoch))
}

fn gga(epoch: &Epoch) -> String {
    let quality = match epoch.quality {
        FixQuality::None => 0,
        FixQuality::Autonomous => 1,
        FixQuality::Differential => 2,
        FixQuality::RtkFixed => 4,
        FixQuality::RtkFloat => 5,
        FixQuality::Estimated => 6,
    };
    let heights = if epoch.has_fix() {
        format!("{:.4},M,{:.3},M", epoch.place.alt_m - epoch.geoid_m, epoch.geoid_m)
    } else {
        ",M,,M".into()
    };
    let hms = epoch.hms();
    let satellites = epoch.satellites;
    let hdop = epoch.hdop;
    format!("GNGGA,{hms},{},{quality},{satellites:02},{hdop:.2},{heights},,", lat_lon(epoch))
}

fn gsa(epoch: &Epoch) -> String {
    let dimensions = if epoch.has_fix() { 3 } else { 1 };
    let used = (1..=12).map(|satellite| {
        if satellite <= epoch.satellites { format!("{satellite:02}") } else { String::new() }
    });
    let used: Vec<String> = used.collect();
    let (vdop, pdop) = epoch.vdop_pdop();
    format!("GNGSA,A,{dimensions},{},{pdop:.2},{:.2},{vdop:.2},1", used.join(","), epoch.hdop)
}

fn gst(epoch: &Epoch) -> String {
    let hms = epoch.hms();
    if !epoch.has_fix() {
        return format!("GNGST,{hms},,,,,,,");
    }
    let sigma = epoch.sigma_m;
    let east = sigma.x;
    let north = sigma.y;
    let up = sigma.z;
    let major = east.max(north);
    let minor = east.min(north);
    // From North; the axes of the ellipse are those of the frame.
    let orientation = if east > north { 90 } else { 0 };
    let rms = sigma.norm();
    format!("GNGST,{hms},{rms:.3},{major:.4},{minor:.4},{orientation},{north:.4},{east:.4},{up:.4}")
}

/// MON-VER.
fn ubx_version() -> Vec<u8> {
    let mut payload = Vec::new();
    let texts = [("EXT CORE 1.00 (emulated)", 30), ("00190000", 10), ("PROTVER=27.31", 30)];
    for (text, length) in texts {
        payload.extend(text.bytes().chain(std::iter::repeat(0)).take(length));
    }
    ubx_frame(0x0a, 0x04, &payload)
}

/// NAV-PVT.
fn nav_pvt(epoch: &Epoch) -> Vec<u8> {
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
    ubx_frame(0x01, 0x07, &p)
}

fn unsigned(value: i64) -> [u8; 4] {
    u32::try_from(value).unwrap_or(u32::MAX).to_le_bytes()
}

fn signed(value: i64) -> [u8; 4] {
    i32::try_from(value).unwrap_or(i32::MAX).to_le_bytes()
}

/// A UBX message.
fn ubx_frame(class: u8, id: u8, payload: &[u8]) -> Vec<u8> {
    let length = u16::try_from(payload.len()).unwrap_or(0).to_le_bytes();
    let mut bytes = vec![0xb5, 0x62, class, id];
    bytes.extend(length);
    bytes.extend(payload);
    let sum = ubx_checksum(&bytes[2..]);
    bytes.extend(sum);
    bytes
}

/// The eight-bit Fletcher sum of everything after the two that begin a message.
fn ubx_checksum(bytes: &[u8]) -> [u8; 2] {
    bytes.iter().fold([0, 0], |[a, b]: [u8; 2], byte| {
        let a = a.wrapping_add(*byte);
        [a, b.wrapping_add(a)]
    })
}

/// TPV and SKY.
fn gpsd_reports(epoch: &Epoch) -> String {
    // ISO 8601.
    let time = format!("{:?}Z", epoch.date_time());
    let satellites = epoch.satellites;
    let hdop = epoch.hdop;
    let (vdop, pdop) = epoch.vdop_pdop();
    let sky = format!(
        "{{\"class\":\"SKY\",\"device\":\"emulated\",\"time\":\"{time}\",\"hdop\":{hdop:.2},\
         \"vdop\":{vdop:.2},\"pdop\":{pdop:.2},\"uSat\":{satellites}}}\r\n"
    );
    let head = format!("{{\"class\":\"TPV\",\"device\":\"emulated\",\"time\":\"{time}\"");
    let status = match epoch.quality {
        FixQuality::None => return format!("{sky}{head},\"mode\":1}}\r\n"),
        FixQuality::Autonomous => 1,
        FixQuality::Differential => 2,
        FixQuality::RtkFixed => 3,
        FixQuality::RtkFloat => 4,
        FixQuality::Estimated => 5,
    };
    let place = epoch.place;
    let sigma = epoch.sigma_m;
    let (speed, course) = epoch.speed_course();
    format!(
        "{sky}{head},\"mode\":3,\"status\":{status},\"lat\":{:.9},\"lon\":{:.9},\
         \"altHAE\":{:.4},\"altMSL\":{:.4},\"geoidSep\":{:.3},\"epx\":{:.4},\"epy\":{:.4},\
         \"epv\":{:.4},\"eph\":{:.4},\"speed\":{speed:.3},\"track\":{course:.3}}}\r\n",
        place.lat_deg,
        place.lon_deg,
        place.alt_m,
        place.alt_m - epoch.geoid_m,
        epoch.geoid_m,
        sigma.x,
        sigma.y,
        sigma.z,
        sigma.x.hypot(sigma.y),
    )
}
