use foxhunt_wire::geodesy::{Geodetic, LocalFrame, radians_to_compass_deg};
use quick_xml::{Reader, events::Event};

use super::rows::{Converted, Made, RowsWriter, not_written};
use crate::recording::RecordingError;

/// Bytes in which the first element is looked for.
const LOOKED_AT: usize = 1024;

/// Two ends of a line that are nearer than this, in metres, have no direction.
const LEAST_M: f64 = 0.1;

/// A line of two points.
struct Bearing {
    /// Name of the line's placemark.
    name: String,
    /// Time of the placemark.
    when: String,
    from: Geodetic,
    deg_compass: f64,
}

/// Lines of two points in a KML file (OGC 12-007r2), each a bearing from its first point to its
/// second one; `None` for a file without such lines, and for any other file.
pub(super) fn convert(bytes: &[u8], file: &str) -> Result<Option<Converted>, RecordingError> {
    let begin = bytes.get(..LOOKED_AT).unwrap_or(bytes);
    if !begin.windows(4).any(|word| word == b"<kml") {
        return Ok(None);
    }
    // A damaged file is named by the reader of paths.
    let Some((bearings, lines)) = bearings(bytes) else { return Ok(None) };
    if bearings.is_empty() {
        return Ok(None);
    }
    // Where one of them has no time, none is read: a recording has all of its times or none.
    let is_timed = bearings.iter().all(|(_, bearing)| !bearing.when.is_empty());
    let mut header = vec!["drone", "lat_deg", "lon_deg", "bearing_deg_compass"];
    header.extend(is_timed.then_some("time_utc"));
    let mut made = RowsWriter::new(&header);
    for (line, Bearing { name, when, from, deg_compass }) in &bearings {
        let [lat, lon] = [from.lat_deg, from.lon_deg].map(|degrees| format!("{degrees:.8}"));
        let bearing = format!("{deg_compass:.4}");
        let mut cells = vec![name, &lat, &lon, &bearing];
        cells.extend(is_timed.then_some(when));
        made.write(*line, &cells).map_err(|error| not_written(file, error))?;
    }
    let rows = made.finish().map_err(|error| not_written(file, error))?;
    let what = format!(
        "a KML file, of whose {lines} lines {} have two points: each is a bearing from its first \
         point, the receiver's place",
        bearings.len()
    );
    Ok(Some(Converted { table: Made::Rows(rows), what }))
}

/// The lines of two points, each with the line of the file in which it ends, and the number of all
/// lines; `None` for a file that is damaged.
fn bearings(bytes: &[u8]) -> Option<(Vec<(u64, Bearing)>, u64)> {
    let mut found = Vec::new();
    let mut count = 0_u64;
    let mut element = Vec::new();
    let mut name = String::new();
    let mut when = String::new();
    // The lines of the open placemark.
    let mut lines: Vec<(u64, [Geodetic; 2])> = Vec::new();
    let mut in_line = false;
    let mut reader = Reader::from_reader(bytes);
    reader.config_mut().trim_text(true);
    let mut line = 1_u64;
    let mut counted = 0;
    loop {
        let event = reader.read_event().ok()?;
        let read = usize::try_from(reader.buffer_position()).unwrap_or(usize::MAX);
        let passed = bytes.get(counted..read).unwrap_or_default();
        line += passed.iter().map(|byte| u64::from(*byte == b'\n')).sum::<u64>();
        counted = read;
        match event {
            Event::Eof => return Some((found, count)),
            Event::Start(start) => {
                element = start.local_name().as_ref().to_vec();
                match element.as_slice() {
                    b"Placemark" => {
                        name.clear();
                        when.clear();
                        lines.clear();
                    }
                    b"LineString" => in_line = true,
                    _ => {}
                }
            }
            Event::Text(text) => {
                let text = String::from_utf8_lossy(&text).into_owned();
                match element.as_slice() {
                    b"name" => name = text,
                    b"when" => when = text,
                    b"coordinates" if in_line => {
                        count += 1;
                        lines.extend(ends(&text).map(|ends| (line, ends)));
                    }
                    _ => {}
                }
            }
            Event::End(end) => {
                element.clear();
                match end.local_name().as_ref() {
                    b"LineString" => in_line = false,
                    b"Placemark" => {
                        for (line, [from, to]) in lines.drain(..) {
                            let Some(deg_compass) = direction(from, to) else { continue };
                            let name = name.clone();
                            let when = when.clone();
                            found.push((line, Bearing { name, when, from, deg_compass }));
                        }
                    }
                    _ => {}
                }
            }
            _ => {}
        }
    }
}

/// The ends of a line of two points; `None` for any other line, and for numbers that are no place.
fn ends(coordinates: &str) -> Option<[Geodetic; 2]> {
    let mut tuples = coordinates.split_whitespace();
    let [first, second] = [tuples.next()?, tuples.next()?];
    if tuples.next().is_some() {
        return None;
    }
    let place = |tuple: &str| {
        let mut numbers = tuple.split(',').map(|number| number.trim().parse::<f64>().ok());
        let lon_deg = numbers.next()??;
        let lat_deg = numbers.next()??;
        Geodetic::new(lat_deg, lon_deg, 0.0).ok()
    };
    Some([place(first)?, place(second)?])
}

/// Direction of the second place at the first one, in degrees clockwise from true North; `None`
/// for two places that are one.
fn direction(from: Geodetic, to: Geodetic) -> Option<f64> {
    let local = LocalFrame::new(from).ok()?.to_local(&to);
    let is_far = libm::hypot(local.x, local.y) >= LEAST_M;
    is_far.then(|| radians_to_compass_deg(libm::atan2(local.y, local.x)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::converted::Rows;

    fn file(placemarks: &str) -> String {
        format!("<?xml version=\"1.0\"?>\n<kml><Document>\n{placemarks}</Document></kml>\n")
    }

    fn line(name: &str, when: &str, coordinates: &str) -> String {
        format!(
            "<Placemark><name>{name}</name>{when}<LineString><coordinates>{coordinates}\
             </coordinates></LineString></Placemark>\n"
        )
    }

    fn rows(text: &str) -> Option<(Rows, String)> {
        let made = convert(text.as_bytes(), "lines.kml").expect("it is read")?;
        let Made::Rows(rows) = made.table else { panic!("rows") };
        Some((rows, made.what))
    }

    #[test]
    fn a_line_of_two_points_is_a_bearing_from_the_first() {
        // Along the meridian, and along the equator.
        let text = file(
            &(line("A", "", "16.37,48.2,230 16.37,48.1,0")
                + &line("B", "", "16.0,0.0 15.9,0.0")
                + &line("path", "", "16.0,0.0 15.9,0.0 15.8,0.0")
                + &line("a point", "", "16.0,0.0 16.0,0.0")),
        );
        let (rows, what) = rows(&text).expect("bearings");
        let csv = String::from_utf8(rows.csv).expect("text").replace('"', "");
        assert_eq!(csv, "A,48.20000000,16.37000000,180.0000\nB,0.00000000,16.00000000,270.0000\n");
        assert_eq!(rows.lines, [3, 4]);
        assert!(what.contains("4 lines 2 have two points"), "{what}");
    }

    #[test]
    fn times_are_read_where_all_have_one() {
        let when = "<TimeStamp><when>2026-06-21T14:03:00Z</when></TimeStamp>";
        let timed = line("A", when, "16.37,48.2 16.37,48.3");
        let (rows_of_timed, _) = rows(&file(&timed)).expect("a bearing");
        assert_eq!(rows_of_timed.header.last().map(String::as_str), Some("time_utc"));
        let mixed = timed + &line("B", "", "16.0,48.2 15.9,48.2");
        assert_eq!(rows(&file(&mixed)).expect("bearings").0.header.len(), 4);
    }

    #[test]
    fn others_are_left_alone() {
        let path = file(&line("path", "", "16.0,0.0 15.9,0.0 15.8,0.0"));
        for other in ["", "a,b\n", "<gpx></gpx>", "<kml><", path.as_str()] {
            assert!(rows(other).is_none(), "{other}");
        }
    }
}
