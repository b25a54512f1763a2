use std::{collections::BTreeMap, fs, io::Read, path::Path};

use super::{
    Backwards, Column, Dropped, ReadOptions, Recording, RecordingError, Rover, beside::Joined,
    decompress::decompressed, formats, parse::LeftOut, plan::Plan, row::Reader, table::Table,
};

/// What every recording drops rows for, besides the mapping's rules.
const NOT_MEASURED: &str = "a measurement";
const NOT_LOCATED: &str = "a position";

impl Recording {
    /// Reads a file.
    ///
    /// # Errors
    ///
    /// [`RecordingError`] names the file, line, column and value.
    pub fn read(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Self, RecordingError> {
        let path = path.as_ref();
        let name = path.display().to_string();
        let bytes =
            fs::read(path).map_err(|source| RecordingError::Read { file: name.clone(), source })?;
        Self::from_bytes(&bytes, &name, path.parent(), options)
    }

    /// Reads files into one frame: the one in the options, or one whose origin is the first
    /// usable position of all.
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
            recordings.push(recording);
        }
        Ok(recordings)
    }

    /// Reads from anywhere; `name` is what errors call it. Nothing lies beside it.
    ///
    /// # Errors
    ///
    /// [`RecordingError`] as [`Self::read`].
    pub fn from_reader(
        mut reader: impl Read,
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
        let bytes = decompressed(bytes, name)?;
        let separator = options.format.as_ref().and_then(|mapping| mapping.separator);
        let names = options.format.as_ref().map_or(&[][..], |mapping| mapping.names.as_slice());
        let mut table = Table::open(name, &bytes, separator, names)?;
        let mapping = match &options.format {
            Some(mapping) => mapping,
            None => formats::recognise(name, table.header_line(), table.header())?,
        };
        let mut joined: Vec<Joined> = Vec::new();
        for beside in &mapping.beside {
            let given = |column| {
                let before = joined.iter().any(|joined| joined.columns.contains_key(&column));
                before || options.constants.contains_key(&column)
            };
            joined.extend(Joined::read(beside, &mapping.name, name, folder, given)?);
        }
        let plan = Plan::new(mapping, options, joined, &table)?;

        let rules = plan.rules.iter().map(|rule| rule.label.as_str());
        let rover = options.rover.as_ref();
        let located = rover.map_or_else(|| NOT_LOCATED.to_owned(), Rover::label);
        let rules = rules.chain([NOT_MEASURED, located.as_str()]);
        let mut dropped: Vec<Dropped> =
            rules.map(|rule| Dropped { rule: rule.to_owned(), rows: 0 }).collect();
        let stem = stem(name);
        let north = options.north.unwrap_or(mapping.north);
        let mut frame = options.frame;
        let rover = rover.map(|rover| (rover, options.clock_offset_s));
        let mut last_times = BTreeMap::new();
        let mut backwards: Option<Backwards> = None;
        let mut rows = 0;
        let mut records = Vec::new();
        while let Some(row) = table.next()? {
            rows += 1;
            let columns = if plan.melted.is_empty() {
                vec![None]
            } else {
                plan.melted.iter().map(Some).collect()
            };
            for melted in columns {
                let (north, date_s) = (north, options.date_s);
                let (plan, row, stem) = (&plan, &row, stem.as_str());
                let reader = Reader { plan, row, melted, stem, north, date_s, rover };
                match reader.record(&mut frame)? {
                    Ok(record) => {
                        if let Some(time) = record.time {
                            let of = (record.drone.clone(), record.beacon.clone());
                            let by_s = last_times.insert(of, time).unwrap_or(time) - time;
                            if by_s > 0.0 && mapping.rising {
                                return Err(reader.backwards(by_s));
                            }
                            if by_s > 0.0 {
                                let first = Backwards { line: record.line, by_s, rows: 0 };
                                backwards.get_or_insert(first).rows += 1;
                            }
                        }
                        records.push(record);
                    }
                    Err(LeftOut(rule)) => {
                        if let Some(dropped) = dropped.get_mut(rule) {
                            dropped.rows += 1;
                        }
                    }
                }
            }
        }
        dropped.retain(|dropped| {
            dropped.rows > 0 || (dropped.rule != NOT_MEASURED && dropped.rule != located)
        });
        if records.is_empty() {
            let lines = dropped.iter().map(|d| format!("; {} lack {}", d.rows, d.rule));
            return Err(RecordingError::NothingKept {
                file: name.to_owned(),
                rows,
                dropped: lines.collect(),
            });
        }
        Ok(Self {
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
            records,
        })
    }
}

/// A file's name without folder and endings: what a drone is called that has no name.
fn stem(file: &str) -> String {
    let stem = Path::new(file).file_stem().map_or(file.into(), |stem| stem.to_string_lossy());
    let compressed = file.ends_with(".gz").then(|| stem.strip_suffix(".csv")).flatten();
    compressed.unwrap_or(&stem).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert!((back.by_s - 2.0).abs() < 1e-12, "{back:?}");
    }
}
