use std::borrow::Cow;

use chrono::NaiveDateTime;

use super::{
    Column, FieldProblem, RecordingError,
    column::Kind,
    plan::{Origin, Plan, Rule},
    table::Row,
};

/// One row, read by a plan.
pub(super) struct Reader<'r> {
    pub(super) plan: &'r Plan,
    pub(super) row: &'r Row<'r>,
}

impl Reader<'_> {
    /// The first rule of the mapping that the row does not pass.
    pub(super) fn first_failed(&self) -> Result<Option<usize>, RecordingError> {
        for (index, rule) in self.plan.rules.iter().enumerate() {
            if !self.passes(rule)? {
                return Ok(Some(index));
            }
        }
        Ok(None)
    }

    fn passes(&self, rule: &Rule) -> Result<bool, RecordingError> {
        let cell = self.row.cell(rule.index);
        if rule.keep.equals.as_ref().is_some_and(|value| !value.is(cell)) {
            return Ok(false);
        }
        if rule.keep.min.is_none() && rule.keep.max.is_none() {
            return Ok(true);
        }
        // A cell that holds nothing is not within any bounds.
        if cell.is_empty() {
            return Ok(false);
        }
        let value: f64 = cell
            .parse()
            .map_err(|_| self.row.wrong(&rule.keep.column, cell, FieldProblem::NotANumber))?;
        // NaN is within no bounds either.
        Ok(rule.keep.min.is_none_or(|min| value >= min)
            && rule.keep.max.is_none_or(|max| value <= max))
    }

    /// The error that this row's column is wrong.
    pub(super) fn wrong(&self, column: Column, problem: FieldProblem) -> RecordingError {
        let cell = match self.plan.origins.get(&column) {
            Some(Origin::Cell { index, .. }) => self.row.cell(*index),
            Some(Origin::Fixed(text)) => text,
            None => "",
        };
        self.row.wrong(self.plan.label(column), cell, problem)
    }

    /// A text; `None` where the file or the row has none.
    pub(super) fn text(&self, column: Column) -> Result<Option<Cow<'_, str>>, RecordingError> {
        let (index, source) = match self.plan.origins.get(&column) {
            None => return Ok(None),
            Some(Origin::Fixed(text)) => return Ok(Some(Cow::Borrowed(text))),
            Some(Origin::Cell { index, source }) => (*index, source),
        };
        let cell = self.row.cell(index);
        if cell.is_empty() || source.missing.iter().any(|value| value.is(cell)) {
            return Ok(None);
        }
        if source.lookup.is_empty() {
            return Ok(Some(Cow::Borrowed(cell)));
        }
        match source.lookup.get(cell) {
            Some(value) => Ok(Some(Cow::Owned(value.to_string()))),
            None => Err(self.wrong(column, FieldProblem::NotInLookup)),
        }
    }

    /// A number within the column's bounds.
    pub(super) fn number(&self, column: Column) -> Result<Option<f64>, RecordingError> {
        let Some(text) = self.text(column)? else { return Ok(None) };
        let raw: f64 = text.parse().map_err(|_| self.wrong(column, FieldProblem::NotANumber))?;
        let value = match self.plan.origins.get(&column) {
            Some(Origin::Cell { source, .. }) => raw * source.scale + source.offset,
            _ => raw,
        };
        if !value.is_finite() {
            return Err(self.wrong(column, FieldProblem::NotFinite));
        }
        match column.kind() {
            _ if column.admits(value) => Ok(Some(value)),
            Kind::Number(min, max) => {
                Err(self.wrong(column, FieldProblem::OutOfRange { min, max }))
            }
            Kind::Index(max) => Err(self.wrong(column, FieldProblem::NotWhole { max })),
            Kind::Text => Err(self.wrong(column, FieldProblem::NotANumber)),
        }
    }

    /// Two numbers that come together or not at all.
    pub(super) fn pair(
        &self,
        first: Column,
        second: Column,
    ) -> Result<Option<(f64, f64)>, RecordingError> {
        match (self.number(first)?, self.number(second)?) {
            (Some(a), Some(b)) => Ok(Some((a, b))),
            (None, None) => Ok(None),
            (None, Some(_)) => Err(self.wrong(first, FieldProblem::Missing)),
            (Some(_), None) => Err(self.wrong(second, FieldProblem::Missing)),
        }
    }

    /// The time in seconds; where the recording has times, every row has one.
    pub(super) fn time(&self) -> Result<Option<f64>, RecordingError> {
        if self.plan.has(Column::TimeUtc) {
            let missing = || self.wrong(Column::TimeUtc, FieldProblem::Missing);
            let text = self.text(Column::TimeUtc)?.ok_or_else(missing)?;
            let seconds = seconds_since_1970(&text);
            return Ok(Some(
                seconds.ok_or_else(|| self.wrong(Column::TimeUtc, FieldProblem::NotATime))?,
            ));
        }
        let time = self.number(Column::TimeS)?;
        if time.is_none() && self.plan.has(Column::TimeS) {
            return Err(self.wrong(Column::TimeS, FieldProblem::Missing));
        }
        Ok(time)
    }
}

/// `YYYY-MM-DD HH:MM:SS`, with a `T` for the space, a fraction and a `Z` if one likes.
fn seconds_since_1970(text: &str) -> Option<f64> {
    let text = text.strip_suffix('Z').unwrap_or(text);
    let parse = |format| NaiveDateTime::parse_from_str(text, format).ok();
    let time = parse("%Y-%m-%d %H:%M:%S%.f").or_else(|| parse("%Y-%m-%dT%H:%M:%S%.f"))?.and_utc();
    #[expect(clippy::cast_precision_loss, reason = "chrono's years end long before 2^53 seconds")]
    let whole = time.timestamp() as f64;
    Some(whole + f64::from(time.timestamp_subsec_nanos()) * 1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_seconds_since_1970() {
        // `date -u -d '2021-03-21 16:51:48' +%s`
        assert_eq!(seconds_since_1970("2021-03-21 16:51:48"), Some(1_616_345_508.0));
        assert_eq!(seconds_since_1970("2021-03-21T16:51:48.25Z"), Some(1_616_345_508.25));
        assert_eq!(seconds_since_1970("1969-12-31 23:59:59"), Some(-1.0));
        for wrong in ["2021-02-30 00:00:00", "2021-03-21", "16:51:48", "2021-03-21 16:51:48 x"] {
            assert_eq!(seconds_since_1970(wrong), None, "{wrong}");
        }
    }
}
