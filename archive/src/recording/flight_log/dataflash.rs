//! `ArduPilot`'s dataflash log: messages that describe themselves (FMT), as bytes or as text
//! (ardupilot.org/copter/docs/logmessages.html; `libraries/AP_Logger/LogStructure.h`).

use std::collections::BTreeMap;

use foxhunt_wire::geodesy::Geodetic;

use super::log::{Levels, Log, OwnFix, binary_array, binary_number, in_utc};

/// The first bytes of a message.
const HEAD: [u8; 2] = [0xa3, 0x95];

/// The message that describes another one: its type and its length.
const FMT: u8 = 128;
const FMT_LENGTH: usize = 89;

/// Seconds from 1970 to the first week of GPS time.
const GPS_EPOCH_S: f64 = 315_964_800.0;

/// Seconds of a week.
const WEEK_S: f64 = 604_800.0;

/// First GPS weeks, each with the seconds by which GPS time is then ahead of UTC (IERS Bulletin C).
const LEAP_SECONDS: [(f64, f64); 4] = [(1930.0, 18.0), (1851.0, 17.0), (1695.0, 16.0), (0.0, 15.0)];

/// Messages that are read: the estimated place, the GNSS receiver's, and levels of the remote
/// control's and the telemetry's radio.
const READ: [&str; 4] = ["POS", "GPS", "RSSI", "RAD"];

/// Fields with levels.
const LEVELS: [(&str, &str); 3] = [("RSSI", "RXRSSI"), ("RAD", "RSSI"), ("RAD", "RemRSSI")];

/// The least status of a fix in three dimensions.
const FIX_3D: f64 = 3.0;

/// A field of a message: offset behind the head, and its letter in FMT.
type Fields = BTreeMap<String, (usize, u8)>;

/// A message by its FMT.
struct Format {
    name: String,
    length: usize,
    fields: Fields,
}

/// Places and times that were read.
#[derive(Default)]
struct Read {
    /// By the estimator.
    estimated: Vec<OwnFix>,
    /// By the GNSS.
    received: Vec<OwnFix>,
    /// Times of the own clock and UTC.
    clock: Vec<[f64; 2]>,
    levels: Levels,
}

/// Reads a binary log; damaged bytes are skipped up to the next message.
pub(super) fn binary(bytes: &[u8]) -> Result<Log, String> {
    let mut formats: BTreeMap<u8, Format> = BTreeMap::new();
    let mut read = Read::default();
    let mut at = 0;
    while let Some([first, second, kind]) = binary_array::<3>(bytes, at) {
        let is_fmt = kind == FMT;
        let length = if is_fmt { Some(FMT_LENGTH) } else { formats.get(&kind).map(|f| f.length) };
        let message = length.and_then(|length| bytes.get(at + 3..at + length));
        let (Some(message), true) = (message, [first, second] == HEAD) else {
            at += 1;
            continue;
        };
        if is_fmt {
            if let Some((of, format)) = described(message) {
                formats.insert(of, format);
            }
        } else if let Some(format) =
            formats.get(&kind).filter(|of| READ.contains(&of.name.as_str()))
        {
            let value = |name: &str| {
                let (offset, letter) = format.fields.get(name)?;
                value(message, *offset, *letter)
            };
            read.take(&format.name, value);
        }
        at += message.len() + 3;
    }
    read.log()
}

/// Reads a log as text: `GPS, 1234, 3, …`, after `FMT, 130, 50, GPS, QBI…, TimeUS,Status,…`.
pub(super) fn text(bytes: &[u8]) -> Result<Log, String> {
    let mut labels: BTreeMap<String, Vec<String>> = BTreeMap::new();
    let mut read = Read::default();
    for line in bytes.split(|byte| *byte == b'\n') {
        // The texts of other messages may be in any encoding.
        let line = String::from_utf8_lossy(line);
        let mut cells = line.split(',').map(str::trim);
        let name = cells.next().unwrap_or_default();
        if name == "FMT" {
            let cells: Vec<&str> = cells.collect();
            if let [_, _, of, _, names @ ..] = cells.as_slice() {
                labels.insert((*of).to_owned(), names.iter().map(|n| (*n).to_owned()).collect());
            }
            continue;
        }
        let Some(names) = labels.get(name).filter(|_| READ.contains(&name)) else { continue };
        let cells: Vec<&str> = cells.collect();
        read.take(name, |label| {
            let index = names.iter().position(|name| name == label)?;
            cells.get(index)?.parse().ok()
        });
    }
    read.log()
}

impl Read {
    /// Takes the places and times of a message.
    fn take(&mut self, name: &str, value: impl Fn(&str) -> Option<f64>) {
        // Of several receivers the first one.
        if value("I").is_some_and(|instance| instance > 0.0) {
            return;
        }
        let Some(own_s) = value("TimeUS").map(|microseconds| microseconds * 1e-6) else { return };
        let place = || {
            Some(Geodetic { lat_deg: value("Lat")?, lon_deg: value("Lng")?, alt_m: value("Alt")? })
        };
        match name {
            "POS" => {
                self.estimated.extend(place().map(|place| OwnFix { own_s, place }));
            }
            "GPS" if value("Status").is_some_and(|status| status >= FIX_3D) => {
                self.received.extend(place().map(|place| OwnFix { own_s, place }));
                let utc = value("GWk").zip(value("GMS")).map(|(week, ms)| gps_utc(week, ms));
                self.clock.extend(utc.map(|utc| [own_s, utc]));
            }
            _ => {}
        }
        for (_, field) in LEVELS.iter().filter(|(message, _)| *message == name) {
            if let Some(number) = value(field) {
                self.levels.take(&format!("{name}.{field}"), own_s, number);
            }
        }
    }

    fn log(self) -> Result<Log, String> {
        let fixes = if self.estimated.is_empty() { &self.received } else { &self.estimated };
        in_utc(fixes, self.levels, &self.clock)
    }
}

/// The seconds since 1970 of a week and a millisecond of GPS time.
fn gps_utc(week: f64, millisecond: f64) -> f64 {
    let leap = LEAP_SECONDS.iter().find(|(from, _)| week >= *from).map_or(0.0, |(_, leap)| *leap);
    GPS_EPOCH_S + week * WEEK_S + millisecond * 1e-3 - leap
}

/// The type and the format that an FMT describes.
fn described(message: &[u8]) -> Option<(u8, Format)> {
    let text = |from: usize, length: usize| {
        let bytes = message.get(from..from + length)?;
        let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(length);
        Some(String::from_utf8_lossy(bytes.get(..end)?).into_owned())
    };
    let kind = *message.first()?;
    let length = usize::from(*message.get(1)?);
    let name = text(2, 4)?;
    let letters = text(6, 16)?;
    let labels = text(22, 64)?;
    let mut fields = Fields::new();
    let mut offset = 0;
    for (letter, label) in letters.bytes().zip(labels.split(',')) {
        fields.insert(label.to_owned(), (offset, letter));
        offset += width(letter)?;
    }
    // A message of fewer bytes than its head would be read for ever.
    (length == offset + 3).then_some((kind, Format { name, length, fields }))
}

/// The width of a field in bytes.
fn width(letter: u8) -> Option<usize> {
    Some(match letter {
        b'b' | b'B' | b'M' => 1,
        b'h' | b'H' | b'c' | b'C' | b'g' => 2,
        b'i' | b'I' | b'f' | b'e' | b'E' | b'L' | b'n' => 4,
        b'd' | b'q' | b'Q' => 8,
        b'N' => 16,
        b'Z' | b'a' => 64,
        _ => return None,
    })
}

/// The number in a field: hundredths and degrees × 10⁷ are scaled.
fn value(message: &[u8], at: usize, letter: u8) -> Option<f64> {
    let (kind, scale) = match letter {
        b'b' => ("int8_t", 1.0),
        b'B' | b'M' => ("uint8_t", 1.0),
        b'h' => ("int16_t", 1.0),
        b'H' => ("uint16_t", 1.0),
        b'c' => ("int16_t", 1e-2),
        b'C' => ("uint16_t", 1e-2),
        b'i' => ("int32_t", 1.0),
        b'I' => ("uint32_t", 1.0),
        b'e' => ("int32_t", 1e-2),
        b'E' => ("uint32_t", 1e-2),
        b'L' => ("int32_t", 1e-7),
        b'f' => ("float", 1.0),
        b'd' => ("double", 1.0),
        b'q' => ("int64_t", 1.0),
        b'Q' => ("uint64_t", 1.0),
        _ => return None,
    };
    binary_number(message, at, kind).map(|number| number * scale)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn gps_time_is_utc_and_its_leap_seconds() {
        // 2026-06-21 14:03:00 UTC: week 2424, 50 598 s into Sunday with 18 leap seconds.
        assert_abs_diff_eq!(gps_utc(2424.0, 50_598_000.0), 1_782_050_580.0, epsilon = 1e-6);
        // 2016-12-31 23:59:59 UTC, before the last leap second.
        assert!(
            (gps_utc(1929.0, 604_800_000.0 - 1e3 + 17e3 + 1e3 - 1e3) - 1_483_228_799.0).abs()
                < 1e-6
        );
    }
}
