use std::sync::Arc;

use foxhunt_wire::geodesy::Geodetic;
use quick_xml::{
    Reader,
    events::{BytesStart, Event},
};

use super::{
    FieldProblem, RecordingError,
    flight_log::{Fix, Kind},
    utc::{utc, utc_seconds},
};

/// Two points of a track farther apart in seconds are not joined: the receiver may have been
/// anywhere between them.
const LONGEST_GAP_S: f64 = 30.0;

/// Path of a receiver over time: the track of a GPX file (Topografix, GPX 1.1, 2004) or a KML file
/// (OGC 12-007r2, `gx:Track` and points with a time), as navigators and loggers write it, the path
/// in an autopilot's log: `ArduPilot`'s dataflash (`.bin`, `.log`), PX4's (`.ulg`) or MAVLink's
/// (`.tlog`), or a table with times in UTC and places. Points without a time are not used.
#[derive(Clone, Debug, PartialEq)]
pub struct Rover {
    file: Arc<str>,
    /// In the order of time.
    points: Arc<[Point]>,
    first: Point,
    last: Point,
}

/// A point of a track.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Point {
    /// Seconds since 1970 in UTC.
    time: f64,
    place: Geodetic,
    /// True if the line from the point before leads here.
    joined: bool,
}

impl Rover {
    /// Reads a track from GPX or KML; `file` is its name in errors.
    pub(super) fn of_xml(xml: &[u8], file: &str) -> Result<Self, RecordingError> {
        let mut track = Track { file, xml, points: Vec::new(), starts: true };
        track.read()?;
        let Track { points, .. } = track;
        let (Some(&first), Some(&last)) = (points.first(), points.last()) else {
            return Err(RecordingError::NoTrack { file: file.to_owned() });
        };
        Ok(Self { file: file.into(), points: points.into(), first, last })
    }

    /// Reads the path in an autopilot's log; `file` is its name in errors.
    pub(super) fn of_log(kind: Kind, bytes: &[u8], file: &str) -> Result<Self, RecordingError> {
        let no_path =
            |problem| RecordingError::NoPath { file: file.to_owned(), what: kind.name(), problem };
        Self::of_fixes(kind.fixes(bytes).map_err(no_path)?, file)
    }

    /// Makes a track of fixes in the order of time; `file` is its name in errors.
    pub(super) fn of_fixes(fixes: Vec<Fix>, file: &str) -> Result<Self, RecordingError> {
        let point = |fix: Fix| Point { time: fix.time, place: fix.place, joined: true };
        let points: Vec<Point> = fixes.into_iter().map(point).collect();
        let (Some(&first), Some(&last)) = (points.first(), points.last()) else {
            return Err(RecordingError::NoTrack { file: file.to_owned() });
        };
        Ok(Self { file: file.into(), points: points.into(), first, last })
    }

    /// Returns the file's name.
    #[must_use]
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Rule under which rows without a place on the track are counted.
    pub(super) fn label(&self) -> String {
        let [from, to] = [self.first, self.last].map(|end| utc(end.time));
        format!("on the track {}, from {from} to {to} UTC", self.file)
    }

    /// The first and the last time, in seconds since 1970.
    pub(super) fn times(&self) -> [f64; 2] {
        [self.first.time, self.last.time]
    }

    /// Returns the place where the track begins.
    #[must_use]
    pub fn begin(&self) -> Geodetic {
        self.first.place
    }

    /// Returns the receiver's place at a time in seconds since 1970, on the line between two
    /// points; `None` before the first, after the last, between segments of the track and between
    /// points more than 30 s apart.
    #[must_use]
    pub fn place(&self, time: f64) -> Option<Geodetic> {
        let after = self.points.partition_point(|point| point.time < time);
        let next = self.points.get(after)?;
        if next.time <= time {
            return Some(next.place);
        }
        let last = self.points.get(after.checked_sub(1)?)?;
        let gap = next.time - last.time;
        if !next.joined || gap > LONGEST_GAP_S || gap.is_nan() {
            return None;
        }
        let share = (time - last.time) / gap;
        let between = |a: f64, b: f64| a + share * (b - a);
        // The short way over the date line.
        let east = next.place.lon_deg - last.place.lon_deg;
        let east = (east + 180.0).rem_euclid(360.0) - 180.0;
        Some(Geodetic {
            lat_deg: between(last.place.lat_deg, next.place.lat_deg),
            lon_deg: last.place.lon_deg + share * east,
            alt_m: between(last.place.alt_m, next.place.alt_m),
        })
    }
}

/// Times and places of a track in KML, which stand one after the other; one that is missing keeps
/// its turn.
#[derive(Default)]
struct Moments {
    /// Seconds since 1970, with text and line.
    times: Vec<Option<(f64, String, u64)>>,
    places: Vec<Option<Geodetic>>,
    /// True within the view of a viewer, whose time is not the receiver's.
    in_view: bool,
}

impl Moments {
    /// Begins a time or a place.
    fn open(&mut self, element: &[u8]) {
        match element {
            b"when" if !self.in_view => self.times.push(None),
            b"coord" | b"coordinates" => self.places.push(None),
            _ => {}
        }
    }

    fn set_time(&mut self, time: (f64, String, u64)) {
        if let Some(last) = self.times.last_mut().filter(|_| !self.in_view) {
            *last = Some(time);
        }
    }

    fn set_place(&mut self, place: Geodetic) {
        if let Some(last) = self.places.last_mut() {
            *last = Some(place);
        }
    }
}

/// A track that is being read.
struct Track<'g> {
    file: &'g str,
    xml: &'g [u8],
    points: Vec<Point>,
    /// True if a segment begins.
    starts: bool,
}

impl Track<'_> {
    fn read(&mut self) -> Result<(), RecordingError> {
        let mut reader = Reader::from_reader(self.xml);
        reader.config_mut().trim_text(true);
        let mut line = 1;
        let mut counted = 0;
        // The point that is open, and the element within it.
        let mut point: Option<Geodetic> = None;
        let mut element = Vec::new();
        let mut time: Option<f64> = None;
        let mut moments = Moments::default();
        loop {
            let event = reader.read_event();
            let read = usize::try_from(reader.buffer_position()).unwrap_or(usize::MAX);
            let passed = self.xml.get(counted..read).unwrap_or_default();
            line += passed.iter().map(|byte| u64::from(*byte == b'\n')).sum::<u64>();
            counted = read;
            let event = event.map_err(|source| self.broken(line, &source))?;
            match &event {
                Event::Eof => return Ok(()),
                Event::Start(start) => {
                    element = start.local_name().as_ref().to_vec();
                    match element.as_slice() {
                        b"trkseg" => self.starts = true,
                        b"Track" | b"Placemark" => {
                            self.starts |= element == b"Track";
                            moments = Moments::default();
                        }
                        b"LookAt" | b"Camera" => moments.in_view = true,
                        b"when" | b"coord" | b"coordinates" => moments.open(&element),
                        b"trkpt" => (point, time) = (Some(self.place(start, line)?), None),
                        _ => {}
                    }
                }
                Event::Text(text) => {
                    let text = String::from_utf8_lossy(text).into_owned();
                    match element.as_slice() {
                        b"when" => {
                            let time = self.time(&text, line)?;
                            moments.set_time((time, text.clone(), line));
                        }
                        b"coord" => moments.set_place(self.coordinates(&text, line)?),
                        // The coordinates of a line have no times.
                        b"coordinates" if text.split_whitespace().count() == 1 => {
                            moments.set_place(self.coordinates(&text.replace(',', " "), line)?);
                        }
                        b"altitudeMode" if text.trim() == "relativeToGround" => {
                            let problem = FieldProblem::AboveGround;
                            return Err(self.wrong("altitudeMode", &text, line, problem));
                        }
                        _ => {}
                    }
                    let Some(place) = &mut point else { continue };
                    match element.as_slice() {
                        b"ele" => place.alt_m = self.number("ele", &text, line, 1e5)?,
                        b"time" => {
                            let seconds = self.time(&text, line)?;
                            self.rises(seconds, &text, line)?;
                            time = Some(seconds);
                        }
                        _ => {}
                    }
                }
                Event::End(end) => {
                    element.clear();
                    match end.local_name().as_ref() {
                        b"LookAt" | b"Camera" => moments.in_view = false,
                        b"Track" | b"Placemark" => self.take(std::mem::take(&mut moments), line)?,
                        _ => {}
                    }
                    if end.local_name().as_ref() == b"trkpt"
                        && let (Some(place), Some(time)) = (point.take(), time.take())
                    {
                        self.points.push(Point { time, place, joined: !self.starts });
                        self.starts = false;
                    }
                }
                Event::Empty(empty) => moments.open(empty.local_name().as_ref()),
                _ => {}
            }
        }
    }

    /// Takes the moments of a track, or of a point, which may have no time.
    fn take(&mut self, moments: Moments, line: u64) -> Result<(), RecordingError> {
        let Moments { times, places, .. } = moments;
        if times.len() != places.len() && times.len() + places.len() > 2 {
            let problem = format!("a track of {} times and {} places", times.len(), places.len());
            return Err(RecordingError::NotGpx { file: self.file.to_owned(), line, problem });
        }
        for (time, place) in times.into_iter().zip(places) {
            let (Some((time, text, line)), Some(place)) = (time, place) else { continue };
            self.rises(time, &text, line)?;
            self.points.push(Point { time, place, joined: !self.starts });
            self.starts = false;
        }
        Ok(())
    }

    /// Seconds since 1970.
    fn time(&self, text: &str, line: u64) -> Result<f64, RecordingError> {
        let wrong = || self.wrong("time", text, line, FieldProblem::NotATime);
        utc_seconds(text.trim()).ok_or_else(wrong)
    }

    /// The place of KML: longitude, latitude and, where it is known, height.
    fn coordinates(&self, text: &str, line: u64) -> Result<Geodetic, RecordingError> {
        let mut cells = text.split_whitespace();
        let lon = cells.next().unwrap_or_default();
        let lat = cells.next().unwrap_or_default();
        let place = self.checked([("latitude", lat), ("longitude", lon)], line)?;
        let alt_m = cells.next().map(|height| self.number("height", height, line, 1e5));
        Ok(Geodetic { alt_m: alt_m.transpose()?.unwrap_or(0.0), ..place })
    }

    /// The place that a point's attributes hold.
    fn place(&self, start: &BytesStart<'_>, line: u64) -> Result<Geodetic, RecordingError> {
        let text = |name: &'static str| {
            let attribute = start.try_get_attribute(name).ok().flatten();
            let missing = || self.wrong(name, "", line, FieldProblem::Missing);
            Ok(String::from_utf8_lossy(&attribute.ok_or_else(missing)?.value).into_owned())
        };
        let lat = text("lat")?;
        let lon = text("lon")?;
        self.checked([("lat", &lat), ("lon", &lon)], line)
    }

    /// The place of a latitude and a longitude, each with its name.
    fn checked(
        &self,
        [(lat_name, lat), (lon_name, lon)]: [(&str, &str); 2],
        line: u64,
    ) -> Result<Geodetic, RecordingError> {
        let lat_deg = self.number(lat_name, lat, line, 180.0)?;
        let lon_deg = self.number(lon_name, lon, line, 180.0)?;
        if lat_deg.abs() > 90.0 {
            let problem = if lon_deg.abs() <= 90.0 {
                FieldProblem::Swapped
            } else {
                FieldProblem::OutOfRange { min: -90.0, max: 90.0 }
            };
            return Err(self.wrong(lat_name, lat, line, problem));
        }
        if lat_deg.abs() < f64::MIN_POSITIVE && lon_deg.abs() < f64::MIN_POSITIVE {
            let names = format!("{lat_name}, {lon_name}");
            return Err(self.wrong(&names, &format!("{lat}, {lon}"), line, FieldProblem::NoFix));
        }
        Ok(Geodetic { lat_deg, lon_deg, alt_m: 0.0 })
    }

    fn number(
        &self,
        field: &str,
        text: &str,
        line: u64,
        limit: f64,
    ) -> Result<f64, RecordingError> {
        let value: f64 = text
            .trim()
            .parse()
            .map_err(|_| self.wrong(field, text, line, FieldProblem::NotANumber))?;
        if (-limit..=limit).contains(&value) {
            return Ok(value);
        }
        let problem = FieldProblem::OutOfRange { min: -limit, max: limit };
        Err(self.wrong(field, text, line, problem))
    }

    /// Refuses a point earlier than the one before.
    fn rises(&self, time: f64, text: &str, line: u64) -> Result<(), RecordingError> {
        let last = self.points.last().map_or(f64::NEG_INFINITY, |point| point.time);
        if time < last {
            let problem = FieldProblem::Backwards { by_s: last - time };
            return Err(self.wrong("time", text, line, problem));
        }
        Ok(())
    }

    fn wrong(&self, field: &str, value: &str, line: u64, problem: FieldProblem) -> RecordingError {
        RecordingError::Field {
            file: self.file.to_owned(),
            line,
            column: field.to_owned(),
            value: value.chars().take(60).collect(),
            problem,
        }
    }

    fn broken(&self, line: u64, source: &quick_xml::Error) -> RecordingError {
        RecordingError::NotGpx { file: self.file.to_owned(), line, problem: source.to_string() }
    }
}
