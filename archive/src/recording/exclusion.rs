use std::collections::BTreeMap;

use foxhunt_core::Remark;

use super::{FieldProblem, RecordingError};

/// Rows that a remark names; the others are counted.
const NAMED: usize = 5;

/// Cause of a row's exclusion, in the order of the remarks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Cause {
    /// A cell cannot be read, or is out of its range.
    Unreadable,
    /// The receiver had no fix.
    NoFix,
    /// The place is missing.
    NoPlace,
    /// The receiver cannot have come there.
    Jump,
    /// The receiver's clock was set back.
    ClockBack,
    /// The row is there already.
    Copy,
}

impl Cause {
    /// The cause of a row's error.
    pub(super) fn of(error: &RecordingError) -> Self {
        match error {
            RecordingError::Field { problem: FieldProblem::NoFix, .. } => Self::NoFix,
            _ => Self::Unreadable,
        }
    }

    /// The code of the remark.
    pub(super) fn code(self) -> &'static str {
        match self {
            Self::Unreadable => "rows-left-out",
            Self::NoFix | Self::NoPlace => "no-position",
            Self::Jump => "position-jumps",
            Self::ClockBack => "clock-runs-back",
            Self::Copy => "duplicate-rows",
        }
    }

    /// The end of a sentence that begins with the number of rows.
    fn reason(self) -> &'static str {
        match self {
            Self::Unreadable => "left out, since they cannot be read",
            Self::NoFix => "left out, since the receiver had no fix",
            Self::NoPlace => "left out, since they have no place",
            Self::Jump => {
                "left out, since the receiver cannot have moved there from the rows about them"
            }
            Self::ClockBack => "left out, since the receiver's clock was set between rows",
            Self::Copy => "copies of earlier rows, which count once",
        }
    }
}

/// The rows of one cause.
#[derive(Clone, Debug, Default, PartialEq)]
struct Excluded {
    rows: u64,
    /// The first of them, each with its line.
    named: Vec<(u64, String)>,
}

/// The rows of a file that are left out since they cannot be believed.
#[derive(Debug, Default)]
pub(super) struct Exclusions {
    causes: BTreeMap<Cause, Excluded>,
    /// The error of the first row, for a file that has too many of them.
    first: Option<RecordingError>,
    bad: u64,
}

impl Exclusions {
    /// Adds a row that is left out for an error.
    pub(super) fn add(&mut self, cause: Cause, line: u64, error: RecordingError) {
        let text = match &error {
            RecordingError::Field { column, value, problem, .. } => {
                format!("line {line}, {column}: {value:?} {problem}")
            }
            error => {
                let text = error.to_string();
                let at = text.find(&format!("line {line}"));
                at.and_then(|at| text.get(at..)).unwrap_or(&text).to_owned()
            }
        };
        self.name(cause, line, text);
        // A copy takes nothing away from the file.
        if cause != Cause::Copy {
            self.bad += 1;
            self.first.get_or_insert(error);
        }
    }

    /// Adds a row that is left out, but is no fault of the file.
    pub(super) fn note(&mut self, cause: Cause, line: u64, what: &str) {
        self.name(cause, line, format!("line {line} {what}"));
    }

    fn name(&mut self, cause: Cause, line: u64, text: String) {
        let excluded = self.causes.entry(cause).or_default();
        excluded.rows += 1;
        excluded.named.push((line, text));
        // Causes are looked for one after the other, but lines are named in the file's order.
        if excluded.named.len() > NAMED {
            excluded.named.sort_by_key(|(line, _)| *line);
            excluded.named.truncate(NAMED);
        }
    }

    /// Refuses a file of which more than half of the rows cannot be believed.
    pub(super) fn check(&mut self, kept: u64) -> Result<(), RecordingError> {
        if self.bad <= kept {
            return Ok(());
        }
        let bad = self.bad;
        let rows = bad + kept;
        match self.first.take() {
            None => Ok(()),
            Some(first) if bad == 1 => Err(first),
            Some(first) => Err(RecordingError::MostlyBad { first: Box::new(first), bad, rows }),
        }
    }

    /// A remark for each cause.
    pub(super) fn remarks(&self, file: &str, rows: u64) -> Vec<Remark> {
        let remark = |(cause, excluded): (&Cause, &Excluded)| {
            let mut named = excluded.named.clone();
            named.sort_by_key(|(line, _)| *line);
            let lines: Vec<&str> = named.iter().map(|(_, text)| text.as_str()).collect();
            let more = excluded.rows - lines.len() as u64;
            let more = if more > 0 { format!("; and {more} more") } else { String::new() };
            let count = excluded.rows;
            let reason = cause.reason();
            let text =
                format!("{file}: {count} of {rows} rows {reason}: {}{more}", lines.join("; "));
            Remark::new(cause.code(), text)
        };
        self.causes.iter().map(remark).collect()
    }
}
