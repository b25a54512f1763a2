//! PX4's log (docs.px4.io/main/en/dev_log/ulog_file_format.html): topics whose fields are
//! described in the file.

use std::collections::BTreeMap;

use foxhunt_wire::geodesy::Geodetic;

use super::log::{Levels, Log, OwnFix, binary_array, binary_number, binary_size, in_utc};

/// Bytes before the first message.
const HEADER: usize = 16;

/// Formats within formats are followed to this depth.
const DEPTH: usize = 8;

/// The estimated place.
const ESTIMATED: &str = "vehicle_global_position";

/// Topics of the GNSS receiver, the newer name first.
const RECEIVED: [&str; 2] = ["vehicle_gps_position", "sensor_gps"];

/// Fields with levels, by topic.
const LEVELS: [(&str, &str); 4] = [
    ("radio_status", "rssi"),
    ("radio_status", "remote_rssi"),
    ("input_rc", "rssi"),
    ("input_rc", "rssi_dbm"),
];

/// The least type of a fix in three dimensions.
const FIX_3D: f64 = 3.0;

/// Offset and type of each field of a topic.
type Fields = BTreeMap<String, (usize, String)>;

/// Reads the places and levels of the first instance of each topic.
pub(super) fn read(bytes: &[u8]) -> Result<Log, String> {
    let mut formats: BTreeMap<String, String> = BTreeMap::new();
    let mut topics: BTreeMap<u16, (String, Fields)> = BTreeMap::new();
    let mut estimated = Vec::new();
    let mut received = Vec::new();
    let mut clock = Vec::new();
    let mut levels = Levels::default();
    let mut at = HEADER;
    while let Some([low, high, kind]) = binary_array::<3>(bytes, at) {
        let size = usize::from(u16::from_le_bytes([low, high]));
        // The last message of a log may be cut off.
        let Some(message) = bytes.get(at + 3..at + 3 + size) else { break };
        at += 3 + size;
        match kind {
            b'F' => {
                let text = String::from_utf8_lossy(message);
                if let Some((name, fields)) = text.split_once(':') {
                    formats.insert(name.to_owned(), fields.to_owned());
                }
            }
            b'A' => {
                let Some([instance, low, high]) = binary_array::<3>(message, 0) else {
                    continue;
                };
                let name = String::from_utf8_lossy(message.get(3..).unwrap_or_default());
                let is_read = name == ESTIMATED
                    || RECEIVED.contains(&name.as_ref())
                    || LEVELS.iter().any(|(topic, _)| name == *topic);
                if instance == 0 && is_read {
                    let fields = fields(&formats, &name);
                    topics.insert(u16::from_le_bytes([low, high]), (name.into_owned(), fields));
                }
            }
            b'D' => {
                let Some(id) = binary_array::<2>(message, 0).map(u16::from_le_bytes) else {
                    continue;
                };
                let Some((name, fields)) = topics.get(&id) else { continue };
                let data = message.get(2..).unwrap_or_default();
                let value = |field: &str| {
                    let (offset, kind) = fields.get(field)?;
                    binary_number(data, *offset, kind)
                };
                let Some(own_s) = value("timestamp").map(|micros| micros * 1e-6) else { continue };
                for (topic, field) in LEVELS.iter().filter(|(topic, _)| name == topic) {
                    if let Some(number) = value(field) {
                        levels.take(&format!("{topic}.{field}"), own_s, number);
                    }
                }
                let Some(place) = place(value) else { continue };
                let fix = OwnFix { own_s, place };
                if name == ESTIMATED {
                    estimated.push(fix);
                    continue;
                }
                if value("fix_type").is_some_and(|kind| kind < FIX_3D) {
                    continue;
                }
                received.push(fix);
                let utc = value("time_utc_usec").filter(|micros| *micros > 0.0);
                clock.extend(utc.map(|micros| [own_s, micros * 1e-6]));
            }
            _ => {}
        }
    }
    in_utc(if estimated.is_empty() { &received } else { &estimated }, levels, &clock)
}

/// The place in a message: degrees, or degrees × 10⁷ and millimetres as before version 1.15.
fn place(value: impl Fn(&str) -> Option<f64>) -> Option<Geodetic> {
    let degrees = |field: &str| value(field).filter(|number| number.is_finite());
    if let Some((lat_deg, lon_deg)) = degrees("latitude_deg").zip(degrees("longitude_deg")) {
        return Some(Geodetic { lat_deg, lon_deg, alt_m: value("altitude_msl_m")? });
    }
    let lat = degrees("lat")?;
    let lon = degrees("lon")?;
    let alt = value("alt")?;
    let is_scaled = lat.abs() > 360.0 || lon.abs() > 360.0;
    let [degree, metre] = if is_scaled { [1e-7, 1e-3] } else { [1.0, 1.0] };
    Some(Geodetic { lat_deg: lat * degree, lon_deg: lon * degree, alt_m: alt * metre })
}

/// Offsets and types of a topic's fields, as far as their sizes are known.
fn fields(formats: &BTreeMap<String, String>, topic: &str) -> Fields {
    let mut fields = Fields::new();
    let mut offset = 0;
    for field in formats.get(topic).map_or("", String::as_str).split(';') {
        let Some((kind, name)) = field.split_once(' ') else { continue };
        fields.insert(name.to_owned(), (offset, kind.to_owned()));
        let Some(size) = size(formats, kind, DEPTH) else { break };
        offset += size;
    }
    fields
}

/// The size of a type, which may be a list or another format.
fn size(formats: &BTreeMap<String, String>, kind: &str, depth: usize) -> Option<usize> {
    let (kind, count) = match kind.split_once('[') {
        Some((kind, count)) => (kind, count.trim_end_matches(']').parse::<usize>().ok()?),
        None => (kind, 1),
    };
    let one = match binary_size(kind) {
        Some(size) => size,
        None => {
            let depth = depth.checked_sub(1)?;
            let fields = formats.get(kind)?.split(';').filter_map(|field| field.split_once(' '));
            let mut sizes = fields.map(|(kind, _)| size(formats, kind, depth));
            sizes.try_fold(0_usize, |sum, size| sum.checked_add(size?))?
        }
    };
    one.checked_mul(count)
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    fn at(lat: f64, lon: f64) -> [f64; 3] {
        let value = |field: &str| match field {
            "lat" => Some(lat),
            "lon" => Some(lon),
            "alt" => Some(if lat.abs().max(lon.abs()) > 360.0 { 250_000.0 } else { 250.0 }),
            _ => None,
        };
        let Geodetic { lat_deg, lon_deg, alt_m } = place(value).expect("all fields");
        [lat_deg, lon_deg, alt_m]
    }

    /// A place beside the equator or the prime meridian has a scaled number that might be degrees.
    #[test]
    fn scaled_places_are_told_from_degrees() {
        for [lat, lon] in [[48.0, -11.0], [2e-5, -78.5], [-33.0, 1e-5], [-2e-5, 110.0]] {
            for given in [at(lat * 1e7, lon * 1e7), at(lat, lon)] {
                let off = Vector3::from(given) - Vector3::new(lat, lon, 250.0);
                assert!(off.amax() < 1e-9, "{lat} {lon}: {given:?}");
            }
        }
    }
}
