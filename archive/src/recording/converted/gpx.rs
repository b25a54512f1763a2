use quick_xml::{Reader, events::Event};

use super::rows::{Converted, Made, RowsWriter, not_written};
use crate::recording::RecordingError;

/// Bytes in which the first element is looked for.
const LOOKED_AT: usize = 1024;

/// Names of elements with a level, as loggers write them into a point's extensions.
const LEVELS: [&[u8]; 6] = [b"rssi", b"rss", b"dbm", b"rsrp", b"signal", b"signal_strength"];

/// Points of a GPX track that have a level among their extensions; `None` for a track without,
/// which is a path, and for any other file.
pub(super) fn convert(bytes: &[u8], file: &str) -> Result<Option<Converted>, RecordingError> {
    let begin = bytes.get(..LOOKED_AT).unwrap_or(bytes);
    if !begin.windows(4).any(|word| word == b"<gpx") {
        return Ok(None);
    }
    let mut made = RowsWriter::new(&["time_utc", "lat_deg", "lon_deg", "alt_m", "rss_db"]);
    let mut points = 0_u64;
    let mut written = 0_u64;
    // Time, latitude, longitude, height and level of the point that is open.
    let mut point: Option<[String; 5]> = None;
    let mut element = Vec::new();
    let mut reader = Reader::from_reader(bytes);
    reader.config_mut().trim_text(true);
    loop {
        // A damaged file is named by the reader of paths.
        let Ok(event) = reader.read_event() else { return Ok(None) };
        match event {
            Event::Eof => break,
            Event::Start(start) => {
                element = start.local_name().as_ref().to_ascii_lowercase();
                if element == b"trkpt" || element == b"wpt" {
                    let text = |name: &str| {
                        let attribute = start.try_get_attribute(name).ok().flatten();
                        let value = attribute.map(|own| own.value);
                        value.map_or_else(String::new, |v| String::from_utf8_lossy(&v).into_owned())
                    };
                    let [lat, lon] = ["lat", "lon"].map(text);
                    point = Some([String::new(), lat, lon, String::new(), String::new()]);
                }
            }
            Event::Text(text) => {
                let Some([time, _, _, height, level]) = &mut point else { continue };
                let text = String::from_utf8_lossy(&text).trim().to_owned();
                match element.as_slice() {
                    b"time" => *time = text,
                    b"ele" => *height = text,
                    name if LEVELS.contains(&name) => *level = text,
                    _ => {}
                }
            }
            Event::End(end) => {
                element.clear();
                let name = end.local_name();
                if name.as_ref() != b"trkpt" && name.as_ref() != b"wpt" {
                    continue;
                }
                let Some(cells) = point.take() else { continue };
                points += 1;
                if !cells[4].is_empty() {
                    written += 1;
                    made.write(points, &cells).map_err(|error| not_written(file, error))?;
                }
            }
            _ => {}
        }
    }
    if written == 0 {
        return Ok(None);
    }
    let rows = made.finish().map_err(|error| not_written(file, error))?;
    let what = format!("a GPX track, of whose {points} points {written} have a level");
    Ok(Some(Converted { table: Made::Rows(rows), what }))
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
        let made = convert(text.as_bytes(), "walk.gpx").expect("it is read").expect("levels");
        assert!(made.what.contains("2 points 1 have"), "{}", made.what);
        let Made::Rows(rows) = made.table else { panic!("rows") };
        let csv = String::from_utf8(rows.csv).expect("text").replace('"', "");
        assert_eq!(csv, "2026-06-21T14:03:00Z,48.2,16.37,210.5,-71.5\n");
        assert!(convert(gpx("").as_bytes(), "walk.gpx").expect("it is read").is_none());
        assert!(convert(b"time,lat\n<gpx", "a.csv").expect("it is read").is_none());
    }
}
