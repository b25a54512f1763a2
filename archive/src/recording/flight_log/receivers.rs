//! Logs of GNSS receivers: of Google's GNSS Logger for Android, and sentences of NMEA 0183.
//!
//! The former has lines of several kinds, whose columns are named by comments at the begin. The
//! latter are as a logger writes them, perhaps each behind something of the logger's own.

use std::collections::BTreeMap;

use chrono::NaiveDate;
use foxhunt_wire::{
    geodesy::Geodetic,
    nmea::{Malformed, Sentence},
};

use super::log::{Fix, Levels, Log};

/// Bytes in which the comment that names a fix's columns is looked for.
const LOGGER_LOOKED_AT: usize = 1 << 15;

/// Providers of places, the best first, under the names of earlier and of later versions.
const PROVIDERS: [[&str; 2]; 2] = [["gps", "gps"], ["flp", "fused"]];

/// Columns of a fix, by their places in a line.
struct Columns {
    provider: usize,
    lat: usize,
    lon: usize,
    alt: usize,
    time_ms: usize,
}

impl Columns {
    /// The columns that a comment names; `None` for any other line.
    fn of(line: &str) -> Option<Self> {
        let named = line.strip_prefix('#')?.trim_start();
        if !named.starts_with("Fix,") {
            return None;
        }
        let names: Vec<String> = named.split(',').map(|name| name.trim().to_lowercase()).collect();
        let at = |begin: &str| names.iter().position(|name| name.starts_with(begin));
        // (UTC)TimeInMs before 2021, UnixTimeMillis since.
        let is_time = |name: &String| name.contains("unixtime") || name.contains("timeinms");
        Some(Self {
            provider: at("provider")?,
            lat: at("latitude")?,
            lon: at("longitude")?,
            alt: at("altitude")?,
            time_ms: names.iter().position(is_time)?,
        })
    }
}

/// Returns true for a file whose comments name the columns of a fix.
pub(super) fn is_gnss_logger(bytes: &[u8]) -> bool {
    let begin = bytes.get(..LOGGER_LOOKED_AT).unwrap_or(bytes);
    let is_comment = |line: &&[u8]| line.starts_with(b"#");
    let mut comments = begin.split(|byte| *byte == b'\n').filter(is_comment);
    comments.any(|line| Columns::of(&String::from_utf8_lossy(line)).is_some())
}

/// Reads the places of the best provider that has any. Damaged lines are left out.
pub(super) fn read_gnss_logger(bytes: &[u8]) -> Result<Log, String> {
    let text = String::from_utf8_lossy(bytes);
    let mut columns = None;
    let mut providers: BTreeMap<String, Vec<Fix>> = BTreeMap::new();
    for line in text.lines() {
        if let Some(named) = Columns::of(line) {
            columns = Some(named);
        }
        let Some(columns) = columns.as_ref().filter(|_| line.starts_with("Fix,")) else { continue };
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        let number = |at: usize| cells.get(at)?.parse::<f64>().ok();
        let place = number(columns.lat).zip(number(columns.lon));
        let Some(((lat_deg, lon_deg), time_ms)) = place.zip(number(columns.time_ms)) else {
            continue;
        };
        let provider = cells.get(columns.provider).map(|name| name.to_lowercase());
        let of = providers.entry(provider.unwrap_or_default()).or_default();
        // A place without a height has that of the place before.
        let before_m = of.last().map_or(0.0, |fix| fix.place.alt_m);
        let alt_m = number(columns.alt).unwrap_or(before_m);
        of.push(Fix { time: 1e-3 * time_ms, place: Geodetic { lat_deg, lon_deg, alt_m } });
    }
    let best = PROVIDERS.iter().flatten().find(|name| providers.contains_key(**name)).copied();
    let fixes = match best {
        Some(name) => providers.remove(name).unwrap_or_default(),
        None => providers.into_values().flatten().collect(),
    };
    Ok(Log { fixes, levels: Levels::default() })
}

/// Bytes in which sentences are looked for, and lines.
const NMEA_LOOKED_AT: usize = 4096;
const LINES: usize = 20;

/// Longest timestamp of a logger before a sentence, in bytes.
const MOST_STAMP: usize = 40;

/// Sentences of receivers' logs.
const KINDS: [&str; 9] = ["RMC", "GGA", "GNS", "GSA", "GSV", "GLL", "VTG", "ZDA", "GST"];

/// Seconds of a day.
const DAY_S: f64 = 86_400.0;

/// Returns true for a file that has a sentence in most of its first lines.
pub(super) fn is_nmea(bytes: &[u8]) -> bool {
    let begin = match bytes.get(..NMEA_LOOKED_AT) {
        // Without the line that is cut.
        Some(begin) => begin.rsplitn(2, |byte| *byte == b'\n').last().unwrap_or(begin),
        None => bytes,
    };
    let begin = String::from_utf8_lossy(begin);
    let mut lines = 0;
    let mut sentences = 0;
    for line in begin.lines().filter(|line| !line.trim().is_empty()).take(LINES) {
        lines += 1;
        let sentence = sentence(line).and_then(|text| Sentence::parse(text).ok());
        sentences += usize::from(sentence.is_some_and(|own| KINDS.contains(&own.kind())));
    }
    2 * sentences > lines
}

/// Reads the places of RMC and GGA, with the date of RMC. Damaged sentences are left out, and GGA
/// before the first date.
pub(super) fn read_nmea(bytes: &[u8]) -> Result<Log, String> {
    let text = String::from_utf8_lossy(bytes);
    let mut track = Track::default();
    for line in text.lines() {
        let parsed = sentence(line).map(Sentence::parse);
        let Some(Ok(sentence)) = parsed else { continue };
        // A field that cannot be read refuses its sentence.
        let _ = track.take(&sentence);
    }
    match track.day_s {
        Some(_) => Ok(Log { fixes: track.fixes, levels: Levels::default() }),
        None => Err("no RMC sentence has a date, so that its times are not in UTC".to_owned()),
    }
}

/// The sentence that a line begins with, or has behind a timestamp, and that ends the line.
fn sentence(line: &str) -> Option<&str> {
    let (stamp, _) = line.split_once('$')?;
    let is_of_stamp = |byte: u8| byte.is_ascii_digit() || b" \t:.,;-/+TZ[]()".contains(&byte);
    if stamp.len() > MOST_STAMP || !stamp.bytes().all(is_of_stamp) {
        return None;
    }
    let sentence = line.get(stamp.len()..)?.trim_end();
    let (_, digits) = sentence.rsplit_once('*')?;
    (digits.len() == 2).then_some(sentence)
}

/// Places that were read.
#[derive(Default)]
struct Track {
    /// Beginning of the day in seconds since 1970, by the last date.
    day_s: Option<f64>,
    /// Time of that day when the date was read.
    dated_s: f64,
    height_m: Option<f64>,
    fixes: Vec<Fix>,
}

impl Track {
    fn take(&mut self, sentence: &Sentence<'_>) -> Result<(), Malformed> {
        let Some(time_s) = sentence.time(0)? else { return Ok(()) };
        match sentence.kind() {
            "RMC" if sentence.text(1) == Some("A") => {
                let spot = sentence.spot(2)?;
                let day_s = sentence.text(8).and_then(day_s).ok_or(Malformed::Field)?;
                self.day_s = Some(day_s);
                self.dated_s = time_s;
                self.add(time_s, spot);
            }
            "GGA" if sentence.count(5)?.is_none_or(|quality| quality > 0) => {
                let spot = sentence.spot(1)?;
                let height_m = sentence.number(8)?;
                if let (None, Some(first_m)) = (self.height_m, height_m) {
                    // Places before the first height have that one.
                    self.fixes.iter_mut().for_each(|fix| fix.place.alt_m = first_m);
                }
                self.height_m = height_m.or(self.height_m);
                self.add(time_s, spot);
            }
            _ => {}
        }
        Ok(())
    }

    fn add(&mut self, time_s: f64, spot: Option<(f64, f64)>) {
        let Some(((lat_deg, lon_deg), day_s)) = spot.zip(self.day_s) else { return };
        // Past midnight before the next date.
        let days = if time_s < self.dated_s - 0.5 * DAY_S { DAY_S } else { 0.0 };
        let time = day_s + days + time_s;
        let place = Geodetic { lat_deg, lon_deg, alt_m: self.height_m.unwrap_or(0.0) };
        match self.fixes.last_mut().filter(|last| (last.time - time).abs() < 1e-6) {
            // The other sentence of the same moment, and perhaps the one with the height.
            Some(last) => last.place = place,
            None => self.fixes.push(Fix { time, place }),
        }
    }
}

/// Beginning of a day `ddmmyy` in seconds since 1970.
fn day_s(text: &str) -> Option<f64> {
    let number: u32 = text.parse().ok().filter(|_| text.len() == 6)?;
    let year = number % 100;
    // GPS has been there since 1980.
    let year = i32::try_from(if year < 80 { 2000 + year } else { 1900 + year }).ok()?;
    let date = NaiveDate::from_ymd_opt(year, number / 100 % 100, number / 10_000)?;
    #[expect(clippy::cast_precision_loss, reason = "far below 2^53")]
    let seconds = date.and_hms_opt(0, 0, 0)?.and_utc().timestamp() as f64;
    Some(seconds)
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;

    use super::*;

    /// Comments as the program writes them, of which most are of other kinds of lines.
    const LOG: &str = "# \n# Header Description:\n# \n# Version: v3.0.6.4 Platform: 14\n# \n\
        # Raw,utcTimeMillis,TimeNanos,LeapSecond,Svid,ConstellationType,Cn0DbHz\n# \n\
        # Fix,Provider,LatitudeDegrees,LongitudeDegrees,AltitudeMeters,SpeedMps,AccuracyMeters,\
        BearingDegrees,UnixTimeMillis,SpeedAccuracyMps,BearingAccuracyDegrees,\
        elapsedRealtimeNanos,VerticalAccuracyMeters,MockLocation\n# \n\
        Fix,FLP,48.3,16.37,230.0,1.2,3.0,90.0,1782050580000,0.1,5,1,2,0\n\
        Fix,GPS,48.2,16.37,231.5,1.2,3.0,90.0,1782050580000,0.1,5,1,2,0\n\
        Raw,1782050580100,100,18,5,1,42.5\n\
        Fix,GPS,48.2001,16.37,,1.2,3.0,90.0,1782050581000,0.1,5,1,2,0\n\
        Fix,GPS,damaged\nFix,NLP,48.4,16.37,,,30.0,,1782050581000,,,1,,0\n";

    #[test]
    fn fixes_of_the_best_provider_are_the_path() {
        assert!(is_gnss_logger(LOG.as_bytes()));
        let fixes = read_gnss_logger(LOG.as_bytes()).expect("a path").fixes;
        let each: Vec<[f64; 3]> = fixes
            .iter()
            .map(|fix| [fix.time - 1_782_050_580.0, fix.place.lat_deg, fix.place.alt_m])
            .collect();
        assert_eq!(each, [[0.0, 48.2, 231.5], [1.0, 48.2001, 231.5]]);
        // Version 2 names the columns otherwise.
        let older = "# Fix,Provider,Latitude,Longitude,Altitude,Speed,Accuracy,(UTC)TimeInMs\n\
                     Fix,fused,48.2,16.37,230,0,3,1782050580500\n";
        let fixes = read_gnss_logger(older.as_bytes()).expect("a path").fixes;
        assert_abs_diff_eq!(fixes[0].time, 1_782_050_580.5, epsilon = 1e-6);
    }

    #[test]
    fn other_files_are_left_alone() {
        for other in ["", "Fix,GPS,48.2,16.37\n", "# Fix,Provider\n", "# a, b\nlat,lon\n1,2\n"] {
            assert!(!is_gnss_logger(other.as_bytes()), "{other}");
        }
    }

    /// The log is by pynmea2: RMC before GGA, over midnight, one sentence damaged.
    #[test]
    fn places_have_the_date_of_rmc_and_the_height_of_gga() {
        let log = "$GPRMC,235959.00,A,4812.0000,N,01622.2000,E,4.0,90.0,210626,,*04\r\n\
                   $GPGGA,235959.00,4812.0000,N,01622.2000,E,1,10,0.8,230.0,M,43.0,M,,*68\r\n\
                   $GPGGA,000000.00,4812.0006,N,01622.2000,E,1,10,0.8,231.0,M,43.0,M,,*6E\r\n\
                   $GPRMC,000001.00,A,4812.0012,N,01622.2000,E,4.0,90.0,220626,,*04\r\n\
                   $GPRMC,000002.00,A,4812.9912,N,01622.2000,E,4.0,90.0,220626,,*00\r\n";
        assert!(is_nmea(log.as_bytes()));
        assert!(!is_nmea(b"time,lat,lon,rssi\n1,2,3,$4\n"));
        let stamped: String = log.lines().map(|l| format!("12:00:01.250 {l}\n")).collect();
        assert!(is_nmea(stamped.as_bytes()));
        // A log of something else, with sentences in it or with more behind them.
        let other: String = log.lines().map(|l| format!("NMEA,{l},17\n")).collect();
        assert!(!is_nmea(other.as_bytes()));
        let rare = format!("level -71\nlevel -72\n{}", log.lines().next().expect("a line"));
        assert!(!is_nmea(rare.as_bytes()));
        let fixes = read_nmea(log.as_bytes()).expect("a path").fixes;
        assert_eq!(fixes.len(), 3, "{fixes:?}");
        let begin = fixes[0].time;
        // 2026-06-21 23:59:59 UTC.
        assert_abs_diff_eq!(begin, 1_782_086_399.0, epsilon = 1e-6);
        let each: Vec<[f64; 2]> = fixes.iter().map(|f| [f.time - begin, f.place.alt_m]).collect();
        assert_eq!(each, [[0.0, 230.0], [1.0, 231.0], [2.0, 231.0]]);
        assert_abs_diff_eq!(fixes[2].place.lat_deg, 48.200_02, epsilon = 1e-9);
        // The first place stands before the first height.
        let late: Vec<&str> = log.lines().take(1).chain(log.lines().skip(2)).collect();
        let late = read_nmea(late.join("\n").as_bytes()).expect("a path").fixes;
        assert!(late.iter().all(|fix| (fix.place.alt_m - 231.0).abs() < 1e-9), "{late:?}");
        let undated = "$GPGGA,235959.00,4812.0000,N,01622.2000,E,1,10,0.8,230.0,M,43.0,M,,*68\n";
        assert!(read_nmea(undated.as_bytes()).expect_err("no date").contains("date"));
    }
}
