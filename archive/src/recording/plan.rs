use std::{borrow::Cow, collections::BTreeMap};

use super::{
    Band, Column, Keep, Mapping, ReadOptions, RecordingError, Source, TimeZone, UtmZone,
    beside::Joined, column::Kind, dates::Times, plain, table::Table,
};

/// A mapping fitted to one file's header.
pub(super) struct Plan {
    pub origins: BTreeMap<Column, Origin>,
    /// The columns of `origins`, a bit each: most are looked for in every row, and missing.
    present: u64,
    pub rules: Vec<Rule>,
    /// The tables beside the file.
    pub joined: Vec<Joined>,
    /// The columns that become rows of their own; empty where the mapping melts nothing.
    pub melted: Vec<Melted>,
    /// True if levels are written without their sign.
    pub negate_levels: bool,
    /// The way in which times are written.
    pub times: Times,
    /// The file's columns that nothing reads.
    pub ignored: Vec<String>,
    /// The names of the file's columns.
    pub names: Vec<String>,
}

/// A column that is of one beacon or drone.
pub(super) struct Melted {
    pub index: usize,
    pub name: String,
    pub column: String,
}

/// Source of a column's values.
pub(super) enum Origin {
    /// From cells of each row.
    Cells { indices: Vec<usize>, source: Source },
    /// From numbers of each row that are added.
    Sum { terms: Vec<Term>, source: Source },
    /// One value for every row.
    Fixed(String),
    /// From cells of the row of a table beside the file.
    Joined { table: usize, indices: Vec<usize>, source: Source },
    /// From easting, northing and zone of UTM, each a column's number; the zone may be stated.
    Utm { metres: [Metres; 2], zone: Zone, is_latitude: bool },
    /// The name of the melted column.
    MeltedName,
    /// The cell of the melted column.
    MeltedValue,
    /// The strongest of the bins from a cell on that lie in a band.
    Bins { low: usize, high: usize, step: usize, from: usize, first: f64, band: Band },
}

/// A column in metres, its scale and offset.
#[derive(Clone)]
pub(super) struct Metres {
    pub index: usize,
    pub source: Source,
}

/// The zone of UTM of a row.
#[derive(Clone, Copy)]
pub(super) enum Zone {
    /// In a column.
    Column(usize),
    /// One zone for all rows.
    Stated(UtmZone),
}

/// A column that is added, with its sign.
pub(super) struct Term {
    pub index: usize,
    pub sign: f64,
}

/// A rule of the mapping, with the place of its column.
pub(super) struct Rule {
    pub index: usize,
    pub keep: Keep,
    pub label: String,
}

/// Columns that exclude each other: both hold the same.
const CONFLICTS: [(Column, Column); 12] = [
    (Column::TimeS, Column::TimeUtc),
    (Column::LatDeg, Column::EastM),
    (Column::AltAglM, Column::AltM),
    (Column::AltAglM, Column::UpM),
    (Column::AltM, Column::UpM),
    (Column::AntennaDeg, Column::BoresightDegCompass),
    (Column::RssDbm, Column::RssDb),
    (Column::BearingDegCompass, Column::RelativeBearingDeg),
    (Column::TruthLatDeg, Column::TruthEastM),
    (Column::LatDeg, Column::TruthEastM),
    (Column::EastM, Column::TruthLatDeg),
    (Column::EastM, Column::AltM),
];

/// Columns that need another one.
const NEEDS: [(Column, Column); 17] = [
    (Column::LatDeg, Column::LonDeg),
    (Column::LonDeg, Column::LatDeg),
    (Column::EastM, Column::NorthM),
    (Column::NorthM, Column::EastM),
    (Column::AltM, Column::LatDeg),
    (Column::UpM, Column::EastM),
    (Column::AntennaDeg, Column::HeadingDegCompass),
    (Column::RelativeBearingDeg, Column::HeadingDegCompass),
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

/// Columns that a rover's track stands for.
const PLACES: [Column; 7] = [
    Column::LatDeg,
    Column::LonDeg,
    Column::AltAglM,
    Column::AltM,
    Column::EastM,
    Column::NorthM,
    Column::UpM,
];

/// Columns of which a recording has at least one. A range is a measurement where it has a σ.
const MEASUREMENTS: [Column; 7] = [
    Column::RssDbm,
    Column::RssDb,
    Column::BearingDegCompass,
    Column::RelativeBearingDeg,
    Column::RangeSigmaM,
    Column::RangeDifferenceM,
    Column::RssDifferenceDb,
];

impl Plan {
    /// Fits `mapping` and the tables beside the file to it; the options' constants override both,
    /// and their rover all places.
    pub(super) fn new(
        mapping: &Mapping,
        options: &ReadOptions,
        joined: Vec<Joined>,
        table: &Table<'_>,
    ) -> Result<Self, RecordingError> {
        let fixed = &options.constants;
        let mut origins = BTreeMap::new();
        for (column, value) in &mapping.constants {
            origins.insert(*column, Origin::Fixed(value.to_string()));
        }
        // The last one stays: what is in front of it in this list is not even looked for.
        let given = |column: &Column| {
            options.rover.is_some() && PLACES.contains(column)
                || fixed.contains_key(column)
                || joined.iter().any(|j| j.columns.contains_key(column))
        };
        for (column, source) in mapping.columns.iter().filter(|(column, _)| !given(column)) {
            let has = |name: &str| table.header().iter().any(|column| column == name);
            let terms = source.terms(has);
            if column.kind() != Kind::Text && terms.len() > 1 {
                let names: Vec<String> = terms.iter().map(|(name, _)| name.clone()).collect();
                if source.optional && table.indices_of(&names)?.is_none() {
                    continue;
                }
                let indices = table.require(&names, &mapping.name)?;
                let term = |(index, (_, sign))| Term { index, sign };
                let terms = indices.into_iter().zip(terms).map(term).collect();
                origins.insert(*column, Origin::Sum { terms, source: source.clone() });
                continue;
            }
            if source.optional && table.indices_of(&source.columns)?.is_none() {
                // Our own format knows the receiver by the names that others have for it, too.
                let other = (table.header().iter())
                    .filter(|_| *column == Column::Drone && mapping.name == "foxhunt")
                    .position(|name| plain::is_receiver(name));
                if let Some(index) = other {
                    let source = source.clone();
                    origins.insert(*column, Origin::Cells { indices: vec![index], source });
                }
                continue;
            }
            let indices = table.require(&source.columns, &mapping.name)?;
            origins.insert(*column, Origin::Cells { indices, source: source.clone() });
        }
        let mut melted = Vec::new();
        if let Some(melt) = &mapping.melt {
            for (index, column) in table.header().iter().enumerate() {
                if let Some(name) = melt.name_in(column) {
                    let name = name.to_owned();
                    let column = column.clone();
                    melted.push(Melted { index, name, column });
                }
            }
            if melted.is_empty() {
                return Err(table.missing_column(&melt.columns, &mapping.name));
            }
            origins.insert(melt.name, Origin::MeltedName);
            origins.insert(melt.value, Origin::MeltedValue);
        }
        for (number, joined) in joined.iter().enumerate() {
            for (column, (indices, source)) in &joined.columns {
                let indices = indices.clone();
                let source = source.clone();
                origins.insert(*column, Origin::Joined { table: number, indices, source });
            }
        }
        if let Some(spectrum) = &mapping.spectrum {
            let index = |column: &str| table.require_one(column, &mapping.name);
            let low = index(&spectrum.low)?;
            let high = index(&spectrum.high)?;
            let step = index(&spectrum.step)?;
            let band = options.band.ok_or_else(|| RecordingError::NoBand {
                file: table.file().to_owned(),
                format: mapping.name.clone(),
            })?;
            let from = table.header().len();
            let first = spectrum.first;
            let bins = Origin::Bins { low, high, step, from, first, band };
            origins.insert(spectrum.value, bins);
        }
        for (column, value) in fixed {
            origins.insert(*column, Origin::Fixed(value.to_string()));
        }
        read_utm(&mut origins, mapping, options, table)?;
        let mut rules = Vec::new();
        for keep in &mapping.keep {
            if keep.optional && table.index_of(&keep.column)?.is_none() {
                continue;
            }
            let index = table.require_one(&keep.column, &mapping.name)?;
            rules.push(Rule { index, label: label(keep), keep: keep.clone() });
        }
        let ignored = ignored(table.header(), &origins, &rules, &melted);
        let names = table.header().to_vec();
        let negate_levels = options.negate_levels;
        let zone = if mapping.utc { TimeZone::default() } else { options.time_zone };
        let times = Times { format: options.time_format, zone };
        let present = origins.keys().fold(0, |bits, column| bits | 1 << *column as u32);
        let plan =
            Self { origins, present, rules, joined, melted, negate_levels, times, ignored, names };
        plan.check(table.file(), table.header_line())?;
        // Seconds of any origin are UTC once an offset is stated.
        let is_in_utc = plan.has(Column::TimeUtc)
            || (plan.has(Column::TimeS) && options.clock_offset_s.abs() > 0.0);
        if let Some(rover) = &options.rover
            && !is_in_utc
        {
            return Err(RecordingError::Incomplete {
                file: table.file().to_owned(),
                line: table.header_line(),
                column: format!("the track {}", rover.file()),
                needs:
                    "time_utc (or time_s and --clock-offset-s with the time in UTC at which its \
                        clock showed 0)"
                        .to_owned(),
            });
        }
        Ok(plan)
    }

    /// Returns true if the recording has such a column, or a constant for it.
    pub(super) fn has(&self, column: Column) -> bool {
        self.present & 1 << column as u32 != 0
    }

    /// Returns a column's name in messages: the file's own name for it.
    pub(super) fn label(&self, column: Column) -> Cow<'static, str> {
        match self.origins.get(&column) {
            Some(
                Origin::Cells { source, .. }
                | Origin::Sum { source, .. }
                | Origin::Joined { source, .. },
            ) => Cow::Owned(source.label()),
            Some(Origin::Utm { metres: [east, north], .. }) => {
                Cow::Owned(format!("{} and {}", east.source.label(), north.source.label()))
            }
            _ => Cow::Borrowed(column.name()),
        }
    }

    /// The name that messages give to the columns of the receiver's place.
    pub(super) fn place_labels(&self) -> String {
        let [first, second] = if self.has(Column::EastM) {
            [Column::EastM, Column::NorthM]
        } else {
            [Column::LatDeg, Column::LonDeg]
        };
        format!("{}, {}", self.label(first), self.label(second))
    }

    fn check(&self, file: &str, line: u64) -> Result<(), RecordingError> {
        let label = |column| self.label(column).into_owned();
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
        let levels = [Column::RssDbm, Column::RssDb];
        for column in [Column::AttenuationDb, Column::GainDb] {
            if self.has(column) && !levels.iter().any(|level| self.has(*level)) {
                return incomplete(label(column), Column::RssDbm.name());
            }
        }
        let bearings = [Column::BearingDegCompass, Column::RelativeBearingDeg];
        if self.has(Column::BearingSigmaDeg) && !bearings.iter().any(|column| self.has(*column)) {
            return incomplete(label(Column::BearingSigmaDeg), Column::BearingDegCompass.name());
        }
        for joined in &self.joined {
            // Without a name of its own a drone has the file's.
            if joined.by.contains(&Column::Beacon) && !self.has(Column::Beacon) {
                return incomplete(joined.file.clone(), Column::Beacon.name());
            }
        }
        if !MEASUREMENTS.iter().any(|column| self.has(*column)) {
            let names = MEASUREMENTS.map(Column::name).join(" or ");
            return incomplete("a recording".to_owned(), &names);
        }
        Ok(())
    }
}

/// Makes degrees of metres whose zone of UTM is known.
fn read_utm(
    origins: &mut BTreeMap<Column, Origin>,
    mapping: &Mapping,
    options: &ReadOptions,
    table: &Table<'_>,
) -> Result<(), RecordingError> {
    let stated = options.utm_zone.map(Zone::Stated);
    let zone = match (stated, &mapping.utm_zone) {
        (Some(zone), _) => zone,
        (None, Some(column)) => Zone::Column(table.require_one(column, &mapping.name)?),
        (None, None) => return Ok(()),
    };
    let metres = [Column::EastM, Column::NorthM].map(|column| match origins.get(&column) {
        Some(Origin::Cells { indices, source }) => match indices.as_slice() {
            [index] => Some(Metres { index: *index, source: source.clone() }),
            _ => None,
        },
        _ => None,
    });
    let [Some(east), Some(north)] = metres else { return Ok(()) };
    origins.remove(&Column::EastM);
    origins.remove(&Column::NorthM);
    for (column, is_latitude) in [(Column::LatDeg, true), (Column::LonDeg, false)] {
        let metres = [east.clone(), north.clone()];
        origins.insert(column, Origin::Utm { metres, zone, is_latitude });
    }
    Ok(())
}

fn ignored(
    header: &[String],
    origins: &BTreeMap<Column, Origin>,
    rules: &[Rule],
    melted: &[Melted],
) -> Vec<String> {
    let read = |wanted: usize| {
        let cells = origins.values().flat_map(|origin| match origin {
            Origin::Cells { indices, .. } => indices.clone(),
            Origin::Sum { terms, .. } => terms.iter().map(|term| term.index).collect(),
            Origin::Bins { low, high, step, .. } => vec![*low, *high, *step],
            Origin::Utm { metres: [east, north], zone, .. } => {
                let zone = if let Zone::Column(index) = zone { Some(*index) } else { None };
                [east.index, north.index].into_iter().chain(zone).collect()
            }
            _ => Vec::new(),
        });
        let rules = rules.iter().map(|rule| rule.index);
        let melted = melted.iter().map(|melted| melted.index);
        cells.chain(rules).chain(melted).any(|index| index == wanted)
    };
    let unread = header.iter().enumerate().filter(|(index, _)| !read(*index));
    // A column that was named `-` is not to be read.
    unread.filter(|(_, name)| *name != "-").map(|(_, name)| name.clone()).collect()
}

fn label(keep: &Keep) -> String {
    let mut parts = Vec::new();
    parts.extend(keep.min.map(|min| format!("{} ≥ {min}", keep.column)));
    parts.extend(keep.max.map(|max| format!("{} ≤ {max}", keep.column)));
    parts.extend(keep.equals.as_ref().map(|value| format!("{} = {value}", keep.column)));
    parts.extend(keep.differs.as_ref().map(|value| format!("{} ≠ {value}", keep.column)));
    parts.join(" and ")
}
