use std::{
    borrow::Cow,
    cell::{Cell, RefCell},
    collections::{BTreeMap, BTreeSet, VecDeque},
    sync::Arc,
};

use foxhunt_wire::geodesy::Geodetic;

use super::{
    Band, Column, Details, FieldProblem, North, RecordingError, Rover, Source, UtmZone, Value,
    column::Kind,
    coordinate::{degrees, is_german},
    dates::{clock_seconds, is_date},
    plan::{Melted, Metres, Origin, Plan, Rule, Term, Zone},
    table::Row,
};

/// One row, read by a plan.
pub(super) struct Reader<'r> {
    pub plan: &'r Plan,
    pub row: &'r Row,
    /// Melted column that it is read for, where the plan has such.
    pub melted: Option<&'r Melted>,
    /// The name of a drone that has none of its own.
    pub stem: &'r str,
    /// North from which angles are counted.
    pub north: North,
    /// A day in seconds since 1970, for rows without a time in UTC.
    pub date_s: Option<f64>,
    /// Path of the receiver, and the seconds that make the row's time UTC.
    pub rover: Option<(&'r Rover, f64)>,
    /// The first place of the file that was too far from the frame's origin.
    pub astray: &'r Cell<Option<Geodetic>>,
    /// Names of the file's receivers and beacons, and details, that rows share.
    pub shared: &'r Shared,
}

/// Names of a receiver and of a beacon.
type DroneAndBeacon = (Arc<str>, Option<Arc<str>>);

/// Names and details that rows share: a file has many rows and few of them.
#[derive(Debug, Default)]
pub(super) struct Shared {
    known: RefCell<BTreeSet<Arc<str>>>,
    last: RefCell<Option<Arc<str>>>,
    /// Details with nothing but names.
    named: RefCell<BTreeMap<DroneAndBeacon, Arc<Details>>>,
    recent: RefCell<VecDeque<Arc<Details>>>,
}

/// Details with which the next ones are compared.
const RECENT_DETAILS: usize = 32;

impl Shared {
    /// Returns the one copy of details.
    pub(super) fn details(&self, details: Details) -> Arc<Details> {
        let mut recent = self.recent.borrow_mut();
        if let Some(known) = recent.iter().find(|known| ***known == details) {
            return Arc::clone(known);
        }
        let key = (details.drone.clone(), details.beacon.clone());
        let names = Details { drone: key.0.clone(), beacon: key.1.clone(), ..Details::default() };
        let shared = if details == names {
            Arc::clone(self.named.borrow_mut().entry(key).or_insert_with(|| Arc::new(details)))
        } else {
            Arc::new(details)
        };
        recent.push_front(Arc::clone(&shared));
        recent.truncate(RECENT_DETAILS);
        shared
    }

    /// Returns the one copy of a name.
    pub(super) fn name(&self, name: &str) -> Arc<str> {
        if let Some(last) = self.last.borrow().as_ref()
            && **last == *name
        {
            return Arc::clone(last);
        }
        let mut known = self.known.borrow_mut();
        let shared = known.get(name).cloned().unwrap_or_else(|| name.into());
        known.insert(Arc::clone(&shared));
        self.last.replace(Some(Arc::clone(&shared)));
        shared
    }
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
        let is = |value: &Value| value.is(cell);
        if rule.keep.equals.as_ref().is_some_and(|value| !is(value))
            || rule.keep.differs.as_ref().is_some_and(is)
        {
            return Ok(false);
        }
        if rule.keep.min.is_none() && rule.keep.max.is_none() {
            return Ok(true);
        }
        // A cell that holds nothing is not within any bounds.
        if cell.is_empty() {
            return Ok(false);
        }
        let value = self
            .row
            .parse(cell)
            .ok_or_else(|| self.row.wrong(&rule.keep.column, cell, FieldProblem::NotANumber))?;
        // NaN is within no bounds either.
        Ok(rule.keep.min.is_none_or(|min| value >= min)
            && rule.keep.max.is_none_or(|max| value <= max))
    }

    /// The error that this row's column is wrong.
    pub(super) fn wrong(&self, column: Column, problem: FieldProblem) -> RecordingError {
        let label = self.plan.label(column);
        match self.plan.origins.get(&column) {
            Some(Origin::Cells { indices, source }) => {
                let cells = self.row.joined(indices, &source.between).unwrap_or_default();
                self.row.wrong(&label, &cells, problem)
            }
            Some(Origin::Sum { terms, .. }) => {
                let cells: Vec<&str> = terms.iter().map(|term| self.row.cell(term.index)).collect();
                self.row.wrong(&label, &cells.join(" and "), problem)
            }
            Some(Origin::Joined { table, indices, source }) => {
                let row = self.beside(*table).ok().flatten().unwrap_or(self.row);
                let cells = row.joined(indices, &source.between).unwrap_or_default();
                row.wrong(&label, &cells, problem)
            }
            Some(Origin::Fixed(text)) => self.row.wrong(&label, text, problem),
            Some(Origin::MeltedName | Origin::MeltedValue) => {
                let cell = self.melted.map_or("", |melted| self.row.cell(melted.index));
                let label = self.melted.map_or("", |melted| &melted.column);
                self.row.wrong(label, cell, problem)
            }
            Some(Origin::Utm { metres: [east, north], .. }) => {
                let cells = [east, north].map(|of| self.row.cell(of.index)).join(", ");
                self.row.wrong(&label, &cells, problem)
            }
            Some(Origin::Bins { .. }) | None => self.row.wrong(&label, "", problem),
        }
    }

    /// The row of a table beside the file that this one is joined with.
    fn beside(&self, table: usize) -> Result<Option<&Row>, RecordingError> {
        let Some(joined) = self.plan.joined.get(table) else { return Ok(None) };
        let mut names = Vec::new();
        for column in &joined.by {
            let name = match self.text(*column)? {
                None if *column == Column::Drone => self.stem.to_owned(),
                None => return Ok(None),
                Some(name) => name.into_owned(),
            };
            names.push(name);
        }
        joined.row(&names, |beside| RecordingError::NotBeside {
            file: self.row.file().to_owned(),
            line: self.row.line(),
            name: names.join(", "),
            beside,
        })
    }

    /// A text; `None` where the file or the row has none.
    pub(super) fn text(&self, column: Column) -> Result<Option<Cow<'_, str>>, RecordingError> {
        if !self.plan.has(column) {
            return Ok(None);
        }
        match self.plan.origins.get(&column) {
            None => Ok(None),
            Some(Origin::Bins { low, high, step, from, first, band }) => {
                let level = self.level([*low, *high, *step], *from, *first, *band)?;
                Ok(level.map(|level| Cow::Owned(level.to_string())))
            }
            Some(Origin::Fixed(text)) => Ok(Some(Cow::Borrowed(text))),
            Some(Origin::Cells { indices, source }) => self.row.value(indices, source),
            Some(Origin::Sum { terms, source }) => {
                Ok(self.sum(column, terms, source)?.map(|sum| Cow::Owned(sum.to_string())))
            }
            Some(Origin::Joined { table, indices, source }) => match self.beside(*table)? {
                Some(row) => row.value(indices, source),
                None => Ok(None),
            },
            Some(Origin::Utm { metres, zone, is_latitude }) => {
                let degrees = self.utm_degrees(metres, *zone)?;
                let [lat, lon] = degrees.map_or([None; 2], |degrees| degrees.map(Some));
                let degree = if *is_latitude { lat } else { lon };
                Ok(degree.map(|degree| Cow::Owned(degree.to_string())))
            }
            Some(Origin::MeltedName) => {
                Ok(self.melted.map(|melted| Cow::Borrowed(melted.name.as_str())))
            }
            Some(Origin::MeltedValue) => {
                let cell = self.melted.map(|melted| self.row.cell(melted.index));
                Ok(cell.filter(|cell| !cell.is_empty()).map(Cow::Borrowed))
            }
        }
    }

    /// Latitude and longitude of a place in UTM; `None` if both of its numbers are missing.
    fn utm_degrees(
        &self,
        metres: &[Metres; 2],
        zone: Zone,
    ) -> Result<Option<[f64; 2]>, RecordingError> {
        /// Bounds of an easting and a northing within a zone.
        const BOUNDS: [(f64, f64); 2] = [(0.0, 1e6), (0.0, 1e7)];
        let mut numbers = [None; 2];
        for ((number, of), (min, max)) in numbers.iter_mut().zip(metres).zip(BOUNDS) {
            let Some(text) = self.row.value(&[of.index], &of.source)? else { continue };
            let wrong = |problem| self.row.wrong(&of.source.label(), &text, problem);
            let raw = self.row.parse(&text).ok_or_else(|| wrong(FieldProblem::NotANumber))?;
            let value = raw * of.source.scale + of.source.offset;
            if !(min..=max).contains(&value) {
                return Err(wrong(FieldProblem::OutOfRange { min, max }));
            }
            *number = Some(value);
        }
        let missing = |of: &Metres| self.row.wrong(&of.source.label(), "", FieldProblem::Missing);
        let [east_m, north_m] = match (numbers, metres) {
            ([Some(east), Some(north)], _) => [east, north],
            ([None, None], _) => return Ok(None),
            ([None, _], [east, _]) => return Err(missing(east)),
            (_, [_, north]) => return Err(missing(north)),
        };
        let zone = match zone {
            Zone::Stated(zone) => zone,
            Zone::Column(index) => {
                let cell = self.row.cell(index);
                let label = self.plan.names.get(index).map_or("", String::as_str);
                cell.parse::<UtmZone>()
                    .map_err(|why| self.row.wrong(label, cell, FieldProblem::NotAZone(why)))?
            }
        };
        Ok(Some(zone.degrees(east_m, north_m)))
    }

    /// The sum of cells; `None` if all are missing.
    fn sum(
        &self,
        column: Column,
        terms: &[Term],
        source: &Source,
    ) -> Result<Option<f64>, RecordingError> {
        let mut sum = 0.0;
        let mut missing = 0;
        for term in terms {
            let cell = self.row.cell(term.index);
            if cell.is_empty() || source.missing.iter().any(|value| value.is(cell)) {
                missing += 1;
                continue;
            }
            let number = self.row.parse(cell);
            sum +=
                term.sign * number.ok_or_else(|| self.wrong(column, FieldProblem::NotANumber))?;
        }
        match missing {
            0 => Ok(Some(sum)),
            missing if missing == terms.len() => Ok(None),
            _ => Err(self.wrong(column, FieldProblem::Missing)),
        }
    }

    /// Correction of the receiver's levels: attenuation before it less gain, in dB.
    pub(super) fn before_receiver_db(&self) -> Result<f64, RecordingError> {
        let mut added = 0.0;
        for (column, sign) in [(Column::AttenuationDb, 1.0), (Column::GainDb, -1.0)] {
            if self.plan.has(column) {
                let missing = || self.wrong(column, FieldProblem::Missing);
                added += sign * self.number(column)?.ok_or_else(missing)?;
            }
        }
        Ok(added)
    }

    /// A number within the column's bounds; `None` where the file or the row has none.
    #[inline(always)]
    pub(super) fn number(&self, column: Column) -> Result<Option<f64>, RecordingError> {
        // Each row reads two dozen columns, most of which the file lacks.
        if self.plan.has(column) { self.present_number(column) } else { Ok(None) }
    }

    fn present_number(&self, column: Column) -> Result<Option<f64>, RecordingError> {
        let Some(text) = self.text(column)? else { return Ok(None) };
        let raw = match self.row.parse(&text) {
            Some(raw) => raw,
            None => self.written(column, &text).map_err(|problem| self.wrong(column, problem))?,
        };
        let origin = self.plan.origins.get(&column);
        let value = match origin {
            Some(
                Origin::Cells { source, .. }
                | Origin::Sum { source, .. }
                | Origin::Joined { source, .. },
            ) => {
                let value = raw * source.scale + source.offset;
                if source.wrap { value.rem_euclid(360.0) } else { value }
            }
            _ => raw,
        };
        let is_stated = matches!(origin, Some(Origin::Fixed(_)));
        let is_negated = self.plan.negate_levels && column.is_level() && !is_stated;
        let value = if is_negated { -value } else { value };
        if !value.is_finite() {
            return Err(self.wrong(column, FieldProblem::NotFinite));
        }
        match column.kind() {
            _ if column.admits(value) => Ok(Some(value)),
            Kind::Number(min, max) if column.is_level() && value > max => {
                Err(self.wrong(column, FieldProblem::Unsigned { min, max }))
            }
            Kind::Number(min, max) => {
                Err(self.wrong(column, FieldProblem::OutOfRange { min, max }))
            }
            Kind::Index(max) => Err(self.wrong(column, FieldProblem::NotWhole { max })),
            Kind::Text => Err(self.wrong(column, FieldProblem::NotANumber)),
        }
    }

    /// The number that a text stands for: degrees with minutes or a hemisphere, a time of the day.
    fn written(&self, column: Column, text: &str) -> Result<f64, FieldProblem> {
        match column {
            Column::LatDeg | Column::TruthLatDeg => degrees(text, true),
            Column::LonDeg | Column::TruthLonDeg => match degrees(text, false) {
                // In a table with German names O is Ost.
                Err(FieldProblem::EastOrWest) if is_german(&self.plan.label(column)) => {
                    degrees(&text.replace(['O', 'o'], "E"), false)
                }
                degrees => degrees,
            },
            Column::TimeS if is_date(text) => Err(FieldProblem::Date),
            Column::TimeS => clock_seconds(text).ok_or(FieldProblem::NotANumber),
            _ => Err(FieldProblem::NotANumber),
        }
    }

    /// The strongest of the bins whose middle lies in a band, or the bin that holds the band's
    /// middle; `None` if the row is of other frequencies, or no power was measured.
    fn level(
        &self,
        columns: [usize; 3],
        from: usize,
        first: f64,
        band: Band,
    ) -> Result<Option<f64>, RecordingError> {
        let [low, high, step] = columns.map(|index| {
            let cell = self.row.cell(index);
            let number = cell.parse::<f64>().ok().filter(|number| number.is_finite());
            let label = self.plan.names.get(index).map_or("", String::as_str);
            number.ok_or_else(|| self.row.wrong(label, cell, FieldProblem::NotANumber))
        });
        let low = low?;
        let high = high?;
        let step = step?;
        let bins = (high - low) / step;
        if step.is_nan() || step <= 0.0 || bins.is_nan() || bins < 0.5 {
            let label = self.plan.names.get(columns[2]).map_or("", String::as_str);
            let problem = FieldProblem::OutOfRange { min: f64::MIN_POSITIVE, max: high - low };
            return Err(self.row.wrong(label, self.row.cell(columns[2]), problem));
        }
        let reach = 0.5 * band.bandwidth_hz.max(step) * (1.0 + 1e-9);
        let mut strongest = None::<f64>;
        let mut middle = low + first * step;
        for (cell, _) in self.row.cells_from(from).zip(0..whole(bins.round())) {
            if (middle - band.frequency_hz).abs() <= reach {
                let number = cell.parse::<f64>();
                let level = number.map_err(|_| {
                    self.row.wrong(&format!("{middle} Hz"), cell, FieldProblem::NotANumber)
                })?;
                // No power at all is −∞ dB, or NaN.
                if level.is_finite() {
                    strongest = Some(strongest.map_or(level, |other| other.max(level)));
                }
            }
            middle += step;
        }
        Ok(strongest)
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

    /// The error that the row's time is wrong.
    pub(super) fn of_time(&self, problem: FieldProblem) -> RecordingError {
        let utc = self.plan.has(Column::TimeUtc);
        self.wrong(if utc { Column::TimeUtc } else { Column::TimeS }, problem)
    }

    /// The time in seconds; where the recording has times, every row has one.
    pub(super) fn time(&self) -> Result<Option<f64>, RecordingError> {
        if self.plan.has(Column::TimeUtc) {
            let missing = || self.wrong(Column::TimeUtc, FieldProblem::Missing);
            let text = self.text(Column::TimeUtc)?.ok_or_else(missing)?;
            let [scale, offset] = match self.plan.origins.get(&Column::TimeUtc) {
                Some(Origin::Cells { source, .. }) => [source.scale, source.offset],
                _ => [1.0, 0.0],
            };
            let number = self.row.parse(&text).map(|number| number * scale + offset);
            let number = number.and_then(|number| self.plan.times.of_number(number));
            let seconds = number.or_else(|| self.plan.times.of_text(&text));
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

/// A whole number that is kept within 32 bits.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "casts saturate")]
pub(super) fn whole(value: f64) -> u32 {
    value as u32
}
