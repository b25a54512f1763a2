//! Poses of a receiver over time, and interpolation between rows.

use std::{fs, io::Write, path::Path};

use foxhunt_core::angle;

use super::{
    Column, FieldProblem, RecordingError,
    decompress::decompressed,
    table::{Row, Table},
    utc::{utc, utc_seconds},
};

/// Columns that a pose may have besides its time.
const COLUMNS: [Column; 12] = [
    Column::LatDeg,
    Column::LonDeg,
    Column::AltM,
    Column::AltAglM,
    Column::EastM,
    Column::NorthM,
    Column::UpM,
    Column::HeadingDegCompass,
    Column::PitchDeg,
    Column::RollDeg,
    Column::BoresightDegCompass,
    Column::AntennaDeg,
];

/// Between two poses an antenna turns by less than this many degrees, else it is not known which
/// way.
const MOST_TURN_DEG: f64 = 90.0;

/// A receiver hovers while it is within this many metres of where it came to.
const HOVER_M: f64 = 5.0;

/// A log of the poses of a receiver and its antenna. Its clock may differ from that of the levels.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseLog {
    columns: Vec<Column>,
    time: Column,
    /// In the order of time.
    poses: Vec<(f64, Pose)>,
}

#[derive(Clone, Debug, PartialEq)]
struct Pose {
    /// Values of the columns, in their order.
    values: Vec<f64>,
    /// The pose with which the hover that this one belongs to began.
    hover: usize,
}

/// A level that was received at a time of the receiver's clock.
#[derive(Clone, Debug, PartialEq)]
pub struct TimedLevel {
    /// Time of reception, in seconds.
    pub time_s: f64,
    /// Level, in dBm or dB.
    pub level_db: f64,
    /// Name of the beacon, where that is known.
    pub beacon: Option<String>,
}

impl PoseLog {
    /// Reads a CSV file with the columns of our own format: `time_s` or `time_utc`, and any of
    /// place, heading and boresight.
    ///
    /// # Errors
    ///
    /// [`RecordingError`] with file, line, column and value: a time that is missing or does not
    /// rise, a cell that is no number in its range.
    pub fn read(path: &Path) -> Result<Self, RecordingError> {
        let file = path.display().to_string();
        let bytes =
            fs::read(path).map_err(|source| RecordingError::Read { file: file.clone(), source })?;
        Self::parse(&decompressed(&bytes, &file)?, &file)
    }

    /// Reads poses from bytes; `file` is their name in errors.
    ///
    /// # Errors
    ///
    /// As [`Self::read`].
    pub fn parse(bytes: &[u8], file: &str) -> Result<Self, RecordingError> {
        let mut table = Table::open(file, bytes, None, &[])?;
        let (time, time_index) = match table.index_of(Column::TimeUtc.name())? {
            Some(index) => (Column::TimeUtc, index),
            None => (Column::TimeS, table.require_one(Column::TimeS.name(), "poses")?),
        };
        let mut columns = Vec::new();
        let mut indices = Vec::new();
        for column in COLUMNS {
            if let Some(index) = table.index_of(column.name())? {
                columns.push(column);
                indices.push(index);
            }
        }
        let on_earth = columns.contains(&Column::LatDeg) || columns.contains(&Column::LonDeg);
        let place = match on_earth {
            true => [Column::LatDeg, Column::LonDeg],
            false => [Column::EastM, Column::NorthM],
        };
        for needed in place {
            if !columns.contains(&needed) {
                return Err(table.missing_column(needed.name(), "poses"));
            }
        }
        let mut log = Self { columns, time, poses: Vec::new() };
        while let Some(row) = table.next()? {
            let at = number(&row, time, time_index)?;
            let last = log.poses.last().map(|(last, _)| *last);
            if let Some(by_s) = last.map(|last| last - at).filter(|by_s| *by_s >= 0.0) {
                let problem = FieldProblem::Backwards { by_s };
                return Err(row.wrong(time.name(), row.cell(time_index), problem));
            }
            let cells = log.columns.iter().zip(&indices);
            let values: Result<Vec<f64>, _> =
                cells.map(|(column, index)| number(&row, *column, *index)).collect();
            log.push(at, values?);
        }
        Ok(log)
    }

    fn push(&mut self, time: f64, values: Vec<f64>) {
        let mut pose = Pose { values, hover: self.poses.len() };
        if let Some((_, before)) = self.poses.last()
            && let Some((_, first)) = self.poses.get(before.hover)
            && self.distance_m(first, &pose) <= HOVER_M
        {
            pose.hover = before.hover;
        }
        self.poses.push((time, pose));
    }

    fn value(&self, pose: &Pose, column: Column) -> Option<f64> {
        let index = self.columns.iter().position(|of| *of == column)?;
        pose.values.get(index).copied()
    }

    /// Horizontal distance of two poses in metres, on a sphere where they are on the Earth.
    fn distance_m(&self, a: &Pose, b: &Pose) -> f64 {
        const METRES_PER_DEG: f64 = 111_195.0;
        let of = |pose, column| self.value(pose, column).unwrap_or(0.0);
        let difference = |column| of(b, column) - of(a, column);
        let latitude = of(a, Column::LatDeg).to_radians();
        let east = angle::wrap(difference(Column::LonDeg).to_radians()).to_degrees();
        let east = east * METRES_PER_DEG * libm::cos(latitude) + difference(Column::EastM);
        let north = difference(Column::LatDeg) * METRES_PER_DEG + difference(Column::NorthM);
        libm::hypot(east, north)
    }

    /// The values of the columns at a time of the poses' clock, on a straight line, and the short
    /// way round, between the poses about it; [`None`] where these are more than `gap_s` apart or
    /// an antenna turned by 90° or more between them.
    fn at(&self, time: f64, gap_s: f64) -> Option<Vec<f64>> {
        let (from, to, share) = surrounding(&self.poses, time, gap_s)?;
        let values = self.columns.iter().zip(from.values.iter().zip(&to.values));
        values.map(|(column, (from, to))| between(*column, *from, *to, share)).collect()
    }

    /// Returns true if the poses have the boresights of an antenna.
    pub(super) fn has_boresight(&self) -> bool {
        self.columns.contains(&Column::BoresightDegCompass)
    }

    /// Returns the antenna's direction at a time of the poses' clock, in radians clockwise from
    /// North, and the hover; [`None`] as for the pose, and on the way from one hover to the next.
    pub(super) fn boresight(&self, time: f64, gap_s: f64) -> Option<(f64, usize)> {
        let (from, to, share) = surrounding(&self.poses, time, gap_s)?;
        let of = |pose| self.value(pose, Column::BoresightDegCompass);
        let degrees = between(Column::BoresightDegCompass, of(from)?, of(to)?, share)?;
        (from.hover == to.hover).then(|| (degrees.to_radians(), from.hover))
    }

    /// Returns the 0.9 quantile of the antenna's speed while it turns, in radians a second.
    pub(super) fn turn_rate(&self) -> f64 {
        const STILL_DEG_PER_S: f64 = 0.1;
        let rate = |pair: &[(f64, Pose)]| {
            let [(from, a), (to, b)] = pair else { return None };
            let of = |pose| self.value(pose, Column::BoresightDegCompass).map(f64::to_radians);
            Some(angle::distance(of(a)?, of(b)?).abs() / (to - from))
        };
        let rates = self.poses.windows(2).filter_map(rate);
        let mut rates: Vec<f64> = rates.filter(|r| *r > STILL_DEG_PER_S.to_radians()).collect();
        rates.sort_by(f64::total_cmp);
        rates.get(rates.len() * 9 / 10).copied().unwrap_or(0.0)
    }

    /// Writes each level with the pose at its time as a recording in our own format; `offset_s` is
    /// added to the times of the levels. Returns how many rows there are, and how many levels were
    /// left out since there is no pose within `gap_s` on both sides of them.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Write`] when `out` fails.
    pub fn join(
        &self,
        levels: &[TimedLevel],
        offset_s: f64,
        gap_s: f64,
        is_calibrated: bool,
        out: impl Write,
    ) -> Result<[u64; 2], RecordingError> {
        let failed = |error: csv::Error| RecordingError::Write { source: error.into() };
        let level = if is_calibrated { Column::RssDbm } else { Column::RssDb };
        let names = levels.iter().any(|of| of.beacon.is_some()).then_some(Column::Beacon);
        let columns = names.into_iter().chain([self.time, level]).chain(self.columns.clone());
        let mut csv = csv::Writer::from_writer(out);
        csv.write_record(columns.map(Column::name)).map_err(failed)?;
        let [mut rows, mut left_out] = [0, 0];
        for TimedLevel { time_s, level_db, beacon } in levels {
            let time = time_s + offset_s;
            let Some(pose) = self.at(time, gap_s) else {
                left_out += 1;
                continue;
            };
            let name = names.map(|_| beacon.clone().unwrap_or_default());
            let time = match self.time {
                Column::TimeUtc => utc(time),
                _ => time.to_string(),
            };
            let numbers = [*level_db].into_iter().chain(pose).map(|number| number.to_string());
            let cells = name.into_iter().chain([time]).chain(numbers);
            csv.write_record(cells).map_err(failed)?;
            rows += 1;
        }
        csv.flush().map_err(|source| RecordingError::Write { source })?;
        Ok([rows, left_out])
    }
}

/// The number of a cell, in seconds since 1970 where it is a time in UTC.
fn number(row: &Row, column: Column, index: usize) -> Result<f64, RecordingError> {
    let cell = row.cell(index);
    let wrong = |problem| row.wrong(column.name(), cell, problem);
    if column == Column::TimeUtc {
        return utc_seconds(cell.trim()).ok_or_else(|| wrong(FieldProblem::NotATime));
    }
    let value: f64 = cell.trim().parse().map_err(|_| wrong(FieldProblem::NotANumber))?;
    match value {
        _ if !value.is_finite() => Err(wrong(FieldProblem::NotFinite)),
        _ if !column.admits(value) => Err(wrong(FieldProblem::NotAMeasurement)),
        _ => Ok(value),
    }
}

/// A value between two; angles go the short way round, and are not known for an antenna where that
/// is 90° or more.
fn between(column: Column, from: f64, to: f64, share: f64) -> Option<f64> {
    let is_longitude = column == Column::LonDeg;
    if !(column.is_angle() || is_longitude) {
        return Some(from + share * (to - from));
    }
    let turn = angle::wrap((to - from).to_radians()).to_degrees();
    let value = from + share * turn;
    let least = if is_longitude { -180.0 } else { 0.0 };
    let is_known = is_longitude || turn.abs() < MOST_TURN_DEG;
    is_known.then(|| (value - least).rem_euclid(360.0) + least)
}

/// The values before and after a time in rows by rising time, and the position of the time between
/// them, from 0 at the first to 1 at the second; `None` outside the rows, and if the two are more
/// than `gap_s` apart. At the time of a row both are that row.
pub(crate) fn surrounding<T>(rows: &[(f64, T)], time: f64, gap_s: f64) -> Option<(&T, &T, f64)> {
    let after = rows.partition_point(|(at, _)| *at < time);
    let (later, to) = rows.get(after)?;
    if *later <= time {
        return Some((to, to, 0.0));
    }
    let (earlier, from) = rows.get(after.checked_sub(1)?)?;
    let gap = later - earlier;
    (gap <= gap_s).then(|| (from, to, (time - earlier) / gap))
}

#[cfg(test)]
mod tests {
    use approx::abs_diff_eq;

    use super::*;

    #[test]
    fn a_pose_is_between_its_neighbours() {
        let csv = "time_s,lat_deg,lon_deg,boresight_deg_compass\n\
                   0,1,179.5,350\n2,2,-179.5,30\n9,2,0,0\n10,2,0,120\n";
        let log = PoseLog::parse(csv.as_bytes(), "poses.csv").expect("poses");
        let pose = log.at(1.0, 2.0).expect("a pose");
        for (value, expected) in pose.iter().zip([1.5, -180.0, 10.0]) {
            assert!(abs_diff_eq!(*value, expected, epsilon = 1e-9), "{pose:?}");
        }
        // A gap, before the first, after the last, a turn of 120° in one step.
        for time in [5.0, -1.0, 10.5, 9.5] {
            assert_eq!(log.at(time, 2.0), None, "{time}");
        }
    }

    #[test]
    fn hovers_begin_where_the_receiver_came_to() {
        let csv = "time_s,lat_deg,lon_deg,boresight_deg_compass\n\
                   0,60,10,0\n1,60,10.00008,0\n2,60,10.0001,0\n3,60.00004,10.0001,0\n";
        let log = PoseLog::parse(csv.as_bytes(), "poses.csv").expect("poses");
        let hovers: Vec<usize> = log.poses.iter().map(|(_, pose)| pose.hover).collect();
        // 4.4 m, 5.6 m, 4.4 m from the third.
        assert_eq!(hovers, [0, 0, 2, 2]);
        assert_eq!(log.boresight(1.5, 2.0), None, "on the way");
        assert_eq!(log.boresight(2.5, 2.0), Some((0.0, 2)));
    }

    #[test]
    fn a_joined_level_is_a_row_of_our_own_format() {
        let csv = "time_utc,east_m,north_m\n2026-11-24 10:00:00,0,0\n2026-11-24 10:00:02,4,0\n";
        let log = PoseLog::parse(csv.as_bytes(), "poses.csv").expect("poses");
        let level = |time_s, beacon: Option<&str>| TimedLevel {
            time_s,
            level_db: -60.5,
            beacon: beacon.map(str::to_owned),
        };
        let levels = [level(0.5, Some("fox")), level(3.0, None)];
        let begin = utc_seconds("2026-11-24T10:00:00Z").expect("a time");
        let mut text = Vec::new();
        assert_eq!(log.join(&levels, begin, 2.0, true, &mut text).expect("written"), [1, 1]);
        let expected = "beacon,time_utc,rss_dbm,east_m,north_m\n\
                        fox,2026-11-24 10:00:00.500,-60.5,1,0\n";
        assert_eq!(String::from_utf8(text).expect("UTF-8"), expected);
    }

    #[test]
    fn wrong_cells_are_named() {
        let wrong = [
            ("1,0,0\n1,0,0\n", "line 3, time_s"),
            ("1,zero,0\n", "line 2, east_m"),
            ("1,0,inf\n", "line 2, north_m"),
            ("1,1e9,0\n", "line 2, east_m"),
        ];
        for (rows, named) in wrong {
            let csv = format!("time_s,east_m,north_m\n{rows}");
            let error = PoseLog::parse(csv.as_bytes(), "poses.csv").expect_err("refused");
            assert!(error.to_string().contains(named), "{error}");
        }
        for header in ["time_s,east_m", "time_s,lat_deg,east_m,north_m", "east_m,north_m"] {
            assert!(PoseLog::parse(header.as_bytes(), "poses.csv").is_err(), "{header}");
        }
    }

    #[test]
    fn the_rows_before_and_after_are_found() {
        let rows = [(0.0, 'a'), (2.0, 'b'), (9.0, 'c')];
        assert_eq!(surrounding(&rows, 0.5, 2.0), Some((&'a', &'b', 0.25)));
        assert_eq!(surrounding(&rows, 2.0, 2.0), Some((&'b', &'b', 0.0)));
        for time in [-0.1, 5.0, 9.1, f64::NAN] {
            assert_eq!(surrounding(&rows, time, 2.0), None, "{time}");
        }
    }
}
