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

/// Columns that say the same thing.
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
const NEEDS: [(Column, Column); 12] = [
    (Column::LatDeg, Column::LonDeg),
    (Column::LonDeg, Column::LatDeg),
    (Column::EastM, Column::NorthM),
    (Column::NorthM, Column::EastM),
    (Column::AltM, Column::LatDeg),
    (Column::UpM, Column::EastM),
    (Column::AntennaDeg, Column::HeadingDegCompass),
    (Column::BearingSigmaDeg, Column::BearingDegCompass),
    (Column::TruthLatDeg, Column::TruthLonDeg),
    (Column::TruthLonDeg, Column::TruthLatDeg),
    (Column::TruthEastM, Column::TruthNorthM),
    (Column::TruthNorthM, Column::TruthEastM),
];

impl Plan {
    /// Fits `mapping` to the file; `fixed` are constants that override it.
    pub(super) fn new(
        mapping: &Mapping,
        fixed: &BTreeMap<Column, Value>,
        table: &Table<'_>,
    ) -> Result<Self, RecordingError> {
        let (file, line) = (table.file(), table.header_line());
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
            let (index, keep) = (require(&keep.column)?, keep.clone());
            Ok(Rule { index, label: label(&keep), keep })
        };
        let rules = mapping.keep.iter().map(rule).collect::<Result<Vec<_>, RecordingError>>()?;
        let plan = Self { ignored: ignored(table.header(), &origins, &rules), origins, rules };
        plan.check(file, line)?;
        Ok(plan)
    }

    /// Whether the recording says anything about this.
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
                let (file, column, other) = (file.to_owned(), label(column), label(other));
                return Err(RecordingError::Conflict { file, line, column, other });
            }
        }
        let incomplete = |column: String, needs: &str| {
            let (file, needs) = (file.to_owned(), needs.to_owned());
            Err(RecordingError::Incomplete { file, line, column, needs })
        };
        for (column, other) in NEEDS {
            if self.has(column) && !self.has(other) {
                return incomplete(label(column), other.name());
            }
        }
        let measured = [Column::RssDbm, Column::RssDb, Column::BearingDegCompass];
        if !measured.iter().any(|column| self.has(*column)) {
            let names = measured.map(Column::name).join(" or ");
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
