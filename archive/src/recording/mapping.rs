use std::{collections::BTreeMap, path::Path};

use foxhunt_core::parameter::FieldError;
use foxhunt_hunt::document;
use serde::Deserialize;

use super::{Column, North, RecordingError, Source, Value, column::Kind};

/// Rules by which a CSV format's columns become ours.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mapping {
    /// The format's name.
    pub name: String,
    /// Description of the format, in a line.
    pub description: String,
    /// The columns by which a file is recognised; `a|b` is either, `*` any part of a name. A file
    /// without a header is not recognised.
    #[serde(default)]
    pub header: Vec<String>,
    /// The names of the columns of files without a header, from the first on. What a row has
    /// beyond them is not read, but by `spectrum`.
    #[serde(default)]
    pub names: Vec<String>,
    /// Rows that hold the power of many frequencies.
    pub spectrum: Option<Spectrum>,
    /// True if the times of a drone and a beacon rise from row to row; rows whose time falls are
    /// left out.
    #[serde(default)]
    pub rising: bool,
    /// Source of each column of ours.
    pub columns: BTreeMap<Column, Source>,
    /// Values that are the same for every row.
    #[serde(default)]
    pub constants: BTreeMap<Column, Value>,
    /// North from which angles are counted.
    #[serde(default)]
    pub north: North,
    /// Rules for rows: a row that passes all of them is kept.
    #[serde(default)]
    pub keep: Vec<Keep>,
    /// Definition of a turn where there is no `turn` column.
    #[serde(default)]
    pub turns: Turns,
    /// Tables that lie in other files of the same folder.
    #[serde(default)]
    pub beside: Vec<Beside>,
    /// Columns of which each is of one beacon or drone.
    pub melt: Option<Melt>,
    /// The column with the zone of UTM, such as 33U, that `east_m` and `north_m` are of; they are
    /// then read as degrees.
    pub utm_zone: Option<String>,
    /// Separator of the cells, one character; found by the header unless given.
    pub separator: Option<char>,
    /// True if files hold the path of a receiver. Of their levels one is read, by its name.
    #[serde(default)]
    pub path: bool,
    /// True if dates without an offset are in UTC, whatever zone is stated for others.
    #[serde(default)]
    pub utc: bool,
}

/// A rule that a row must pass to be kept.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Keep {
    /// The file's column.
    pub column: String,
    /// The least number to keep.
    pub min: Option<f64>,
    /// The greatest number to keep.
    pub max: Option<f64>,
    /// The one value to keep.
    pub equals: Option<Value>,
    /// The one value to leave out.
    pub differs: Option<Value>,
    /// True if files without the column are kept whole.
    #[serde(default)]
    pub optional: bool,
}

/// Bins of power over frequency behind the named columns of a row; the strongest bin of the wanted
/// frequency is read.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spectrum {
    /// The column with the lowest frequency of a row in hertz.
    pub low: String,
    /// The column with the highest frequency.
    pub high: String,
    /// The column with the width of a bin in hertz.
    pub step: String,
    /// Height of the first bin's middle above the lowest frequency, in widths of a bin.
    #[serde(default)]
    pub first: f64,
    /// Column of ours that their cells hold.
    pub value: Column,
}

/// Definition of an antenna's turn in a drone's readings of one beacon.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Turns {
    /// A new turn begins when the boresight has gone a full circle from where the turn began,
    /// all steps added up, each the short way round.
    #[default]
    Circle,
    /// The file is one turn.
    File,
    /// A new turn begins after this many seconds without a reading.
    GapS(f64),
}

/// A CSV file in the recording's folder that is joined to it: a row for each beacon or drone, such
/// as the stations' places, or a single row that holds for all.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Beside {
    /// The file's name, without a folder.
    pub file: String,
    /// Source of each column of ours in the file.
    pub columns: BTreeMap<Column, Source>,
    /// Columns that name the beacon or the drone that a row is of; if empty, the file has one row.
    #[serde(default)]
    pub by: BTreeMap<Column, Source>,
    /// True if recordings without this file can be read, and rows whose name is not in it.
    #[serde(default)]
    pub optional: bool,
}

/// Columns side by side that hold the same quantity of different beacons or drones: each row
/// becomes one row for each of them.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Melt {
    /// The columns' names, with `*` where the name of the beacon or drone stands.
    pub columns: String,
    /// Kind of the names: `beacon` or `drone`.
    pub name: Column,
    /// Column of ours that their cells hold.
    pub value: Column,
}

impl Melt {
    /// The name that a column's name holds; `None` where it is no such column.
    pub(super) fn name_in<'c>(&self, column: &'c str) -> Option<&'c str> {
        name_in(&self.columns, column)
    }
}

/// Text that stands for the `*` of a pattern; `None` where the column's name does not fit it.
fn name_in<'c>(pattern: &str, column: &'c str) -> Option<&'c str> {
    let (before, after) = pattern.split_once('*')?;
    column.strip_prefix(before)?.strip_suffix(after).filter(|name| !name.is_empty())
}

impl Mapping {
    /// Reads a mapping from TOML; `file` is its name in errors.
    ///
    /// # Errors
    ///
    /// [`RecordingError::Mapping`] for text that is no mapping, [`RecordingError::MappingField`]
    /// for a field that is out of its range.
    pub fn parse(text: &str, file: &str) -> Result<Self, RecordingError> {
        let mapping: Self = document::from_toml(text).map_err(|source| {
            RecordingError::Mapping { file: file.to_owned(), source: Box::new(source) }
        })?;
        mapping.check(file)?;
        Ok(mapping)
    }

    fn check(&self, file: &str) -> Result<(), RecordingError> {
        let refuse = |field: String, value: String, requirement: &'static str| {
            let source = FieldError { field, value, requirement };
            Err(RecordingError::MappingField { file: file.to_owned(), source })
        };
        let own = self.columns.iter().map(|(column, source)| ("columns", column, source));
        let joined = self.beside.iter().flat_map(|beside| {
            let columns = beside.columns.iter().map(|(column, source)| ("columns", column, source));
            columns.chain(beside.by.iter().map(|(column, source)| ("by", column, source)))
        });
        for (table, column, source) in own.chain(joined) {
            if let Some((field, value, requirement)) = wrong_source(*column, source) {
                return refuse(format!("{table}.{column}{field}"), value, requirement);
            }
        }
        for (index, rule) in self.keep.iter().enumerate() {
            let values = [&rule.equals, &rule.differs];
            if rule.min.is_none() && rule.max.is_none() && values == [&None, &None] {
                let requirement = "a rule with min, max, equals or differs";
                return refuse(format!("keep[{index}]"), rule.column.clone(), requirement);
            }
            for bound in [rule.min, rule.max].into_iter().flatten() {
                if bound.is_nan() {
                    return refuse(format!("keep[{index}]"), bound.to_string(), "a number");
                }
            }
        }
        if let Turns::GapS(gap) = self.turns
            && (gap.is_nan() || gap < 0.0)
        {
            return refuse("turns.gap_s".to_owned(), gap.to_string(), "zero or a positive number");
        }
        for beside in &self.beside {
            let mut numbers = beside.columns.iter().filter(|(c, _)| c.kind() != Kind::Text);
            if let Some((column, source)) = numbers.find(|(_, source)| source.columns.len() > 1) {
                let requirement = "a single column: only the recording's own are added";
                return refuse(format!("columns.{column}.columns"), source.label(), requirement);
            }
            // A mapping from a stranger shall not make us read elsewhere.
            let name = Path::new(&beside.file).file_name();
            if name.is_none_or(|name| name != beside.file.as_str()) {
                let requirement = "a file's name without a folder";
                return refuse("beside.file".to_owned(), beside.file.clone(), requirement);
            }
            if let Some(column) = beside.by.keys().find(|column| !column.is_name()) {
                return refuse("beside.by".to_owned(), column.to_string(), "beacon or drone");
            }
            let named = beside.columns.keys().find(|column| column.is_name());
            if let (Some(column), false) = (named, beside.by.is_empty()) {
                let requirement = "no name, for rows are found by their names";
                return refuse("beside.columns".to_owned(), column.to_string(), requirement);
            }
        }
        if let Some(melt) = &self.melt {
            if melt.columns.matches('*').count() != 1 {
                let requirement = "a column's name with one * in it";
                return refuse("melt.columns".to_owned(), melt.columns.clone(), requirement);
            }
            if !melt.name.is_name() {
                return refuse("melt.name".to_owned(), melt.name.to_string(), "beacon or drone");
            }
            if melt.value.kind() == Kind::Text {
                return refuse(
                    "melt.value".to_owned(),
                    melt.value.to_string(),
                    "a number's column",
                );
            }
            for column in [melt.name, melt.value] {
                if self.columns.contains_key(&column) || self.constants.contains_key(&column) {
                    let requirement = "one that nothing else fills";
                    return refuse("melt".to_owned(), column.to_string(), requirement);
                }
            }
        }
        if !self.names.is_empty() && !self.header.is_empty() {
            let requirement = "absent beside header: they are of files without one";
            return refuse("names".to_owned(), self.names.join(", "), requirement);
        }
        if let Some(spectrum) = &self.spectrum {
            if self.names.is_empty() {
                let requirement = "with names: bins are what a row has beyond them";
                return refuse("spectrum".to_owned(), spectrum.low.clone(), requirement);
            }
            if !matches!(spectrum.value, Column::RssDbm | Column::RssDb) {
                let value = spectrum.value.to_string();
                return refuse("spectrum.value".to_owned(), value, "rss_dbm or rss_db");
            }
            if !spectrum.first.is_finite() {
                let first = spectrum.first.to_string();
                return refuse("spectrum.first".to_owned(), first, "finite");
            }
        }
        let separates =
            |c: char| c.is_ascii() && !c.is_ascii_alphanumeric() && !"\"#\r\n".contains(c);
        if let Some(separator) = self.separator.filter(|separator| !separates(*separator)) {
            let requirement = "an ASCII character other than a letter, a digit, a quote or #";
            return refuse("separator".to_owned(), separator.to_string(), requirement);
        }
        Ok(())
    }

    /// Returns true if a line names all columns that a file of the format has.
    pub(super) fn fits(&self, columns: &[String]) -> bool {
        let needed = self.columns.iter().filter(|(_, source)| !source.optional);
        let has = |name: &str| columns.iter().any(|column| column == name);
        let named = |(column, source): (&Column, &Source)| match column.kind() {
            Kind::Text => source.columns.clone(),
            _ => source.terms(has).into_iter().map(|(name, _)| name).collect(),
        };
        // Columns that are all optional fit to any line.
        let is_bare = self.header.is_empty() && self.columns.values().all(|s| s.optional);
        !is_bare
            && self.lacks(columns).is_empty()
            && needed.flat_map(named).all(|name| columns.contains(&name))
    }

    /// The entries of `header` that a file's columns do not satisfy.
    pub(super) fn lacks(&self, columns: &[String]) -> Vec<String> {
        let is = |name: &str, column: &String| column == name || name_in(name, column).is_some();
        let has =
            |entry: &&String| entry.split('|').any(|name| columns.iter().any(|c| is(name, c)));
        self.header.iter().filter(|entry| !has(entry)).cloned().collect()
    }
}

/// Fault of a column's source: the field, its value and the requirement.
fn wrong_source(column: Column, source: &Source) -> Option<(&'static str, String, &'static str)> {
    let scale = source.scale;
    let offset = source.offset;
    let plain = (scale - 1.0).abs() < f64::EPSILON && offset.abs() < 1e-300 && !source.wrap;
    let text = column.kind() == Kind::Text;
    // Times may be numbers.
    let scaled = column == Column::TimeUtc && !source.wrap;
    if !scale.is_finite() || scale.abs() < f64::MIN_POSITIVE {
        Some((".scale", scale.to_string(), "a finite number other than 0"))
    } else if !offset.is_finite() {
        Some((".offset", offset.to_string(), "finite"))
    } else if text && !plain && !scaled {
        let requirement = "a column without scale, offset or wrap: it holds texts";
        Some(("", source.label(), requirement))
    } else if !text && source.columns.len() > 1 && !source.lookup.is_empty() {
        Some((".columns", source.label(), "a single column: a sum has no lookup"))
    } else if let Some(part) = source.part.filter(|part| *part > 1) {
        Some((".part", part.to_string(), "0 or 1, for the first or second number of a cell"))
    } else if source.wrap && !column.is_angle() {
        Some((".wrap", source.wrap.to_string(), "false: this column is not an angle of a circle"))
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "name = 'n'\ndescription = 'd'\nheader = ['a|b', 'c']\n";

    fn message(more: &str) -> String {
        let error = Mapping::parse(&format!("{GOOD}{more}"), "m.toml").expect_err(more);
        let source = std::error::Error::source(&error).map(ToString::to_string);
        format!("{error} {}", source.unwrap_or_default())
    }

    #[test]
    fn alternatives_satisfy_the_header() {
        let mapping = Mapping::parse(&format!("{GOOD}columns = {{}}"), "m.toml").expect("good");
        assert_eq!(mapping.lacks(&["b".into(), "x".into()]), ["c"]);
        assert!(mapping.lacks(&["c".into(), "a".into()]).is_empty());
        assert_eq!(mapping.turns, Turns::Circle);
    }

    #[test]
    fn mistakes_are_named() {
        for (text, expected) in [
            ("columns = { rss = 'x' }", "\"rss\" is not a known column"),
            ("columns = { rss_db = { column = 'x', scal = 2 } }", "unknown field `scal`"),
            ("columns = { rss_db = 7 }", "a column's name, names that are added"),
            ("columns = { rss_db = { column = 'x', scale = 0 } }", "columns.rss_db.scale"),
            ("columns = { rss_db = { column = 'x', offset = inf } }", "columns.rss_db.offset"),
            ("columns = { beacon = { column = 'x', scale = 2 } }", "columns.beacon"),
            ("columns = { lat_deg = { column = 'x', part = 2 } }", "columns.lat_deg.part"),
            ("columns = {}\nkeep = [{ column = 'x' }]", "keep[0]"),
            ("columns = {}\nkeep = [{ column = 'x', min = nan }]", "NaN"),
            ("columns = {}\nturns = { gap_s = -1 }", "turns.gap_s"),
            ("columns = {}\nturns = 'spiral'", "spiral"),
            ("columns = {}\nbeside = [{ file = '../x', columns = {} }]", "../x"),
            ("north = 'up'\ncolumns = {}", "up is no North"),
            ("north = 181\ncolumns = {}", "181 is no North"),
            ("north = nan\ncolumns = {}", "NaN is no North"),
            ("columns = {}\nextra = 1", "extra"),
            ("names = ['x']\ncolumns = {}", "names"),
            ("columns = { time_utc = { column = 'x', scale = 0 } }", "columns.time_utc.scale"),
            (
                "columns = {}\nspectrum = { low = 'a', high = 'b', step = 'c', value = 'rss_db' }",
                "spectrum",
            ),
        ] {
            let message = message(text);
            let named = message.contains("m.toml") && message.contains(expected);
            assert!(named, "{text}: {message}");
        }
    }
}
