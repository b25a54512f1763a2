use std::{collections::BTreeMap, path::Path};

use super::{RowId, StruckError, entries, read};
use crate::recording::Recording;

/// Names of some recordings' files in a [`RowId`], in the order of the recordings.
#[must_use]
pub fn file_names(recordings: &[Recording]) -> Vec<String> {
    let last = |recording: &Recording| {
        let file = recording.file();
        Path::new(file).file_name().map_or_else(|| file.to_owned(), |f| f.to_string_lossy().into())
    };
    let short: Vec<String> = recordings.iter().map(last).collect();
    let is_alone = |name: &String| short.iter().filter(|other| *other == name).count() < 2;
    let name = |(recording, short): (&Recording, &String)| match is_alone(short) {
        true => short.clone(),
        false => recording.file().to_owned(),
    };
    recordings.iter().zip(&short).map(name).collect()
}

/// Receptions of recordings that are left out; none by default.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StruckRows {
    /// Each with its line in the file.
    lines: BTreeMap<RowId, usize>,
}

impl StruckRows {
    /// Reads a file of receptions, each of which is one of `known`.
    ///
    /// # Errors
    ///
    /// [`StruckError`] names the file, the line and the value.
    pub fn read(path: &Path, known: &[RowId]) -> Result<Self, StruckError> {
        Self::parse(&read(path)?, path, known)
    }

    /// Reads receptions from text; `path` is what errors call it.
    ///
    /// # Errors
    ///
    /// [`StruckError`] names the file, the line and the value.
    pub fn parse(text: &str, path: &Path, known: &[RowId]) -> Result<Self, StruckError> {
        let mut struck = Self::default();
        for (line, row) in entries::<RowId>(text, path, "file and line of a reception")? {
            let path = || path.to_owned();
            if !known.contains(&row) {
                let there = what_is_there(&row, known);
                return Err(StruckError::NoRow { path: path(), line, row, there });
            }
            let what = row.to_string();
            if let Some(before) = struck.lines.insert(row, line) {
                return Err(StruckError::Twice { path: path(), line, what, before });
            }
        }
        Ok(struck)
    }

    /// Returns true if a reception is left out.
    #[must_use]
    pub fn contains(&self, row: &RowId) -> bool {
        self.lines.contains_key(row)
    }

    /// Returns the number of a beacon's receptions left out.
    #[must_use]
    pub fn of_beacon(&self, beacon: Option<&str>) -> usize {
        self.lines.keys().filter(|row| row.beacon.as_deref() == beacon).count()
    }

    /// Returns the number of receptions left out.
    #[must_use]
    pub fn len(&self) -> usize {
        self.lines.len()
    }

    /// Returns true if no reception is left out.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }
}

/// Describes the known row nearest to a missing one.
fn what_is_there(row: &RowId, known: &[RowId]) -> String {
    let of_file = || known.iter().filter(|known| known.file == row.file);
    let nearest = of_file().min_by_key(|known| (known.line.abs_diff(row.line), &known.beacon));
    match (nearest, known.first()) {
        (Some(nearest), _) => format!("the nearest is {nearest}"),
        (None, Some(first)) => format!("the first is {first}"),
        (None, None) => "the recording has no reception at all".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::ReadOptions;

    fn row(file: &str, line: u64, beacon: Option<&str>) -> RowId {
        RowId { file: file.to_owned(), line, beacon: beacon.map(str::to_owned) }
    }

    fn parse(lines: &str) -> Result<StruckRows, StruckError> {
        let known =
            [row("a.csv", 2, None), row("b.csv", 7, Some("fox")), row("b.csv", 7, Some("owl"))];
        let text = format!("{{\"foxhunt_struck\":1}}\n{lines}");
        StruckRows::parse(&text, Path::new("list"), &known)
    }

    #[test]
    fn rows_are_known_by_file_line_and_beacon() {
        let struck =
            parse("{\"file\":\"b.csv\",\"line\":7,\"beacon\":\"owl\"}\n\n").expect("it is there");
        assert_eq!(
            (struck.len(), struck.of_beacon(Some("owl")), struck.of_beacon(None)),
            (1, 1, 0)
        );
        assert!(struck.contains(&row("b.csv", 7, Some("owl"))));
        assert!(!struck.contains(&row("b.csv", 7, Some("fox"))));
        assert!(!struck.contains(&row("a.csv", 2, None)));
    }

    #[test]
    fn what_is_wrong_is_named() {
        let error = |lines: &str| parse(lines).expect_err("it is wrong").to_string();
        for (lines, part) in [
            ("{\"file\":\"a.csv\",\"line\":9}", "nearest is line 2 of a.csv"),
            ("{\"file\":\"b.csv\",\"line\":7}", "nearest is fox in line 7"),
            ("{\"file\":\"c.csv\",\"line\":2}", "first is line 2 of a.csv"),
            ("{\"drone\":0,\"beacon\":0,\"time\":6.0}", "not file and line"),
        ] {
            let error = error(lines);
            assert!(error.contains("list, line 2") && error.contains(part), "{error}");
        }
        let line = "{\"file\":\"a.csv\",\"line\":2}";
        let twice = error(&format!("{line}\n{line}"));
        assert!(twice.contains("line 3") && twice.contains("line 2 already"), "{twice}");
    }

    #[test]
    fn files_of_one_name_keep_their_folders() {
        let read = |name: &str| {
            let csv = "east_m,north_m,rss_dbm\n0,0,-60\n";
            Recording::from_reader(csv.as_bytes(), name, &ReadOptions::default()).expect("rows")
        };
        let names = file_names(&[read("x/a.csv"), read("x/b.csv"), read("y/b.csv")]);
        assert_eq!(names, ["a.csv", "x/b.csv", "y/b.csv"]);
    }
}
