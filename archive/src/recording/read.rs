use std::{
    borrow::Cow,
    cell::Cell,
    collections::{BTreeMap, BTreeSet, HashMap, HashSet, hash_map::Entry},
    fs,
    hash::{DefaultHasher, Hash, Hasher},
    io,
    path::Path,
    sync::Arc,
};

use foxhunt_core::Remark;
use foxhunt_wire::geodesy::{Geodetic, LocalFrame};
use nalgebra::Vector3;

use super::{
    Backwards, Column, Dropped, FieldProblem, ReadOptions, Record, Recording, RecordingError,
    Rover, TimeFormat,
    beside::Joined,
    ceiling::{codes, find_ceilings},
    converted::{self, Converted, Made, Rows},
    dates::{Order, order},
    decompress::{check_content, decompressed},
    exclusion::{Cause, Exclusions},
    floor::find_floors,
    formats,
    near_miss::{slip_for, typing_error},
    parse::LeftOut,
    plain,
    plan::{Melted, Origin, Plan},
    reachable::{Jump, jumps, out_of_time},
    row::{Reader, Shared},
    table::{Row, Table, shown, spaced_header, spaces_as_tabs},
    utc::utc,
};

/// The path of standard input.
const STANDARD_INPUT: &str = "-";

/// Rows in which the first cell of a column is looked for.
const FIRST_ROWS: usize = 100;

/// No receiver measures more than this, in dBm; near a transmitter it may be 0 to 20.
const MOST_DBM: f64 = 20.0;

/// Names of the rules that every recording has besides the mapping's.
const NOT_MEASURED: &str = "a measurement";
const NOT_LOCATED: &str = "a position";

impl Recording {
    /// Reads a file, or standard input if the path is `-`.
    ///
    /// # Errors
    ///
    /// [`RecordingError`] names the file, line, column and value.
    pub fn read(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Self, RecordingError> {
        let path = path.as_ref();
        if path.as_os_str() == STANDARD_INPUT {
            return Self::from_reader(io::stdin().lock(), "standard input", options);
        }
        let name = path.display().to_string();
        let bytes =
            fs::read(path).map_err(|source| RecordingError::Read { file: name.clone(), source })?;
        Self::from_bytes(&bytes, &name, path.parent(), options)
    }

    /// Reads files into one frame: the one in the options, or one whose origin is the first
    /// usable position of all. A file with the rows of one before it is left out, with a remark.
    ///
    /// # Errors
    ///
    /// [`RecordingError`] as [`Self::read`]; [`RecordingError::MixedFrames`] for files in metres
    /// and in degrees unless the options give a frame for the metres.
    pub fn read_all<P: AsRef<Path>>(
        paths: impl IntoIterator<Item = P>,
        options: &ReadOptions,
    ) -> Result<Vec<Self>, RecordingError> {
        let mut recordings: Vec<Self> = Vec::new();
        for path in paths {
            let first = recordings.iter().find(|recording| recording.is_located());
            let mut shared = options.clone();
            shared.frame = options.frame.or(first.and_then(|first| first.frame));
            let recording = Self::read(path, &shared)?;
            if let Some(first) = first
                && options.frame.is_none()
                && recording.is_located()
                && first.in_degrees != recording.in_degrees
            {
                let (file, other) = if recording.in_degrees {
                    (first.file.clone(), recording.file)
                } else {
                    (recording.file, first.file.clone())
                };
                return Err(RecordingError::MixedFrames { file, other });
            }
            if let Some(first) = recordings.iter_mut().find(|first| first.is_copy(&recording)) {
                let text =
                    format!("{} has the rows of {}; they count once", recording.file, first.file);
                first.remarks.push(Remark::new(Cause::Copy.code(), text));
                continue;
            }
            recordings.push(recording);
        }
        Ok(recordings)
    }

    /// Returns true if another file has the same rows, at the same times.
    fn is_copy(&self, other: &Self) -> bool {
        /// Fewer rows may be alike by chance.
        const LEAST: usize = 3;
        let alike = |(own, other): (&Record, &Record)| {
            own.time.is_some()
                && own.time == other.time
                && own.rss_dbm == other.rss_dbm
                && own.place == other.place
                && own.beacon == other.beacon
                && own.bearing == other.bearing
                && own.measured == other.measured
        };
        self.records.len() >= LEAST
            && self.records.len() == other.records.len()
            && self.in_utc == other.in_utc
            && self.records.iter().zip(&other.records).all(alike)
    }

    /// Reads from any source; `name` is its name in errors. Files beside it are not looked for.
    ///
    /// # Errors
    ///
    /// [`RecordingError`] as [`Self::read`].
    pub fn from_reader(
        mut reader: impl io::Read,
        name: &str,
        options: &ReadOptions,
    ) -> Result<Self, RecordingError> {
        let mut bytes = Vec::new();
        reader
            .read_to_end(&mut bytes)
            .map_err(|source| RecordingError::Read { file: name.to_owned(), source })?;
        Self::from_bytes(&bytes, name, None, options)
    }

    fn from_bytes(
        bytes: &[u8],
        name: &str,
        folder: Option<&Path>,
        options: &ReadOptions,
    ) -> Result<Self, RecordingError> {
        let mut bytes = decompressed(bytes, name)?;
        let sheet = options.sheet.as_deref();
        let mut taken_for = String::new();
        let mut rows = None;
        let level = options.level.as_deref();
        if let Some(Converted { table, what }) = converted::convert(&bytes, name, sheet, level)? {
            taken_for = what;
            match table {
                Made::Text(text) => bytes = Cow::Owned(text),
                Made::Rows(made) => rows = Some(made),
            }
        }
        if rows.is_none() {
            check_content(&bytes, name)?;
        } else if !options.columns.is_empty() {
            return Err(RecordingError::NamedColumns { file: name.to_owned() });
        }
        let tabs = match options.columns.len() {
            0 if rows.is_none() && options.format.is_none() => {
                spaced_header(&bytes, |names| formats::is_known(names, options))
            }
            columns => spaces_as_tabs(&bytes, columns),
        };
        if let Some(tabs) = tabs {
            bytes = Cow::Owned(tabs);
        }
        let mut options = Cow::Borrowed(options);
        if rows.as_ref().is_some_and(|rows| rows.has_named_level) {
            options.to_mut().level = None;
        }
        let file = File { bytes: &bytes, rows, name, folder };
        let mut recording = file.located(&options).map_err(|error| of_kind(error, &taken_for))?;
        if !taken_for.is_empty() {
            recording.remarks.push(Remark::new("converted", format!("{name}: {taken_for}")));
        }
        Ok(recording)
    }
}

/// Names the kind of a file instead of columns that it does not have.
fn of_kind(error: RecordingError, taken_for: &str) -> RecordingError {
    let what = taken_for.split([';', ',']).next().unwrap_or_default();
    match error {
        RecordingError::Half { file, advice, .. } if !what.is_empty() => {
            RecordingError::HalfOfKind { file, what: what.to_owned(), advice }
        }
        error => error,
    }
}

/// The text of a file, and where it lies.
struct File<'f> {
    bytes: &'f [u8],
    /// Rows of the file, if it has another shape than a table.
    rows: Option<Rows>,
    name: &'f str,
    folder: Option<&'f Path>,
}

/// Result of reading a file.
struct Read {
    recording: Recording,
    /// The first place that can be believed, if the frame's origin cannot.
    better_origin: Option<Geodetic>,
}

impl File<'_> {
    /// Reads the file, about its first place that can be believed.
    fn located(&self, options: &ReadOptions) -> Result<Recording, RecordingError> {
        let astray = Cell::new(None);
        let read = self.read(options, &astray);
        if options.strict || options.frame.is_some() || options.rover.is_some() {
            return read.map(|read| read.recording);
        }
        // The first place is the frame's origin. If it is the wrong one, all the others look wrong.
        let origin = match &read {
            Ok(read) => read.better_origin,
            Err(_) => astray.get(),
        };
        if let Some(frame) = origin.and_then(|origin| LocalFrame::new(origin).ok())
            && let Ok(again) = self.read(&options.clone().with_frame(frame), &Cell::new(None))
        {
            return Ok(again.recording);
        }
        read.map(|read| read.recording)
    }

    /// Opens the table by the header that fits the format, or by the header that is stated.
    fn table(&self, options: &ReadOptions) -> Result<Table<'_>, RecordingError> {
        let name = self.name;
        let bytes = self.bytes;
        if let Some(rows) = &self.rows {
            return Ok(Table::open_rows(name, rows));
        }
        let format = options.format.as_ref();
        let separator = format.and_then(|mapping| mapping.separator);
        if !options.columns.is_empty() {
            return Ok(Table::open_named(name, bytes, separator, &options.columns));
        }
        let known = || {
            let first = Table::open(name, bytes, separator, &[]).ok()?;
            formats::headerless(first.header())
        };
        let names = match format {
            Some(mapping) => mapping.names.as_slice(),
            None => known().map_or(&[][..], |mapping| mapping.names.as_slice()),
        };
        if !names.is_empty() {
            return Table::open(name, bytes, separator, names);
        }
        Table::open_fitting(name, bytes, separator, |header| match format {
            Some(mapping) => mapping.fits(header),
            None => formats::is_known(header, options),
        })
    }

    /// The first cell of a column that is not empty, in a file whose format is to be recognised.
    fn first_cell(&self, options: &ReadOptions, column: &str) -> Option<String> {
        let mut table = self.table(options).ok()?;
        let index = table.index_of(column).ok()??;
        let is_digit = |c: char| c.is_ascii_digit();
        for _ in 0..FIRST_ROWS {
            // A row that cannot be read has no cell.
            let Ok(row) = table.next() else { continue };
            let row = row?;
            // A row without a digit holds units.
            let is_of_values = row.cells().iter().any(|cell| cell.contains(is_digit));
            let cell = row.cell(index).to_owned();
            if is_of_values && !cell.is_empty() {
                return Some(cell);
            }
        }
        None
    }

    /// Returns true if a column has several values, of which one is that of several rows.
    fn holds_groups(&self, options: &ReadOptions, column: &str) -> bool {
        let Ok(mut table) = self.table(options) else { return false };
        let Ok(Some(index)) = table.index_of(column) else { return false };
        let mut values = BTreeMap::new();
        for _ in 0..FIRST_ROWS {
            let Ok(Some(row)) = table.next() else { break };
            *values.entry(row.cell(index).to_owned()).or_insert(0_u32) += 1;
        }
        values.len() > 1 && values.values().any(|rows| *rows > 1)
    }

    /// The order of day and month by the first row that shows it; `None` if no row needs one.
    fn time_format(
        &self,
        options: &ReadOptions,
        plan: &Plan,
    ) -> Result<Option<TimeFormat>, RecordingError> {
        let Some(Origin::Cells { indices, source }) = plan.origins.get(&Column::TimeUtc) else {
            return Ok(None);
        };
        let mut table = self.table(options)?;
        let mut open = None;
        let mut clear = 0;
        loop {
            let row = match table.next() {
                Ok(None) => break,
                Ok(Some(row)) => row,
                Err(_) => continue,
            };
            let Some(text) = row.joined(indices, &source.between) else { continue };
            match order(&text) {
                Order::Shown(format) => return Ok(Some(format)),
                Order::Open => {
                    open.get_or_insert_with(|| (row.line(), shown(&text)));
                }
                Order::Clear => clear += 1,
            }
            if open.is_none() && clear > FIRST_ROWS {
                break;
            }
        }
        let Some((line, value)) = open else { return Ok(None) };
        Err(RecordingError::AmbiguousTime {
            file: self.name.to_owned(),
            line,
            column: source.label(),
            value,
            readings: &[["dmy", "day, month, year"], ["mdy", "month, day, year"]],
        })
    }

    fn read(
        &self,
        options: &ReadOptions,
        astray: &Cell<Option<Geodetic>>,
    ) -> Result<Read, RecordingError> {
        let name = self.name;
        let mut table = self.table(options)?;
        let mapping = match &options.format {
            Some(mapping) => match &options.level {
                Some(level) => {
                    Cow::Owned(formats::with_level(Some(mapping.clone()), &table, level)?)
                }
                None => Cow::Borrowed(mapping),
            },
            None => {
                let first = |column: &str| self.first_cell(options, column);
                formats::recognise(&table, options, first)?
            }
        };
        let mapping = mapping.as_ref();
        let mut joined: Vec<Joined> = Vec::new();
        for beside in &mapping.beside {
            let given = |column| {
                let before = joined.iter().any(|joined| joined.columns.contains_key(&column));
                before || options.constants.contains_key(&column)
            };
            joined.extend(Joined::read(beside, &mapping.name, name, self.folder, given)?);
        }
        let mut plan = Plan::new(mapping, options, joined, &table)?;
        if plan.times.format.is_none() {
            plan.times.format = self.time_format(options, &plan)?;
        }
        let plan = plan;

        let rules = plan.rules.iter().map(|rule| rule.label.as_str());
        let rover = options.rover.as_ref();
        let located = rover.map_or_else(|| NOT_LOCATED.to_owned(), Rover::label);
        let rules = rules.chain([NOT_MEASURED, located.as_str()]);
        let mut dropped: Vec<Dropped> =
            rules.map(|rule| Dropped { rule: rule.to_owned(), rows: 0 }).collect();
        let stem = stem(name);
        let north = options.north.unwrap_or(mapping.north);
        let mut frame = options.frame;
        let mut origin_line = None;
        let rover = rover.map(|rover| (rover, options.clock_offset_s));
        let mut last_times = LastTimes::default();
        let mut backwards: Option<Backwards> = None;
        let mut rows = 0;
        let mut records = Vec::new();
        let mut exclusions = Exclusions::default();
        let mut copies = Copies::default();
        let shared = Shared::default();
        // Times that are not on the track.
        let mut off_track: Option<[f64; 2]> = None;
        for (line, problem) in self.rows.iter().flat_map(|rows| &rows.broken) {
            rows += 1;
            let error = RecordingError::Line {
                file: name.to_owned(),
                line: *line,
                problem: problem.clone(),
            };
            leave_out(&mut exclusions, error, options, name)?;
        }
        loop {
            let row = match table.next() {
                Ok(None) => break,
                Ok(Some(row)) => row,
                Err(error) => {
                    rows += 1;
                    leave_out(&mut exclusions, error, options, name)?;
                    continue;
                }
            };
            rows += 1;
            let whole = plan.melted.is_empty().then_some(None);
            for melted in whole.into_iter().chain(plan.melted.iter().map(Some)) {
                let date_s = options.date_s;
                let plan = &plan;
                let row = &row;
                let stem = stem.as_str();
                let shared = &shared;
                let reader =
                    Reader { plan, row, melted, stem, north, date_s, rover, astray, shared };
                // A row that is refused does not set the frame.
                let mut here = frame;
                let record = match reader.record(&mut here) {
                    Ok(Ok(record)) => record,
                    Ok(Err(LeftOut(rule))) => {
                        if let Some(dropped) = dropped.get_mut(rule) {
                            dropped.rows += 1;
                            let time = rover.and_then(|_| reader.time().ok().flatten());
                            if let Some(time) = time.filter(|_| dropped.rule == located) {
                                let [from, to] = off_track.unwrap_or([time; 2]);
                                off_track = Some([from.min(time), to.max(time)]);
                            }
                            if dropped.rule == NOT_LOCATED {
                                exclusions.note(Cause::NoPlace, row.line(), "has no place");
                            }
                        }
                        continue;
                    }
                    Err(error) => {
                        leave_out(&mut exclusions, error, options, name)?;
                        continue;
                    }
                };
                if frame.is_none() && here.is_some() {
                    origin_line = Some(record.line);
                }
                frame = here;
                let Some(time) = record.time else {
                    records.push(record);
                    continue;
                };
                if let Some(line) = copies.first(row, melted, time) {
                    let error = reader.of_time(FieldProblem::Copy { line });
                    if options.strict {
                        return Err(error);
                    }
                    exclusions.add(Cause::Copy, record.line, error);
                    continue;
                }
                let by_s = last_times.back_s(&record, time);
                if by_s > 0.0 && options.strict {
                    return Err(reader.of_time(FieldProblem::Backwards { by_s }));
                }
                if by_s > 0.0 {
                    let first = Backwards { line: record.line, by_s, rows: 0 };
                    backwards.get_or_insert(first).rows += 1;
                }
                records.push(record);
            }
            table.recycle(row);
        }
        if mapping.rising {
            backwards = None;
            leave_out_of_time(&mut records, &mut exclusions, &plan, name);
        }
        let labels = plan.place_labels();
        let pathless =
            leave_out_jumps(&mut records, &mut exclusions, options, frame, name, &labels)?;
        let level =
            plan.label(if plan.has(Column::RssDb) { Column::RssDb } else { Column::RssDbm });
        leave_out_codes(&mut records, &mut exclusions, options, name, &level)?;
        exclusions.check(records.len() as u64)?;
        dropped.retain(|dropped| {
            dropped.rows > 0 || (dropped.rule != NOT_MEASURED && dropped.rule != located)
        });
        let Some(first) = records.first() else {
            if let (Some((rover, offset_s)), Some(times)) = (rover, off_track) {
                return Err(RecordingError::NoCommonTime {
                    file: name.to_owned(),
                    times: times.map(|time| time + offset_s),
                    track: rover.file().to_owned(),
                    track_times: rover.times(),
                });
            }
            let lines = dropped.iter().map(|d| format!("; {} lack {}", d.rows, d.rule));
            return Err(RecordingError::NothingKept {
                file: name.to_owned(),
                rows,
                dropped: lines.collect(),
            });
        };
        let origin_is_kept = origin_line.is_none_or(|line| records.iter().any(|r| r.line == line));
        let first_place = || {
            let position = first.receiver()?.position;
            let frame = frame?;
            Some(if plan.has(Column::AltM) {
                frame.to_geodetic(&position)
            } else {
                on_ground(&frame, position)
            })
        };
        let better_origin = if origin_is_kept { None } else { first_place() };
        let mut remarks = exclusions.remarks(name, rows);
        let described = plain::described(mapping);
        if mapping.name == plain::PLAIN && options.format.is_none() && !described.is_empty() {
            let how = if options.columns.is_empty() {
                "no format has such a header; its columns are read by their names"
            } else {
                "its columns are read by the names that were given"
            };
            let text = format!("{name}: {how}: {described}");
            remarks.push(Remark::new("columns-by-name", text));
        }
        if table.preamble() > 0 {
            let line = table.header_line();
            let before = table.preamble();
            let text = format!(
                "{name}: the columns are named in line {line}; lines before it that are no part \
                 of the table: {before}"
            );
            remarks.push(Remark::new("preamble", text));
        }
        remarks.extend(backwards.map(|backwards| runs_back(name, backwards)));
        remarks.extend((pathless > 0).then(|| no_path(name, pathless)));
        // About a reference any level may be positive, which its name tells as a rule.
        let level = plan.label(Column::RssDb).to_lowercase();
        if !plan.has(Column::RssDb) || level.contains("rssi") || plain::is_signal(&level) {
            remarks.extend(positive_levels(name, &records));
        }
        remarks.extend(receivers_at_one_place(name, &records));
        let has_level = plan.has(Column::RssDbm) || plan.has(Column::RssDb);
        let attenuation = plan.ignored.iter().find(|name| plain::is_attenuation(name));
        if let Some(column) = attenuation.filter(|_| has_level) {
            let text = format!(
                "{name}: the column {column:?} is not used; call it attenuation_db if it is to be \
                 added to the level, or add it in a mapping"
            );
            remarks.push(Remark::new("column-not-used", text));
        }
        for column in plan.ignored.iter().filter(|name| !plain::is_attenuation(name)) {
            let lacking = Column::ALL.into_iter().filter(|known| !plan.has(*known));
            if let Some(meant) = typing_error(column, lacking.map(Column::name)) {
                let why = if column == meant {
                    format!("; the format {} does not name it", mapping.name)
                } else {
                    slip_for(Some(column), meant)
                };
                let text = format!("{name}: the column {column:?} is not used{why}");
                remarks.push(Remark::new("column-not-used", text));
            }
        }
        let has_bearings = plan.has(Column::BearingDegCompass) && !plan.has(Column::Beacon);
        let identity = plan.ignored.iter().filter(|_| has_bearings);
        if let Some(column) = identity.into_iter().find(|name| plain::is_identity(name))
            && self.holds_groups(options, column)
        {
            let text = format!(
                "{name}: the column {column:?} is not used, so that all bearings are of one \
                 transmitter; call it beacon if each of its values is a transmitter of its own"
            );
            remarks.push(Remark::new("column-not-used", text));
        }
        remarks.extend(find_ceilings(name, &mut records));
        remarks.extend(find_floors(name, &mut records));
        let recording = Recording {
            file: name.to_owned(),
            format: mapping.name.clone(),
            frame,
            north,
            in_degrees: plan.has(Column::LatDeg) || rover.is_some(),
            in_utc: plan.has(Column::TimeUtc),
            names_drones: plan.has(Column::Drone),
            calibrated: !plan.has(Column::RssDb),
            turns: mapping.turns,
            rows,
            dropped,
            backwards,
            ignored: plan.ignored,
            remarks,
            records,
        };
        Ok(Read { recording, better_origin })
    }
}

/// The time of the last row of each receiver and beacon.
#[derive(Default)]
struct LastTimes {
    of: Vec<(Arc<str>, Option<Arc<str>>, f64)>,
    place: BTreeMap<(Arc<str>, Option<Arc<str>>), usize>,
    last: usize,
}

impl LastTimes {
    /// Takes a row's time, and returns the time by which it is earlier than the row before of the
    /// same receiver and beacon, in seconds.
    fn back_s(&mut self, record: &Record, time: f64) -> f64 {
        let is_same = |(drone, beacon, _): &&(Arc<str>, Option<Arc<str>>, f64)| {
            *drone == record.drone && *beacon == record.beacon
        };
        if self.of.get(self.last).filter(is_same).is_none() {
            let next = self.of.len();
            let key = (Arc::clone(&record.drone), record.beacon.clone());
            self.last = *self.place.entry(key).or_insert(next);
            if self.last == next {
                self.of.push((Arc::clone(&record.drone), record.beacon.clone(), time));
            }
        }
        let Some((_, _, last)) = self.of.get_mut(self.last) else { return 0.0 };
        std::mem::replace(last, time) - time
    }
}

/// The rows that were read, each with the line where it came first.
#[derive(Default)]
struct Copies {
    /// Hashes and lines while each row is later than all before it, so that none is a copy.
    rising: Vec<(u64, u64)>,
    latest_s: Option<f64>,
    lines: HashMap<u64, u64>,
}

impl Copies {
    /// Returns the line of an earlier row with the same cells, of which the same column is read.
    fn first(&mut self, row: &Row, melted: Option<&Melted>, time: f64) -> Option<u64> {
        // A hash in place of the row: a file may be as large as memory. Among a million rows two
        // that differ share one with a probability of 1 in 40 million.
        let mut hasher = DefaultHasher::new();
        row.cells().as_slice().hash(&mut hasher);
        row.cells().iter().for_each(|cell| cell.len().hash(&mut hasher));
        melted.map(|melted| melted.index).hash(&mut hasher);
        let hash = hasher.finish();
        // Equal cells are of equal times.
        if self.lines.is_empty() && self.latest_s.is_none_or(|latest_s| time > latest_s) {
            self.latest_s = Some(time);
            self.rising.push((hash, row.line()));
            return None;
        }
        for (hash, line) in std::mem::take(&mut self.rising) {
            self.lines.entry(hash).or_insert(line);
        }
        match self.lines.entry(hash) {
            Entry::Occupied(first) => Some(*first.get()),
            Entry::Vacant(place) => {
                place.insert(row.line());
                None
            }
        }
    }
}

/// Leaves a row out for an error that is the row's own; any other is passed on.
fn leave_out(
    exclusions: &mut Exclusions,
    error: RecordingError,
    options: &ReadOptions,
    name: &str,
) -> Result<(), RecordingError> {
    let line = match &error {
        // A North that no row can be counted from is no fault of the row.
        RecordingError::Field { problem: FieldProblem::NoPlace | FieldProblem::NoDate, .. } => None,
        // A cell of a table beside the file is wrong for many rows.
        RecordingError::Field { file, line, .. } if file == name => Some(*line),
        RecordingError::FieldCount { line, .. }
        | RecordingError::NotUtf8 { line, .. }
        | RecordingError::Line { line, .. } => Some(*line),
        _ => None,
    };
    match line.filter(|_| !options.strict) {
        Some(line) => {
            exclusions.add(Cause::of(&error), line, error);
            Ok(())
        }
        None => Err(error),
    }
}

/// Leaves out the rows between which the receiver's clock was set.
fn leave_out_of_time(
    records: &mut Vec<Record>,
    exclusions: &mut Exclusions,
    plan: &Plan,
    name: &str,
) {
    let utc_time = plan.has(Column::TimeUtc);
    let label = plan.label(if utc_time { Column::TimeUtc } else { Column::TimeS });
    let out: BTreeMap<usize, f64> = out_of_time(records).into_iter().collect();
    for (index, by_s) in &out {
        let Some(record) = records.get(*index) else { continue };
        let time = record.time.unwrap_or_default();
        let error = RecordingError::Field {
            file: name.to_owned(),
            line: record.line,
            column: label.clone().into_owned(),
            value: if utc_time { utc(time) } else { time.to_string() },
            problem: FieldProblem::OutOfOrder { by_s: *by_s },
        };
        exclusions.add(Cause::ClockBack, record.line, error);
    }
    retain_others(records, |index| out.contains_key(&index));
}

/// Leaves out the rows whose level stands for no reading.
fn leave_out_codes(
    records: &mut Vec<Record>,
    exclusions: &mut Exclusions,
    options: &ReadOptions,
    name: &str,
    column: &str,
) -> Result<(), RecordingError> {
    let codes: BTreeMap<usize, f64> = codes(records).into_iter().collect();
    for (index, apart_db) in &codes {
        let Some(record) = records.get(*index) else { continue };
        let error = RecordingError::Field {
            file: name.to_owned(),
            line: record.line,
            column: column.to_owned(),
            value: record.rss_dbm.unwrap_or_default().to_string(),
            problem: FieldProblem::NoReading { apart_db: *apart_db },
        };
        if options.strict {
            return Err(error);
        }
        exclusions.add(Cause::Unreadable, record.line, error);
    }
    retain_others(records, |index| codes.contains_key(&index));
    Ok(())
}

/// Leaves out the rows to whose place the receiver cannot have moved, and returns the number of
/// rows of receivers that have no path at all.
fn leave_out_jumps(
    records: &mut Vec<Record>,
    exclusions: &mut Exclusions,
    options: &ReadOptions,
    frame: Option<LocalFrame>,
    name: &str,
    column: &str,
) -> Result<usize, RecordingError> {
    let (jumps, pathless) = jumps(records);
    for jump in &jumps {
        let Some(record) = records.get(jump.record) else { continue };
        let place = record.receiver().unwrap_or_default().position;
        let value = match frame.map(|frame| on_ground(&frame, place)) {
            Some(place) => format!("{:.6}, {:.6}", place.lat_deg, place.lon_deg),
            None => format!("{}, {}", place.x, place.y),
        };
        let Jump { distance_m, within_s, .. } = *jump;
        let error = RecordingError::Field {
            file: name.to_owned(),
            line: record.line,
            column: column.to_owned(),
            value,
            problem: FieldProblem::Jump { distance_m, within_s },
        };
        if options.strict {
            return Err(error);
        }
        exclusions.add(Cause::Jump, record.line, error);
    }
    let out: BTreeSet<usize> = jumps.iter().map(|jump| jump.record).collect();
    retain_others(records, |index| out.contains(&index));
    Ok(pathless)
}

/// The place on Earth of a receiver whose height is not that of the frame: far from the origin the
/// ground is below the frame's plane.
pub(super) fn on_ground(frame: &LocalFrame, position: Vector3<f64>) -> Geodetic {
    let mut up = 0.0;
    let mut place = frame.to_geodetic(&position.xy().push(up));
    // Each step leaves some 1/1000 of the error at 200 km.
    for _ in 0..4 {
        up -= place.alt_m - frame.origin().alt_m;
        place = frame.to_geodetic(&position.xy().push(up));
    }
    place
}

/// Keeps the records except those whose index, from 0, is out.
fn retain_others(records: &mut Vec<Record>, is_out: impl Fn(usize) -> bool) {
    let mut indices = 0..;
    records.retain(|_| indices.next().is_none_or(|index| !is_out(index)));
}

fn runs_back(file: &str, Backwards { line, by_s, rows }: Backwards) -> Remark {
    let others = match rows {
        1 => String::new(),
        rows => format!(", in {rows} rows in all"),
    };
    let text = format!(
        "{file}, line {line}: the time runs back by {by_s} s{others}; rows are taken in the order \
         of time"
    );
    Remark::new(Cause::ClockBack.code(), text)
}

/// A remark on levels that are too strong to be in dBm, but would be usual with the other sign.
fn positive_levels(file: &str, records: &[Record]) -> Option<Remark> {
    let levels = records.iter().filter_map(|record| record.rss_dbm);
    let (least, most) = levels.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), level| {
        (level.min(least), level.max(most))
    });
    if least <= MOST_DBM || !least.is_finite() {
        return None;
    }
    let text = format!(
        "{file}: all levels are positive, from {least} to {most}, as if 71 stood for -71 dBm; \
         taken as they are, the strongest is the farthest. With --negate-levels, or scale = -1 in \
         a mapping, they are {} to {} dBm",
        -most, -least
    );
    Some(Remark::new("positive-levels", text))
}

/// Receivers nearer to each other than this, in metres, are at one place.
const ONE_PLACE_M: f64 = 1.0;

/// Returns a remark if several receivers are all at one place. The antennas of a station, which
/// have boresights, and several of one vehicle, which moves, may be.
fn receivers_at_one_place(file: &str, records: &[Record]) -> Option<Remark> {
    if records.iter().any(|record| record.boresight.is_some()) {
        return None;
    }
    let mut placed = records.iter().filter_map(|record| Some((&record.drone, record.receiver()?)));
    let (name, first) = placed.next()?;
    let mut names = HashSet::from([name]);
    for (name, receiver) in placed {
        if (receiver.position - first.position).norm() >= ONE_PLACE_M {
            return None;
        }
        names.insert(name);
    }
    let count = names.len();
    (count > 1).then(|| {
        let text = format!(
            "{file}: all {count} receivers are at one place: check the columns of their places; \
             from one place there is no range"
        );
        Remark::new("receivers-at-one-place", text)
    })
}

fn no_path(file: &str, rows: usize) -> Remark {
    let text = format!(
        "{file}: the places of {rows} rows are farther apart than a receiver moves between their \
         times, and no path holds more than half of them, so that none is left out; are the times \
         in seconds, and several receivers named in a column drone?"
    );
    Remark::new(Cause::Jump.code(), text)
}

/// A file's name without folder and endings: the name of an unnamed drone.
fn stem(file: &str) -> String {
    let stem = Path::new(file).file_stem().map_or(file.into(), |stem| stem.to_string_lossy());
    let compressed = file.ends_with(".gz").then(|| stem.strip_suffix(".csv")).flatten();
    compressed.unwrap_or(&stem).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn times_that_run_back_are_named() {
        let read = |text: &str| {
            let read = Recording::from_reader(text.as_bytes(), "a.csv", &ReadOptions::default());
            read.expect("rows").backwards()
        };
        let head = "drone,time_s,east_m,north_m,rss_dbm\n";
        let rising = format!("{head}a,0,0,0,-60\nb,9,0,0,-60\na,3,0,0,-60\nb,9,0,0,-61\n");
        assert_eq!(read(&rising), None, "each drone has its own times");
        let back = read(&format!("{rising}a,1,0,0,-60\na,0.5,0,0,-60\n")).expect("it runs back");
        assert_eq!((back.line, back.rows), (6, 2));
        assert_abs_diff_eq!(back.by_s, 2.0, epsilon = 1e-12);
    }
}
