use std::collections::BTreeMap;

use super::rows::{Converted, Made, RowsWriter};

/// Lines in which a file is recognised.
const LOOKED_AT: usize = 5000;

/// Words of the line above detections; those with a place have two more.
const NAMES: [&str; 7] = ["Date", "Time", "Channel", "Tag", "ID", "Antenna", "Power"];

/// The identity that noise has.
const NOISE: &str = "999";

/// Decibels in a unit of power, which counts from 0 to 255: 10 of gain more were some 40 units more
/// (MotusWTS/motusServer, `readDTA.R`).
const DB_OF_UNIT: f64 = 0.25;

/// Coded tags in a text file of a Lotek receiver (SRX, `.DTA`), as Motus reads it
/// (MotusWTS/motusServer, `readDTA.R` and `ltDTAregex.R`).
///
/// `06/05/15  12:43:10.6489  0  393  A1+A2  131` is a detection on channel 0 of the tag 393, in the
/// order month, day, year. Tables of channels with their frequencies stand between.
pub(super) fn convert(text: &str) -> Option<csv::Result<Converted>> {
    let mut lines = text.lines().take(LOOKED_AT);
    let is_one = lines.any(|line| line.split_whitespace().take(NAMES.len()).eq(NAMES));
    (is_one && text.lines().any(|line| Detection::of(line).is_some())).then(|| table(text))
}

fn table(text: &str) -> csv::Result<Converted> {
    let has_places = text.lines().filter_map(Detection::of).any(|of| of.place.is_some());
    let mut header = vec!["time_utc", "beacon", "drone", "rss_db"];
    header.extend(has_places.then_some(["lat_deg", "lon_deg"]).into_iter().flatten());
    let mut rows = RowsWriter::new(&header);
    let mut frequencies: BTreeMap<&str, &str> = BTreeMap::new();
    let mut in_channels = false;
    let mut noise = 0_u64;
    for (number, line) in (1..).zip(text.lines()) {
        let words: Vec<&str> = line.split_whitespace().collect();
        // A later table holds for the detections behind it.
        match words.as_slice() {
            ["CHANNEL", "FREQUENCY", ..] => {
                in_channels = true;
                frequencies.clear();
            }
            [channel, frequency, ..] if in_channels && is_number(channel) => {
                frequencies.insert(*channel, *frequency);
            }
            _ => in_channels = false,
        }
        let Some(found) = Detection::of(line) else { continue };
        if found.tag == NOISE {
            noise += 1;
            continue;
        }
        let beacon = match frequencies.get(found.channel) {
            Some(frequency) => format!("{frequency} {}", found.tag),
            None => found.tag.to_owned(),
        };
        let level = (DB_OF_UNIT * found.power).to_string();
        let mut cells = vec![found.time.as_str(), &beacon, found.antenna, &level];
        let place = found.place.unwrap_or_default();
        cells.extend(has_places.then_some(place).into_iter().flatten());
        rows.write(number, &cells)?;
    }
    let what = format!(
        "detections of a Lotek receiver; a beacon is a frequency and a tag, a drone an antenna, \
         and a unit of power counts as {DB_OF_UNIT} dB; noise, which has the tag {NOISE}, is \
         left out: {noise}"
    );
    Ok(Converted { table: Made::Rows(rows.finish()?), what })
}

fn is_number(word: &str) -> bool {
    !word.is_empty() && word.bytes().all(|byte| byte.is_ascii_digit())
}

/// A tag that was received.
struct Detection<'l> {
    /// In the order year, month, day.
    time: String,
    channel: &'l str,
    tag: &'l str,
    antenna: &'l str,
    power: f64,
    /// Latitude and longitude.
    place: Option<[&'l str; 2]>,
}

impl<'l> Detection<'l> {
    fn of(line: &'l str) -> Option<Self> {
        if !line.trim_start().starts_with(|c: char| c.is_ascii_digit()) {
            return None;
        }
        let mut words = line.split_whitespace();
        let date = words.next()?;
        let clock = words.next().filter(|clock| clock.split(':').count() == 3)?;
        let [channel, tag] = [words.next()?, words.next()?];
        let antenna = words.next()?;
        let power = words.next()?.parse().ok()?;
        let place = words.next().zip(words.next()).map(<[&str; 2]>::from);
        let mut parts = date.split('/');
        let [month, day, year] = [parts.next()?, parts.next()?, parts.next()?];
        let are_digits = [month, day, year].iter().all(|part| part.len() == 2 && is_number(part));
        let time = format!("20{year}-{month}-{day} {clock}");
        let is_whole = are_digits && parts.next().is_none() && is_number(channel) && is_number(tag);
        is_whole.then_some(Self { time, channel, tag, antenna, power, place })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tables as Motus expects them.
    const FILE: &str = "SRX800 Receiver Information:\n\
        Receiver S/N: 2345\n\n\
        Active scan_table:\n\
        CHANNEL  FREQUENCY  STATUS  TYPE\n\
        0        166.380    ON      CODED\n\
        2        166.420    ON      CODED\n\n\
        Antenna   Gain\n\
        A1        80\n\n\
        ID Only Records:\n\n\
        \x20 Date      Time            Channel  Tag ID  Antenna     Power\n\
        06/21/26  14:03:10.6489         0     393    A1+A2+A3+A4     131\n\
        06/21/26  14:03:11.1000         0     999    A1              200\n\n\
        ID + GPS Positions:\n\n\
        \x20 Date      Time            Channel  Tag ID  Antenna     Power  Latitude   Longitude\n\
        06/21/26  14:03:15.5000         2      17    A1              140   48.20010   16.37000\n";

    #[test]
    fn detections_are_rows_with_the_frequency_of_their_channel() {
        let Converted { table, what } = convert(FILE).expect("one").expect("in memory");
        let Made::Rows(rows) = table else { panic!("rows") };
        let csv = String::from_utf8(rows.csv).expect("text").replace('"', "");
        assert_eq!(
            csv,
            "2026-06-21 14:03:10.6489,166.380 393,A1+A2+A3+A4,32.75,,\n\
             2026-06-21 14:03:15.5000,166.420 17,A1,35,48.20010,16.37000\n"
        );
        assert_eq!(rows.lines, [15, 21]);
        assert!(what.ends_with("is left out: 1"), "{what}");
        // Without the part with places there is no column for them.
        let (first, _) = FILE.split_once("ID + GPS").expect("two parts");
        let Made::Rows(rows) = convert(first).expect("one").expect("in memory").table else {
            panic!("rows")
        };
        assert_eq!(rows.header, ["time_utc", "beacon", "drone", "rss_db"]);
    }

    #[test]
    fn others_are_left_alone() {
        for other in [
            "",
            "Date,Time,Channel,Tag ID,Antenna,Power\n06/21/26,14:03:10,0,393,A1,131\n",
            "Date Time Channel Tag ID Antenna Power\n",
            "06/21/26  14:03:10.6489  0  393  A1  131\n",
        ] {
            assert!(convert(other).is_none(), "{other}");
        }
    }
}
