use std::collections::BTreeMap;

use super::{Column, Keep, Mapping, RecordingError, Source, Value, table::Table};

/// A mapping fitted to one file's header.
pub(super) struct Plan {
    pub(super) origins: BTreeMap<Column, Origin>,
    pub(super) rules: Vec<Rule>,
    /// The file's columns that nothing reads.
    pub(super) ignored: Vec<String>,
}

/// Where a column's values come from.
pub(super) enum Origin {
    /// From a cell of each row.
    Cell { index: usize, source: Source },
    /// The same for every row.
    Fixed(String),
}

/// A rule of the mapping, with the place of its column.
pub(super) struct Rule {
    pub(super) index: usize,
    pub(super) keep: Keep,
    pub(super) label: String,
}

/// Columns that exclude each other: both hold the same.
const CONFLICTS: [(Column, Column); 11] = [
    (Column::TimeS, Column::TimeUtc),
    (Column::LatDeg, Column::EastM),
    (Column::AltAglM, Column::AltM),
    (Column::AltAglM, Column::UpM),
    (Column::AltM, Column::UpM),
    (Column::AntennaDeg, Column::BoresightDegCompass),
    (Column::RssDbm, Column::RssDb),
    (Column::TruthLatDeg, Column::TruthEastM),
    (Column::LatDeg, Column::TruthEastM),
    (Column::EastM, Column::TruthLatDeg),
    (Column::EastM, Column::AltM),
];

/// Columns that are nothing without another.
const NEEDS: [(Column, Column); 17] = [
    (Column::LatDeg, Column::LonDeg),
    (Column::LonDeg, Column::LatDeg),
    (Column::EastM, Column::NorthM),
    (Column::NorthM, Column::EastM),
    (Column::AltM, Column::LatDeg),
    (Column::UpM, Column::EastM),
    (Column::AntennaDeg, Column::HeadingDegCompass),
    (Column::BearingSigmaDeg, Column::BearingDegCompass),
    (Column::RangeSigmaM, Column::RangeM),
    (Column::RangeDifferenceM, Column::RangeDifferenceSigmaM),
    (Column::RangeDifferenceSigmaM, Column::RangeDifferenceM),
    (Column::RssDifferenceDb, Column::RssDifferenceSigmaDb),
    (Column::RssDifferenceSigmaDb, Column::RssDifferenceDb),
    (Column::TruthLatDeg, Column::TruthLonDeg),
    (Column::TruthLonDeg, Column::TruthLatDeg),
    (Column::TruthEastM, Column::TruthNorthM),
    (Column::TruthNorthM, Column::TruthEastM),
];

/// Columns of which a recording has at least one. A range is a measurement where it has a σ.
const MEASUREMENTS: [Column; 6] = [
    Column::RssDbm,
    Column::RssDb,
    Column::BearingDegCompass,
    Column::RangeSigmaM,
    Column::RangeDifferenceM,
    Column::RssDifferenceDb,
];

impl Plan {
    /// Fits `mapping` to the file; `fixed` are constants that override it.
    pub(super) fn new(
        mapping: &Mapping,
        fixed: &BTreeMap<Column, Value>,
        table: &Table<'_>,
    ) -> Result<Self, RecordingError> {
        let file = table.file();
        let line = table.header_line();
        let require = |column: &str| {
            table.index_of(column)?.ok_or_else(|| RecordingError::MissingColumn {
                file: file.to_owned(),
                line,
                column: column.to_owned(),
                format: mapping.name.clone(),
            })
        };
        let mut origins = BTreeMap::new();
        for (column, value) in &mapping.constants {
            origins.insert(*column, Origin::Fixed(value.to_string()));
        }
        for (column, source) in &mapping.columns {
            if fixed.contains_key(column)
                || source.optional && table.index_of(&source.column)?.is_none()
            {
                continue;
            }
            let index = require(&source.column)?;
            origins.insert(*column, Origin::Cell { index, source: source.clone() });
        }
        for (column, value) in fixed {
            origins.insert(*column, Origin::Fixed(value.to_string()));
        }
        let rule = |keep: &Keep| {
            Ok(Rule { index: require(&keep.column)?, label: label(keep), keep: keep.clone() })
        };
        let rules = mapping.keep.iter().map(rule).collect::<Result<Vec<_>, RecordingError>>()?;
        let plan = Self { ignored: ignored(table.header(), &origins, &rules), origins, rules };
        plan.check(file, line)?;
        Ok(plan)
    }

    /// Whether the recording has such a column, or a constant for it.
    pub(super) fn has(&self, column: Column) -> bool {
        self.origins.contains_key(&column)
    }

    /// What messages call a column: the file's own name for it.
    pub(super) fn label(&self, column: Column) -> &str {
        match self.origins.get(&column) {
            Some(Origin::Cell { source, .. }) => &source.column,
            _ => column.name(),
        }
    }

    fn check(&self, file: &str, line: u64) -> Result<(), RecordingError> {
        let label = |column| self.label(column).to_owned();
        for (column, other) in CONFLICTS {
            if self.has(column) && self.has(other) {
                return Err(RecordingError::Conflict {
                    file: file.to_owned(),
                    line,
                    column: label(column),
                    other: label(other),
                });
            }
        }
        let incomplete = |column: String, needs: &str| {
            let needs = needs.to_owned();
            Err(RecordingError::Incomplete { file: file.to_owned(), line, column, needs })
        };
        for (column, other) in NEEDS {
            if self.has(column) && !self.has(other) {
                return incomplete(label(column), other.name());
            }
        }
        if !MEASUREMENTS.iter().any(|column| self.has(*column)) {
            let names = MEASUREMENTS.map(Column::name).join(" or ");
            return incomplete("a recording".to_owned(), &names);
        }
        Ok(())
    }
}

fn ignored(header: &[String], origins: &BTreeMap<Column, Origin>, rules: &[Rule]) -> Vec<String> {
    let read = |wanted: usize| {
        let cells = origins.values().filter_map(|origin| match origin {
            Origin::Cell { index, .. } => Some(*index),
            Origin::Fixed(_) => None,
        });
        cells.chain(rules.iter().map(|rule| rule.index)).any(|index| index == wanted)
    };
    let unread = header.iter().enumerate().filter(|(index, _)| !read(*index));
    unread.map(|(_, name)| name.clone()).collect()
}

fn label(keep: &Keep) -> String {
    let mut parts = Vec::new();
    parts.extend(keep.min.map(|min| format!("{} ≥ {min}", keep.column)));
    parts.extend(keep.max.map(|max| format!("{} ≤ {max}", keep.column)));
    parts.extend(keep.equals.as_ref().map(|value| format!("{} = {value}", keep.column)));
    parts.join(" and ")
}
