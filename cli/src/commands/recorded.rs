//! Shared parts of the subcommands that read recordings.

use std::{
    fs::{self, File},
    io::Read as _,
    path::{Path, PathBuf},
    str::FromStr,
};

use clap::value_parser;
use foxhunt::{
    core::Remark,
    geodesy::{Geodetic, LocalFrame},
    locate::{ClockSearch, Clocks, ClocksUnknown, FoundOffset},
    recorded::{RecordedError, Selection, only_beacon},
    recording::{
        Band, Column, Mapping, North, ReadOptions, Recording, Rover, TimeFormat, TimeZone, UtmZone,
        utc_seconds,
    },
};

use crate::{
    error::CliError,
    output::{warn, warn_once},
};

/// Options for reading recordings.
#[derive(Debug, clap::Args)]
pub struct Reading {
    /// The format: the name of one that comes with the program, or a TOML file with a column
    /// mapping; recognised by the file's header unless given
    #[arg(long, value_name = "NAME|FILE")]
    format: Option<String>,
    /// The names of the columns of a table without a header, from the first on, separated by
    /// commas; `-` for a column that is not to be read. Common names will do, such as
    /// lat,lon,bearing
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    columns: Vec<String>,
    /// The sheet of a spreadsheet; the first with more than one row unless given
    #[arg(long, value_name = "NAME")]
    sheet: Option<String>,
    /// The levels to read of an autopilot's log that is located alone, such as RADIO_STATUS.rssi,
    /// RAD.RSSI, radio_status.rssi or NAMED_VALUE_FLOAT.name, the element with the level in a GPX
    /// track, or the column with the level in a table of places; needed where it has several. No
    /// file is then taken for a path, but that of --rover
    #[arg(long, value_name = "NAME")]
    level: Option<String>,
    /// The beacon, where the recording holds several
    #[arg(long, value_name = "NAME")]
    beacon: Option<String>,
    /// Format of times whose cells leave it open: 3/4/2026 is in April (`dmy`) or in
    /// March (`mdy`), 46194.58 is a spreadsheet's day (`excel`) or `seconds`
    #[arg(long, value_name = "dmy|mdy|ymd|excel|seconds")]
    time_format: Option<TimeFormat>,
    /// The offset from UTC of dates that state none, such as +02:00, in recordings and in a table
    /// with their path [default: UTC]
    #[arg(long, value_name = "OFFSET", allow_hyphen_values = true)]
    tz: Option<TimeZone>,
    /// The zone of UTM of places in metres, with its band or hemisphere, such as 33U or "33 north";
    /// they are then read as degrees
    #[arg(long, value_name = "ZONE")]
    utm_zone: Option<UtmZone>,
    /// Refuse a file for its first row that cannot be believed, instead of leaving such rows out:
    /// an unreadable cell, no fix, a place that jumps, a clock that runs back, a copy
    #[arg(long)]
    strict: bool,
    /// Levels are written without their sign: 71 stands for -71 dBm
    #[arg(long)]
    negate_levels: bool,
    /// North from which bearings, headings and boresights are counted: `true`, `magnetic` (by the
    /// World Magnetic Model on the day of the recording's time_utc or of --date), `grid` (of UTM),
    /// or a number of degrees east of true North; as the format has it unless given
    #[arg(long, value_name = "true|magnetic|grid|DEG", allow_hyphen_values = true)]
    north: Option<North>,
    /// The day of magnetic North, for recordings without time_utc
    #[arg(long, value_name = "YYYY-MM-DD")]
    date: Option<Day>,
    /// The number of positions in a turn of the antenna
    #[arg(long, value_name = "N", default_value_t = 128, value_parser = value_parser!(u16).range(1..=360))]
    pub positions: u16,
    /// The receiver's floor, in dBm or dB as the levels are: one at or below it is noise, of which
    /// estimators of all receptions at once take but that the true one was not above it; found by
    /// itself where the least levels crowd as noise does
    #[arg(long, value_name = "DBM", allow_hyphen_values = true)]
    floor_dbm: Option<f64>,
    /// The receiver's ceiling, as its levels are: at it the receiver is saturated and the true
    /// level is higher; found by itself where the highest level repeats
    #[arg(long, value_name = "DBM", allow_hyphen_values = true)]
    ceiling_dbm: Option<f64>,
    /// The receiver's path, instead of the recording's own places: a GPX, KML or KMZ file, an
    /// autopilot's log (ArduPilot .bin and .log, PX4 .ulg, MAVLink .tlog), an NMEA log or a table
    /// with dates and places. It may be among the recordings instead
    #[arg(long, value_name = "FILE")]
    rover: Option<PathBuf>,
    /// Seconds added to the times of the measurements for the receiver's path: `rtl_power` and
    /// `hackrf_sweep` write the computer's local time. Or the time in UTC at which the recording's
    /// clock showed 0. In a table with places of its own, seconds by which the clock of the
    /// measurements is behind that of the places. Unless given, an offset of up to two minutes is
    /// found where the levels of one receiver alone show it, beside a path in another file or with
    /// places of their own; 0 leaves the times as they are
    #[arg(long, value_name = "S|UTC", allow_hyphen_values = true, value_parser = offset)]
    clock_offset_s: Option<f64>,
    /// The beacon's frequency in hertz, for recordings of power over frequency
    #[arg(long, value_name = "HZ")]
    frequency_hz: Option<f64>,
    /// Width of the band that is read about --frequency-hz, in hertz; the strongest bin in it
    /// counts. One bin unless given
    #[arg(long, value_name = "HZ", default_value_t = 0.0, requires = "frequency_hz")]
    bandwidth_hz: f64,
}

/// Seconds, or a time in UTC as seconds since 1970.
pub fn offset(text: &str) -> Result<f64, &'static str> {
    let seconds = text.parse().ok().filter(|number: &f64| number.is_finite());
    seconds.or_else(|| utc_seconds(text)).ok_or("neither a number nor a time in UTC")
}

/// A day, as the command line has it: its first second, since 1970.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Day(f64);

impl FromStr for Day {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        utc_seconds(&format!("{text} 00:00:00")).map(Self).ok_or("it must be YYYY-MM-DD")
    }
}

/// Recordings, with the clock of their measurements.
pub struct Clocked {
    pub recordings: Vec<Recording>,
    /// Seconds that are still to be added to the times of the measurements: the whole offset of
    /// the command line where the places are the recordings' own, `None` where it states none; 0
    /// where they are a path's.
    pub offset_s: Option<f64>,
    /// Offset from the clock of a path in another file that was found and taken off.
    pub found: Option<FoundOffset>,
}

/// A place in degrees, as the command line has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LatLon {
    lat_deg: f64,
    lon_deg: f64,
}

impl FromStr for LatLon {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (lat, lon) = text.split_once(',').ok_or("it must be LAT,LON in degrees")?;
        let degrees = |name: &str, text: &str| {
            let text = text.trim();
            text.parse::<f64>().map_err(|_| format!("the {name} {text:?} is not a number"))
        };
        let lat_deg = degrees("latitude", lat)?;
        let lon_deg = degrees("longitude", lon)?;
        // Checked as places out of files are.
        Geodetic::new(lat_deg, lon_deg, 0.0).map_err(|error| error.to_string())?;
        Ok(Self { lat_deg, lon_deg })
    }
}

impl LatLon {
    /// The local frame that begins there, at no height.
    pub fn frame(self) -> LocalFrame {
        let origin = Geodetic { lat_deg: self.lat_deg, lon_deg: self.lon_deg, alt_m: 0.0 };
        LocalFrame::new(origin).expect("it was checked when it was read")
    }

    /// The place in a recording's frame, East and North in metres: [`None`] where the recording
    /// has no place on Earth.
    pub fn in_frame(self, frame: Option<LocalFrame>) -> Option<[f64; 2]> {
        let frame = frame?;
        let alt_m = frame.origin().alt_m;
        let local =
            frame.to_local(&Geodetic { lat_deg: self.lat_deg, lon_deg: self.lon_deg, alt_m });
        Some([local.x, local.y])
    }
}

impl Reading {
    /// Options of the reading; `rover` is the path of the receiver.
    fn options(&self, rover: Option<&Rover>) -> Result<ReadOptions, CliError> {
        let date_s = self.date.map(|Day(first_s)| first_s);
        let mut options = ReadOptions { north: self.north, date_s, ..ReadOptions::default() }
            .with_columns(self.columns.iter().map(|name| name.trim()))
            .with_strict(self.strict)
            .with_negated_levels(self.negate_levels);
        if let Some(sheet) = &self.sheet {
            options = options.with_sheet(sheet);
        }
        if let Some(level) = &self.level {
            options = options.with_level(level);
        }
        if let Some(format) = self.time_format {
            options = options.with_time_format(format);
        }
        if let Some(zone) = self.utm_zone {
            options = options.with_utm_zone(zone);
        }
        if let Some(zone) = self.tz {
            options = options.with_time_zone(zone);
        }
        if let Some(format) = &self.format {
            options = options.with_format(Mapping::find(format).map_err(CliError::input)?);
        }
        if let Some(rover) = rover {
            let offset_s = self.clock_offset_s.unwrap_or(0.0);
            options = options.with_rover(rover.clone(), offset_s).map_err(CliError::input)?;
        }
        if let Some(frequency_hz) = self.frequency_hz {
            let band = Band::new(frequency_hz, self.bandwidth_hz).map_err(CliError::input)?;
            options = options.with_band(band);
        }
        if let Some(floor_dbm) = self.floor_dbm {
            options = options.with_constant(Column::FloorDbm, floor_dbm);
        }
        if let Some(ceiling_dbm) = self.ceiling_dbm {
            options = options.with_constant(Column::CeilingDbm, ceiling_dbm);
        }
        Ok(options)
    }

    /// Reads recordings into one frame, and prints on standard error what was left out. Refuses a
    /// clock's offset without a path beside the recordings.
    pub fn read(&self, files: &[PathBuf]) -> Result<Vec<Recording>, CliError> {
        let unsought = Err("this command does not look for one");
        let Clocked { recordings, offset_s, .. } = self.read_with_clock(files, unsought)?;
        if offset_s.is_some_and(|offset_s| offset_s.abs() > 0.0) {
            return Err(CliError::input(
                "--clock-offset-s is of use for a recording beside its receiver's path (--rover \
                 FILE), and for locate and judge",
            ));
        }
        Ok(recordings)
    }

    /// Reads recordings as [`read`](Self::read) does. Looks for the offset between the clocks of a
    /// recording of levels and of its path in another file with `search`, or says why not.
    pub fn read_with_clock(
        &self,
        files: &[PathBuf],
        search: Result<ClockSearch, &str>,
    ) -> Result<Clocked, CliError> {
        let (tracks, recordings) = self.tracks(files)?;
        let track = self.rover.as_deref().or(tracks.first().copied());
        let times = self.options(None)?;
        let rover = track.map(|track| Rover::read_with(track, &times));
        let rover = rover.transpose().map_err(CliError::input)?;
        let options = self.options(rover.as_ref())?;
        let mut read = Recording::read_all(&recordings, &options).map_err(CliError::input)?;
        let mut found = None;
        if let (Some(rover), None) = (&rover, self.clock_offset_s) {
            (read, found) = self.joined(read, &recordings, rover, options, search)?;
        }
        for recording in &read {
            narrate(recording);
        }
        if self.date.is_some() && read.iter().all(|r| r.north() != North::Magnetic) {
            return Err(CliError::input(
                "--date is of use for magnetic North alone (--north magnetic)",
            ));
        }
        let offset_s = if rover.is_some() { Some(0.0) } else { self.clock_offset_s };
        let span_s = read.iter().map(span_s).fold(0.0, f64::max);
        if let Some(offset_s) = offset_s
            && offset_s.abs() > span_s
        {
            return Err(CliError::input(format!(
                "--clock-offset-s is {offset_s} s, and the recording with places of its own lasts \
                 {span_s:.0} s"
            )));
        }
        Ok(Clocked { recordings: read, offset_s, found })
    }

    /// Looks for the offset of the levels' clock from that of a path in another file. Returns the
    /// recordings, joined with the offset if it was found.
    fn joined(
        &self,
        mut read: Vec<Recording>,
        files: &[&Path],
        rover: &Rover,
        options: ReadOptions,
        search: Result<ClockSearch, &str>,
    ) -> Result<(Vec<Recording>, Option<FoundOffset>), CliError> {
        let path = rover.file();
        let unsought = |why: &str| {
            warn(&format!(
                "  clocks of levels and {path}: their offset is not looked for ({why}); \
                 --clock-offset-s states one"
            ));
        };
        let search = match search {
            Ok(search) => search,
            Err(why) => {
                unsought(why);
                return Ok((read, None));
            }
        };
        let [own] = read.as_slice() else {
            unsought("several recordings stand beside one path");
            return Ok((read, None));
        };
        let Some(clocks) = own.compare_clocks(rover, self.wanted(), &search) else {
            unsought("the recording has bearings or an antenna that turns, or no levels");
            return Ok((read, None));
        };
        let mut found = None;
        if let Clocks::Differ(offset) = clocks {
            // Files may have millions of rows: one reading at a time.
            drop(read);
            let options =
                options.with_rover(rover.clone(), offset.offset_s).map_err(CliError::input)?;
            read = Recording::read_all(files, &options).map_err(CliError::input)?;
            found = Some(offset);
        }
        match clocks_remark(&clocks, path) {
            Ok(remark) => read.iter_mut().for_each(|own| own.add_remark(remark.clone())),
            Err(line) => warn(&line),
        }
        Ok((read, found))
    }

    /// The files that are paths of a receiver, at most one, and the recordings.
    fn tracks<'f>(&self, files: &'f [PathBuf]) -> Result<(Vec<&'f Path>, Vec<&'f Path>), CliError> {
        let files = files.iter().map(PathBuf::as_path);
        // One file alone is a recording, or is refused as one.
        // Logs whose levels are named are recordings.
        if files.len() < 2 || self.rover.is_some() || self.level.is_some() {
            return Ok((Vec::new(), files.collect()));
        }
        // Columns that are mapped or named may be levels, whatever they are called.
        let has_columns = self.format.is_some() || !self.columns.is_empty();
        let (tracks, recordings): (Vec<_>, Vec<_>) =
            files.partition(|file| is_track(file, !has_columns));
        if let [first, second, ..] = tracks.as_slice() {
            return Err(CliError::input(format!(
                "{} and {} are both paths of a receiver; give each recording with its own path: \
                 foxhunt convert LEVELS PATH OUT.csv, then foxhunt locate OUT.csv ...; or name the \
                 levels in them with --level",
                first.display(),
                second.display()
            )));
        }
        if let [track] = tracks.as_slice() {
            warn(&format!("{}: the receiver's path", track.display()));
        }
        Ok((tracks, recordings))
    }

    /// The beacon of the command line.
    pub fn wanted(&self) -> Option<&str> {
        self.beacon.as_deref()
    }

    /// Returns the beacon that is meant: [`None`] for the only one of a recording without names.
    pub fn beacon(&self, recordings: &[Recording]) -> Result<Option<String>, CliError> {
        let selection = self.beacon.clone().map_or(Selection::Only, Selection::Named);
        only_beacon(recordings, &selection).map_err(|error: RecordedError| CliError::input(error))
    }
}

/// Returns true for a file that holds the path of a receiver, which a table is where
/// `table_may_be`; false for one that cannot be read, which is for the reader to say.
fn is_track(file: &Path, table_may_be: bool) -> bool {
    let mut begin = Vec::new();
    let read =
        File::open(file).and_then(|file| file.take(Rover::BEGIN as u64).read_to_end(&mut begin));
    // The directory of an archive, which a KMZ file is, stands at its end.
    if begin.starts_with(b"PK") {
        return fs::read(file).is_ok_and(|whole| Rover::is_track(&whole));
    }
    let is_path = || table_may_be && Rover::is_path_table(&begin);
    read.is_ok() && (Rover::is_track(&begin) || is_path())
}

/// Remark on the clocks of levels and of the receiver's path in another file, or the line that says
/// that they are taken to agree.
fn clocks_remark(clocks: &Clocks, path: &str) -> Result<Remark, String> {
    match clocks {
        Clocks::Differ(FoundOffset { offset_s, interval_s: [from_s, to_s] }) => Ok(Remark::new(
            "clock-taken-off",
            format!(
                "the levels' clock is {offset_s:.1} s behind that of {path} ({from_s:.1} to \
                 {to_s:.1} s, by how the levels fit the path); they are joined with it. \
                 --clock-offset-s states another offset, 0 for none"
            ),
        )),
        Clocks::Unknown(why @ (ClocksUnknown::NotZero { .. } | ClocksUnknown::AtTheEnd { .. })) => {
            Ok(Remark::new(
                "clocks-differ",
                format!(
                    "{why}; the times are taken as they are. State the right offset with \
                 --clock-offset-s"
                ),
            ))
        }
        // The true offset is one of these, and none of them is 0.
        Clocks::Unknown(ClocksUnknown::Open { interval_s: [from_s, to_s] })
            if *from_s > 0.0 || *to_s < 0.0 =>
        {
            Ok(Remark::new(
                "clocks-differ",
                format!(
                    "the levels fit {path} best where their clock is {from_s:.1} to {to_s:.1} s \
                     behind, and do not show by how much; the times are taken as they are. State \
                     the offset with --clock-offset-s, 0 for none"
                ),
            ))
        }
        Clocks::Agree { interval_s: [from_s, to_s] } => Err(format!(
            "  clocks of levels and {path}: they agree, the levels' one is {from_s:.1} to \
             {to_s:.1} s behind"
        )),
        Clocks::Unknown(why) => Err(format!(
            "  clocks of levels and {path}: taken to agree, as the levels do not show an offset \
             ({why}); --clock-offset-s states one"
        )),
    }
}

/// Prints how a recording was read.
fn narrate(recording: &Recording) {
    let kept = recording.records().len();
    warn(&format!(
        "{}: format {}, {kept} of {} rows",
        recording.file(),
        recording.format(),
        recording.rows()
    ));
    for dropped in recording.dropped().iter().filter(|dropped| dropped.rows > 0) {
        warn(&format!("  left out as not {}: {}", dropped.rule, dropped.rows));
    }
    for remark in recording.remarks() {
        warn(&format!("warning: {remark}"));
    }
    if !recording.ignored_columns().is_empty() {
        warn_once(&format!("  columns not used: {}", recording.ignored_columns().join(", ")));
    }
}

/// The refusal of a place in degrees for a file that is in metres.
pub fn no_degrees(flag: &str) -> CliError {
    CliError::input(format!(
        "{flag}: the recording has no places in degrees, so the distance to it is not known; \
         give the columns truth_east_m and truth_north_m instead"
    ))
}

/// Returns the seconds from the first to the last row that has a time.
fn span_s(recording: &Recording) -> f64 {
    let times = || recording.records().iter().filter_map(|record| record.time);
    let first = times().fold(f64::INFINITY, f64::min);
    let last = times().fold(f64::NEG_INFINITY, f64::max);
    (last - first).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_checked() {
        assert_eq!("35.728, -78.697".parse(), Ok(LatLon { lat_deg: 35.728, lon_deg: -78.697 }));
        for (text, part) in [
            ("35.7", "LAT,LON"),
            ("north,1", "\"north\""),
            ("1,NaN", "NaN"),
            ("-111.6,35.2", "swapped"),
            ("0,400", "400"),
        ] {
            let error = text.parse::<LatLon>().expect_err(text);
            assert!(error.contains(part), "{text}: {error}");
        }
    }
}
