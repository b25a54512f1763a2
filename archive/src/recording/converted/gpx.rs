use std::collections::BTreeMap;

use quick_xml::{Reader, events::Event};

use super::rows::{Converted, Made, RowsWriter, not_written};
use crate::recording::RecordingError;

/// Bytes in which the first element is looked for.
const LOOKED_AT: usize = 1024;

/// Names of elements with a level, as loggers write them into a point's extensions.
const LEVELS: [&str; 6] = ["rssi", "rss", "dbm", "rsrp", "signal", "signal_strength"];

/// A point of a track.
#[derive(Default)]
struct Point {
    time: String,
    lat: String,
    lon: String,
    height: String,
    /// Levels, each with the name of its element.
    levels: Vec<(String, String)>,
}

/// Points of a GPX track that have a level among their extensions; `None` for a track without,
/// which is a path, and for any other file. `level` is the name of the element with the level; it
/// is needed where there are several.
pub(super) fn convert(
    bytes: &[u8],
    file: &str,
    level: Option<&str>,
) -> Result<Option<Converted>, RecordingError> {
    let begin = bytes.get(..LOOKED_AT).unwrap_or(bytes);
    if !begin.windows(4).any(|word| word == b"<gpx") {
        return Ok(None);
    }
    // A damaged file is named by the reader of paths.
    let Some((points, count)) = points(bytes, level) else { return Ok(None) };
    let mut names: BTreeMap<&str, u64> = BTreeMap::new();
    for (name, _) in points.iter().flat_map(|(_, point)| &point.levels) {
        *names.entry(name).or_default() += 1;
    }
    let chosen = match level {
        Some(level) => names.keys().find(|name| name.eq_ignore_ascii_case(level)),
        None if names.is_empty() => return Ok(None),
        None => names.keys().next().filter(|_| names.len() == 1),
    };
    let Some(chosen) = chosen.copied() else {
        let each = names.iter().map(|(name, count)| format!("{name} ({count})"));
        return Err(RecordingError::ChooseLevel {
            file: file.to_owned(),
            what: "a GPX track",
            named: level.map(str::to_owned),
            levels: each.collect::<Vec<_>>().join(", "),
        });
    };
    let mut made = RowsWriter::new(&["time_utc", "lat_deg", "lon_deg", "alt_m", "rss_db"]);
    let mut written = 0_u64;
    for (number, Point { time, lat, lon, height, levels }) in &points {
        let Some((_, level)) = levels.iter().find(|(name, _)| name == chosen) else { continue };
        written += 1;
        let cells = [time, lat, lon, height, level];
        made.write(*number, &cells).map_err(|error| not_written(file, error))?;
    }
    made.rows.has_named_level = true;
    let rows = made.finish().map_err(|error| not_written(file, error))?;
    let what = format!("a GPX track, of whose {count} points {written} have a level <{chosen}>");
    Ok(Some(Converted { table: Made::Rows(rows), what }))
}

/// Returns the points with levels, each with its number, and the number of all; `None` for a file
/// that is damaged. An element that is named has levels too.
fn points(bytes: &[u8], named: Option<&str>) -> Option<(Vec<(u64, Point)>, u64)> {
    let mut points = Vec::new();
    let mut count = 0_u64;
    let mut open: Option<Point> = None;
    let mut element = String::new();
    let mut reader = Reader::from_reader(bytes);
    reader.config_mut().trim_text(true);
    let is_level = |name: &str| {
        LEVELS.contains(&name) || named.is_some_and(|named| named.eq_ignore_ascii_case(name))
    };
    loop {
        match reader.read_event().ok()? {
            Event::Eof => return Some((points, count)),
            Event::Start(start) => {
                let name = start.local_name();
                element = String::from_utf8_lossy(name.as_ref()).to_ascii_lowercase();
                if element == "trkpt" || element == "wpt" {
                    let text = |name: &str| {
                        let attribute = start.try_get_attribute(name).ok().flatten();
                        let value = attribute.map(|own| own.value);
                        value.map_or_else(String::new, |v| String::from_utf8_lossy(&v).into_owned())
                    };
                    let [lat, lon] = ["lat", "lon"].map(text);
                    open = Some(Point { lat, lon, ..Point::default() });
                }
            }
            Event::Text(text) => {
                let Some(point) = &mut open else { continue };
                let text = String::from_utf8_lossy(&text).trim().to_owned();
                match element.as_str() {
                    "time" => point.time = text,
                    "ele" => point.height = text,
                    name if is_level(name) => point.levels.push((name.to_owned(), text)),
                    _ => {}
                }
            }
            Event::End(end) => {
                element.clear();
                let name = end.local_name();
                if name.as_ref() != b"trkpt" && name.as_ref() != b"wpt" {
                    continue;
                }
                let Some(point) = open.take() else { continue };
                count += 1;
                if !point.levels.is_empty() {
                    points.push((count, point));
                }
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_with_a_level_are_rows() {
        let gpx = |extension: &str| {
            format!(
                "<?xml version=\"1.0\"?><gpx version=\"1.1\" xmlns:x=\"x\"><trk><trkseg>\
                 <trkpt lat=\"48.2\" lon=\"16.37\"><ele>210.5</ele>\
                 <time>2026-06-21T14:03:00Z</time>{extension}</trkpt>\
                 <trkpt lat=\"48.3\" lon=\"16.38\"><time>2026-06-21T14:03:01Z</time></trkpt>\
                 </trkseg></trk></gpx>"
            )
        };
        let text = gpx("<extensions><x:RSSI>-71.5</x:RSSI></extensions>");
        let made = convert(text.as_bytes(), "walk.gpx", None).expect("it is read").expect("levels");
        assert!(made.what.contains("2 points 1 have"), "{}", made.what);
        let Made::Rows(rows) = made.table else { panic!("rows") };
        let csv = String::from_utf8(rows.csv).expect("text").replace('"', "");
        assert_eq!(csv, "2026-06-21T14:03:00Z,48.2,16.37,210.5,-71.5\n");
        let two = gpx("<extensions><rssi>-71.5</rssi><rsrp>-99</rsrp><snr>9</snr></extensions>");
        let error = convert(two.as_bytes(), "walk.gpx", None).expect_err("two levels").to_string();
        assert!(error.contains("--level NAME: rsrp (1), rssi (1)"), "{error}");
        for (level, cell) in [("RSRP", ",-99\n"), ("snr", ",9\n")] {
            let made = convert(two.as_bytes(), "walk.gpx", Some(level)).expect("it is read");
            let Made::Rows(rows) = made.expect("levels").table else { panic!("rows") };
            let csv = String::from_utf8(rows.csv).expect("text").replace('"', "");
            assert!(csv.ends_with(cell), "{csv}");
        }
        let error = convert(gpx("").as_bytes(), "walk.gpx", Some("rssi")).expect_err("no level");
        assert!(error.to_string().contains("no levels at all"), "{error}");
        assert!(convert(gpx("").as_bytes(), "walk.gpx", None).expect("it is read").is_none());
        assert!(convert(b"time,lat\n<gpx", "a.csv", None).expect("it is read").is_none());
    }
}
