use std::{borrow::Cow, collections::BTreeMap};

use super::{
    Column, FieldProblem, Mapping, North, ReadOptions, RecordingError, Source, TimeFormat, Turns,
    coordinate,
    dates::{clock_seconds, is_date, is_day, is_serial},
    near_miss::near_miss,
    table::{Table, shown},
};

/// The name of the mapping that is made for a table with columns of common names.
pub(super) const PLAIN: &str = "plain";

/// Common names of columns in English, German, French and Spanish, the most usual first, without
/// unit, signs and capitals.
const NAMES: [(Column, &[&str]); 12] = [
    (
        Column::LatDeg,
        &[
            "lat",
            "latitude",
            "gpslat",
            "gpslatitude",
            "currentlatitude",
            "breite",
            "breitengrad",
            "geographischebreite",
            "latitud",
            "late7",
        ],
    ),
    (
        Column::LonDeg,
        &[
            "lon",
            "lng",
            "long",
            "longitude",
            "gpslon",
            "gpslong",
            "gpslongitude",
            "currentlongitude",
            "länge",
            "laenge",
            "längengrad",
            "laengengrad",
            "geographischelänge",
            "longitud",
            "lone7",
        ],
    ),
    (Column::EastM, &["east", "easting", "x", "ostwert", "est", "este"]),
    (Column::NorthM, &["north", "northing", "y", "nordwert", "nord", "norte"]),
    (
        Column::TimeS,
        &[
            "datetime",
            "utc",
            "time",
            "timestamp",
            "t",
            "seconds",
            "second",
            "sec",
            "epoch",
            "unixtime",
            "firstseen",
            "zeit",
            "zeitstempel",
            "uhrzeit",
            "datumuhrzeit",
            "horodatage",
            "dateheure",
            "heure",
            "temps",
            "fechahora",
            "hora",
            "tiempo",
        ],
    ),
    (
        Column::RssDb,
        &[
            "rssi",
            "rss",
            "signalstrength",
            "signallevel",
            "signal",
            "level",
            "strength",
            "power",
            "receivedpower",
            "averagepower",
            "maxpeakpower",
            "pulseaveragepower",
            "rxpower",
            "dbm",
            "snr",
            "smeter",
            "pegel",
            "empfangspegel",
            "signalstärke",
            "signalstaerke",
            "feldstärke",
            "feldstaerke",
            "signalpegel",
            "empfangsstärke",
            "empfangsleistung",
            "niveau",
            "niveausignal",
            "niveaudesignal",
            "niveaudusignal",
            "niveaureçu",
            "intensitédusignal",
            "puissance",
            "puissancedusignal",
            "puissancereçue",
            "nivel",
            "niveldeseñal",
            "señal",
            "intensidad",
            "intensidaddeseñal",
            "intensidaddelaseñal",
            "potencia",
            "potenciadeseñal",
            "potenciarecibida",
        ],
    ),
    (
        Column::ReceiverSigmaM,
        &[
            "accuracy",
            "horizontalaccuracy",
            "gpsaccuracy",
            "accuracymeters",
            "accuracymetres",
            "hacc",
            "eph",
            "genauigkeit",
            "précision",
            "precision",
            "precisión",
        ],
    ),
    (
        Column::AttenuationDb,
        &["attenuation", "attenuator", "dämpfung", "daempfung", "atténuation", "atenuación"],
    ),
    (
        Column::BearingDegCompass,
        &["bearing", "azimuth", "az", "azimut", "peilung", "relèvement", "relevement", "acimut"],
    ),
    (Column::BearingSigmaDeg, &["bearingsigma", "bearingerror", "sigma"]),
    (
        Column::Beacon,
        &[
            "beacon",
            "tag",
            "tagid",
            "transmitter",
            "animal",
            "animalid",
            "individual",
            "mac",
            "bssid",
            "address",
            "sender",
            "émetteur",
            "emetteur",
            "balise",
            "emisor",
            "transmisor",
            "baliza",
            "gid",
            "groupid",
            "collar",
            "collarid",
        ],
    ),
    (
        Column::Drone,
        &[
            "drone",
            "receiver",
            "station",
            "node",
            "gateway",
            "anchor",
            "observer",
            "empfänger",
            "empfaenger",
            "beobachter",
            "récepteur",
            "recepteur",
            "receptor",
            "estación",
            "estacion",
        ],
    ),
];

/// Common names of a day, which a time in another column is of.
const DAYS: [&str; 4] = ["date", "datum", "fecha", "jour"];

/// Common names of a latitude and a longitude, of a place of UTM or of a grid reference in one
/// cell.
const PAIRS: [&str; 22] = [
    "latlon",
    "latlng",
    "latlong",
    "latitudelongitude",
    "coordinates",
    "coordinate",
    "coords",
    "gpscoordinates",
    "koordinaten",
    "gpskoordinaten",
    "coordonnées",
    "coordonneesgps",
    "coordonnéesgps",
    "coordenadas",
    "utm",
    "utmcoordinates",
    "utmkoordinaten",
    "mgrs",
    "utmref",
    "usng",
    "gridreference",
    "gridref",
];

/// Common names of a longitude and a latitude in one cell.
const TURNED_PAIRS: [&str; 3] = ["lonlat", "lnglat", "longlat"];

/// Common names of a zone of UTM.
const ZONES: [&str; 3] = ["zone", "utmzone", "utm"];

/// Names that tell that a number is a date.
const DATES: [&str; 8] =
    ["date", "datum", "fecha", "datetime", "datumuhrzeit", "dateheure", "fechahora", "horodatage"];

/// Names that tell that a number is in seconds.
const SECONDS: [&str; 4] = ["seconds", "second", "sec", "t"];

/// Ends of the name of a bearing that is counted from magnetic North.
const MAGNETIC: [&str; 6] =
    ["magnetic", "mag", "magnetisch", "missweisend", "magnétique", "magnético"];

/// Ends of the name of a bearing that is counted from true North.
const TRUE_NORTH: [&str; 4] = ["true", "rechtweisend", "vrai", "verdadero"];

/// Names that may be a bearing to the transmitter or the direction of the receiver.
const DOUBTFUL: [&str; 9] =
    ["heading", "direction", "course", "doa", "angle", "richtung", "kurs", "rumbo", "dirección"];

/// A header of a file, as far as its columns have common names.
struct Recognised<'h> {
    columns: BTreeMap<Column, &'h str>,
    doubtful: Option<&'h str>,
    in_dbm: bool,
    in_milliseconds: bool,
    /// The column of the day, where the time is another one.
    day: Option<&'h str>,
    /// The column of the zone of UTM.
    zone: Option<&'h str>,
    /// The column of places, and true if the longitude is the first of its numbers.
    pair: Option<(&'h str, bool)>,
    /// True if the bearing's name says that it is counted from magnetic North.
    is_magnetic: bool,
}

/// The name of a column without capitals and signs, and its unit in brackets or behind it.
fn parts(name: &str) -> (String, String) {
    let lower = name.to_lowercase();
    let (name, unit) = lower.split_once(['[', '(']).unwrap_or((&lower, ""));
    let is_letter = |c: &char| c.is_alphanumeric() && *c != 'º';
    let letters = |text: &str| text.chars().filter(is_letter).collect::<String>();
    let name = letters(name);
    let unit = letters(unit);
    for suffix in ["degcompass", "dbm", "deg", "db", "ms", "s", "m"] {
        let words = lower.trim_end_matches([']', ')']);
        let is_word =
            words.ends_with(&format!("_{suffix}")) || words.ends_with(&format!(" {suffix}"));
        if unit.is_empty()
            && is_word
            && let Some(short) = name.strip_suffix(suffix)
            && !short.is_empty()
        {
            return (short.to_owned(), suffix.to_owned());
        }
    }
    (name, unit)
}

impl<'h> Recognised<'h> {
    fn of(header: &'h [String]) -> Self {
        let mut found = Self {
            columns: BTreeMap::new(),
            doubtful: None,
            in_dbm: false,
            in_milliseconds: false,
            day: None,
            zone: None,
            pair: None,
            is_magnetic: false,
        };
        for (column, names) in NAMES {
            let rank = |name: &'h String| {
                let of = parts(name);
                let known = match column {
                    Column::BearingDegCompass => without_north(&of.0).0,
                    _ => &of.0,
                };
                let rank = names.iter().position(|name| *name == known)?;
                Some((rank, name, of.1))
            };
            let whole = header.iter().filter_map(rank).min_by_key(|of| of.0);
            let Some((_, name, unit)) = whole.or_else(|| only_nested(header, names)) else {
                continue;
            };
            found.columns.insert(column, name);
            if column == Column::RssDb {
                found.in_dbm = unit == "dbm" || parts(name).0 == "dbm";
            }
            if column == Column::TimeS {
                found.in_milliseconds = unit == "ms";
            }
            if column == Column::BearingDegCompass {
                found.is_magnetic = without_north(&parts(name).0).1;
            }
        }
        let has_place = found.is_placed();
        let is_pair = |name: &String| is_one(&PAIRS, name) || is_one(&TURNED_PAIRS, name);
        // An empty cell behind it is of a heading above several columns.
        let is_heading = |at: usize| header.get(at + 1).is_some_and(String::is_empty);
        let pair = header.iter().position(is_pair).filter(|at| !has_place && !is_heading(*at));
        let pair = pair.and_then(|at| header.get(at));
        found.pair = pair.map(|name| (name.as_str(), is_one(&TURNED_PAIRS, name)));
        found.zone = header.iter().find(|name| is_one(&ZONES, name)).map(String::as_str);
        found.day = header.iter().find(|name| is_one(&DAYS, name)).map(String::as_str);
        if !found.has(Column::TimeS)
            && let Some(day) = found.day.take()
        {
            found.columns.insert(Column::TimeS, day);
        }
        for column in Column::ALL {
            if let Some(name) = header.iter().find(|name| *name == column.name()) {
                found.take_own(column, name);
            }
        }
        found.doubtful = header
            .iter()
            .find(|name| DOUBTFUL.contains(&parts(name).0.as_str()))
            .map(String::as_str);
        found
    }

    /// Takes a column that has our own name.
    fn take_own(&mut self, column: Column, name: &'h str) {
        match column {
            Column::RssDbm => {
                self.in_dbm = true;
                self.columns.insert(Column::RssDb, name);
            }
            Column::RssDb => {
                self.in_dbm = false;
                self.columns.insert(column, name);
            }
            Column::TimeUtc => {
                self.columns.remove(&Column::TimeS);
                self.columns.insert(column, name);
            }
            column => {
                self.columns.insert(column, name);
            }
        }
    }

    fn has(&self, column: Column) -> bool {
        self.columns.contains_key(&column)
    }

    fn is_placed(&self) -> bool {
        let has = |pair: [Column; 2]| pair.iter().all(|column| self.has(*column));
        self.pair.is_some()
            || has([Column::LatDeg, Column::LonDeg])
            || has([Column::EastM, Column::NorthM])
    }

    fn is_timed(&self) -> bool {
        self.has(Column::TimeS) || self.has(Column::TimeUtc)
    }

    fn is_measured(&self) -> bool {
        let measured = [
            Column::RssDb,
            Column::BearingDegCompass,
            Column::RangeSigmaM,
            Column::RangeDifferenceM,
            Column::RssDifferenceDb,
        ];
        measured.iter().any(|column| self.has(*column))
    }
}

/// The only nested key of JSON whose last part has one of these names, and its unit.
fn only_nested<'h>(header: &'h [String], names: &[&str]) -> Option<(usize, &'h String, String)> {
    let mut nested = header.iter().filter_map(|name| {
        let (name_of, unit) = parts(name.rsplit_once('.')?.1);
        let rank = names.iter().position(|name| *name == name_of)?;
        Some((rank, name, unit))
    });
    let only = nested.next();
    only.filter(|_| nested.next().is_none())
}

/// The name of a bearing without the North that it is counted from, and true if that is magnetic.
fn without_north(name: &str) -> (&str, bool) {
    let strip = |ends: &[&str]| {
        let short = ends.iter().find_map(|end| name.strip_suffix(end));
        short.filter(|short| !short.is_empty())
    };
    match (strip(&MAGNETIC), strip(&TRUE_NORTH)) {
        (Some(short), _) => (short, true),
        (None, Some(short)) => (short, false),
        (None, None) => (name, false),
    }
}

/// Returns true if a column's name is one of these.
fn is_one(names: &[&str], column: &str) -> bool {
    names.contains(&parts(column).0.as_str())
}

/// Returns true for a common name of the receiver.
pub(super) fn is_receiver(column: &str) -> bool {
    NAMES.iter().any(|(of, names)| *of == Column::Drone && is_one(names, column))
}

/// Returns true if the table is a path: the level is the same for all rows, or of a column that is
/// named.
pub(super) fn has_stated_level(options: &ReadOptions) -> bool {
    let levels = [Column::RssDb, Column::RssDbm];
    let is_constant = levels.iter().any(|level| options.constants.contains_key(level));
    is_constant || options.level.is_some()
}

/// Returns true for the name of a column that may number animals or rows.
pub(super) fn is_identity(column: &str) -> bool {
    is_one(&["id", "name", "nr", "no", "nummer"], column)
}

/// Words in the names of columns that hold levels.
const LEVEL_WORDS: [&str; 5] = ["rssi", "signal", "dbm", "rsrp", "snr"];

/// The names of the columns that may hold levels, as the end of a sentence.
pub(super) fn levels(header: &[String]) -> String {
    let is_level = |name: &&String| {
        let lower = name.to_lowercase();
        LEVEL_WORDS.iter().any(|word| lower.contains(word))
    };
    header.iter().filter(is_level).map(String::as_str).collect::<Vec<_>>().join(", ")
}

/// The column of ours that a column with levels is, by its unit.
pub(super) fn level_column(name: &str) -> Column {
    let (name, unit) = parts(name);
    if unit == "dbm" || name.ends_with("dbm") { Column::RssDbm } else { Column::RssDb }
}

/// Names without a unit that levels in dBm often have.
const SIGNALS: [&str; 4] = ["signal", "signallevel", "signalstrength", "strength"];

/// Returns true if a column without a unit has a name that levels in dBm often have.
pub(super) fn is_signal(name: &str) -> bool {
    let (name, unit) = parts(name);
    unit.is_empty() && SIGNALS.contains(&name.as_str())
}

/// Returns true if a line names places, or times where a track has the places, and what was
/// measured there.
pub(super) fn is_plain(header: &[String], options: &ReadOptions) -> bool {
    let has_track = options.rover.is_some();
    let found = Recognised::of(header);
    if has_stated_level(options) {
        return found.is_placed() && found.is_timed();
    }
    (found.is_placed() || (has_track && found.is_timed()))
        && (found.is_measured() || found.doubtful.is_some())
}

/// Half of a table from which something can be located.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Half {
    /// Times and places.
    Path,
    /// Times and measurements.
    Measurements,
}

/// Returns true if a line names times and places, and nothing that was measured or may be.
pub(super) fn is_path(header: &[String]) -> bool {
    half(header) == Some(Half::Path) && Recognised::of(header).doubtful.is_none()
}

/// The half that a header names; `None` if it names both or neither.
pub(super) fn half(header: &[String]) -> Option<Half> {
    let found = Recognised::of(header);
    match (found.is_timed(), found.is_placed(), found.is_measured()) {
        (true, true, false) => Some(Half::Path),
        (true, false, true) => Some(Half::Measurements),
        _ => None,
    }
}

/// Returns the column of a [`half`] that may be a slip for what it lacks, and the name that may be
/// meant.
pub(super) fn slip(header: &[String]) -> Option<[String; 2]> {
    let lacks: &[Column] = match half(header)? {
        Half::Path => &[Column::RssDbm, Column::RssDb, Column::BearingDegCompass],
        Half::Measurements => &[Column::LatDeg, Column::LonDeg, Column::EastM, Column::NorthM],
    };
    let found = Recognised::of(header);
    let common = NAMES.iter().filter(|(column, _)| lacks.contains(column));
    let common = common.flat_map(|(_, names)| names.iter().copied());
    let own = lacks.iter().map(|column| column.name());
    let meant: Vec<&str> = own.chain(common).filter(|name| name.len() >= LEAST_OF_SLIP).collect();
    let mut unknown = header.iter().filter(|name| {
        name.len() >= LEAST_OF_SLIP && !found.columns.values().any(|known| known == name)
    });
    unknown
        .find_map(|name| Some([name.clone(), near_miss(name, meant.iter().copied())?.to_owned()]))
}

/// Letters of a name that may be a slip, at least: shorter ones are alike by chance.
const LEAST_OF_SLIP: usize = 3;

/// Makes a mapping for a table whose columns have common names; `None` if it has no places or
/// nothing that was measured. `first` returns a cell of the first row.
///
/// # Errors
///
/// [`RecordingError::Doubtful`] for a column that may be a bearing or the receiver's direction.
pub(super) fn mapping(
    table: &Table<'_>,
    options: &ReadOptions,
    first: impl Fn(&str) -> Option<String>,
) -> Result<Option<Mapping>, RecordingError> {
    let file = table.file();
    let line = table.header_line();
    let format = options.time_format;
    let has_track = options.rover.is_some();
    let mut found = Recognised::of(table.header());
    // A column of that name may hold names of places.
    found.pair = found.pair.filter(|(name, _)| {
        let cell = first(name);
        cell.is_some_and(|cell| !matches!(coordinate::pair(&cell), Err(FieldProblem::NotAPair)))
    });
    let has_places = found.is_placed() || (has_track && found.is_timed());
    if !has_places {
        return Ok(None);
    }
    if !found.is_measured() && !has_stated_level(options) {
        return match found.doubtful {
            None => Ok(None),
            Some(column) => Err(RecordingError::Doubtful {
                file: file.to_owned(),
                line,
                column: column.to_owned(),
            }),
        };
    }
    // Degrees go before metres, as x and y may be either.
    let in_degrees = found.has(Column::LatDeg) && found.has(Column::LonDeg);
    let degrees = [Column::LatDeg, Column::LonDeg];
    let metres = [Column::EastM, Column::NorthM];
    let others = if in_degrees { metres } else { degrees };
    let is_used = |column: &Column| !others.contains(column);
    // The track's places stand for the table's own.
    let is_own =
        |column: &Column| !has_track || !degrees.iter().chain(&metres).any(|c| c == column);
    found.columns.retain(|column, _| is_used(column) && is_own(column));
    if !found.has(Column::BearingDegCompass) {
        found.columns.remove(&Column::BearingSigmaDeg);
    }
    if !found.has(Column::RssDb) {
        found.columns.remove(&Column::AttenuationDb);
    }
    let mut columns = BTreeMap::new();
    if let Some((name, is_turned)) = found.pair.filter(|_| !has_track) {
        let parts = if is_turned { [1, 0] } else { [0, 1] };
        for (column, part) in degrees.into_iter().zip(parts) {
            columns.insert(column, Source { part: Some(part), ..Source::column(name) });
        }
    }
    for (column, name) in &found.columns {
        let mut source = Source::column(name);
        let column = match column {
            Column::RssDb if found.in_dbm => Column::RssDbm,
            Column::TimeS if *name != Column::TimeS.name() => {
                let cell = first(name);
                let cell = cell.as_deref().unwrap_or_default();
                let day = found.day.filter(|_| clock_seconds(cell).is_some());
                if let Some(day) = day {
                    source.columns.insert(0, day.to_owned());
                    columns.insert(Column::TimeUtc, source);
                    continue;
                }
                // A day alone is no time, nor is whatever else a column of days holds.
                if is_day(cell) || (is_one(&DAYS, name) && !is_instant(cell)) {
                    continue;
                }
                let (column, scale) = time(cell, name, found.in_milliseconds, format)
                    .ok_or_else(|| serial_or_seconds(file, line, name, cell))?;
                source.scale = scale;
                column
            }
            Column::ReceiverSigmaM if *name != Column::ReceiverSigmaM.name() => {
                source.scale = SIGMA_OF_ACCURACY;
                *column
            }
            Column::LatDeg | Column::LonDeg => {
                let pair = [Column::LatDeg, Column::LonDeg].map(|c| found.columns.get(&c));
                let cells = pair.map(|name| name.and_then(|name| first(name)));
                source.scale = degrees_scale(&cells);
                *column
            }
            column => *column,
        };
        columns.insert(column, source);
    }
    let time = columns.get(&Column::TimeUtc).map(Source::label).unwrap_or_default();
    let is_utc = time != Column::TimeUtc.name() && time.to_lowercase().contains("utc");
    let north = if found.is_magnetic { North::Magnetic } else { North::True };
    Ok(Some(Mapping {
        name: PLAIN.to_owned(),
        description: "a table whose columns have common names".to_owned(),
        header: Vec::new(),
        names: Vec::new(),
        spectrum: None,
        rising: false,
        columns,
        constants: BTreeMap::new(),
        north,
        keep: Vec::new(),
        turns: Turns::Circle,
        beside: Vec::new(),
        melt: None,
        utm_zone: found.zone.filter(|_| !in_degrees).map(str::to_owned),
        separator: None,
        path: false,
        utc: is_utc,
    }))
}

/// σ on each axis over the radius that holds the place with 68 %, as phones state it: 1/√(−2 ln
/// 0.32).
const SIGMA_OF_ACCURACY: f64 = 0.662;

/// The column that a time is, and its scale, by a cell; `None` if the cell may be a spreadsheet's
/// day or a number of seconds.
fn time(
    cell: &str,
    name: &str,
    in_milliseconds: bool,
    format: Option<TimeFormat>,
) -> Option<(Column, f64)> {
    /// Seconds since 1970 in the years 2001 to 2286.
    const UNIX_S: std::ops::Range<f64> = 1e9..1e10;
    let Ok(number) = cell.replace(',', ".").parse::<f64>() else {
        return Some((if is_date(cell) { Column::TimeUtc } else { Column::TimeS }, 1.0));
    };
    if UNIX_S.contains(&number) {
        return Some((Column::TimeUtc, 1.0));
    }
    if UNIX_S.contains(&(number / 1e3)) {
        return Some((Column::TimeUtc, 1e-3));
    }
    if in_milliseconds {
        return Some((Column::TimeS, 1e-3));
    }
    match format {
        Some(TimeFormat::Excel) => Some((Column::TimeUtc, 1.0)),
        Some(TimeFormat::Seconds) => Some((Column::TimeS, 1.0)),
        _ if !is_serial(number) => Some((Column::TimeS, 1.0)),
        _ if is_one(&DATES, name) => Some((Column::TimeUtc, 1.0)),
        _ if is_one(&SECONDS, name) || parts(name).1 == "s" => Some((Column::TimeS, 1.0)),
        _ => None,
    }
}

/// Returns true for a date and time, a spreadsheet's, or one in seconds since 1970.
fn is_instant(cell: &str) -> bool {
    let is_unix = |number: f64| (1e9..1e10).contains(&number) || (1e12..1e13).contains(&number);
    let number = cell.replace(',', ".").parse::<f64>();
    is_date(cell) || number.is_ok_and(|number| is_serial(number) || is_unix(number))
}

/// The error that a time may be a spreadsheet's day or a number of seconds.
fn serial_or_seconds(file: &str, line: u64, column: &str, cell: &str) -> RecordingError {
    RecordingError::AmbiguousTime {
        file: file.to_owned(),
        line: line + 1,
        column: column.to_owned(),
        value: shown(cell),
        readings: &[["excel", "a spreadsheet's day"], ["seconds", "a number of seconds"]],
    }
}

/// The scale of a latitude and longitude: whole numbers beyond 180 are degrees × 10⁷, as GNSS
/// receivers and autopilots count.
fn degrees_scale(cells: &[Option<String>; 2]) -> f64 {
    let whole = |cell: &Option<String>| cell.as_deref().and_then(|cell| cell.parse::<i64>().ok());
    let [Some(lat), Some(lon)] = [whole(&cells[0]), whole(&cells[1])] else { return 1.0 };
    let is_scaled = lat.abs() > 360 || lon.abs() > 360;
    let fits = lat.abs() <= 900_000_000 && lon.abs() <= 3_600_000_000;
    if is_scaled && fits { 1e-7 } else { 1.0 }
}

/// Returns true if a column's name is a common one of an attenuation.
pub(super) fn is_attenuation(name: &str) -> bool {
    let (name, _) = parts(name);
    NAMES
        .iter()
        .any(|(column, names)| *column == Column::AttenuationDb && names.contains(&name.as_str()))
}

/// The columns of a mapping with the file's names, for people.
pub(super) fn described(mapping: &Mapping) -> String {
    let pair = |(column, source): (&Column, &Source)| {
        let label = source.label();
        let scaled = if (source.scale - 1e-7).abs() < 1e-12 { " × 10⁻⁷" } else { "" };
        (label != column.name()).then(|| Cow::Owned(format!("{label} as {column}{scaled}")))
    };
    let pairs: Vec<Cow<'_, str>> = mapping.columns.iter().filter_map(pair).collect();
    pairs.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    fn made(
        header: &str,
        row: &str,
        format: Option<TimeFormat>,
    ) -> Result<Option<Mapping>, RecordingError> {
        let table = Table::open("f.csv", header.as_bytes(), None, &[]).expect("a header");
        let cell = |name: &str| {
            let index = header.split(',').position(|column| column == name)?;
            row.split(',').nth(index).map(str::to_owned)
        };
        let options = ReadOptions { time_format: format, ..ReadOptions::default() };
        mapping(&table, &options, cell)
    }

    fn read(header: &str, row: &str) -> Vec<String> {
        let made = made(header, row, None).expect("no doubt").expect("a table");
        let names =
            made.columns.iter().map(|(column, source)| format!("{column}={}", source.label()));
        names.collect()
    }

    #[test]
    fn common_names_are_columns() {
        for (header, row, columns) in [
            ("time,lat,lon,rssi", "0,50,14,-60", "time_s=time lat_deg=lat lon_deg=lon rss_db=rssi"),
            (
                "Timestamp,Latitude,Longitude,RSSI [dBm]",
                "2026-07-30 10:00:00,50,14,-60",
                "time_utc=Timestamp lat_deg=Latitude lon_deg=Longitude rss_dbm=RSSI [dBm]",
            ),
            (
                "time_ms,LAT,LNG,Signal (dBm),SNR",
                "1767225603000,50,14,-60,7",
                "time_utc=time_ms lat_deg=LAT lon_deg=LNG rss_dbm=Signal (dBm)",
            ),
            ("lat,lon,bearing", "50,14,7", "lat_deg=lat lon_deg=lon bearing_deg_compass=bearing"),
            (
                "x,y,Azimuth [°],heading",
                "1,2,7,8",
                "east_m=x north_m=y bearing_deg_compass=Azimuth [°]",
            ),
            (
                "x,y,s_meter_db,attenuator_db",
                "1,2,7,20",
                "east_m=x north_m=y rss_db=s_meter_db attenuation_db=attenuator_db",
            ),
            (
                "lat_deg,lon_deg,level_db,tag",
                "50,14,7,a",
                "beacon=tag lat_deg=lat_deg lon_deg=lon_deg rss_db=level_db",
            ),
        ] {
            assert_eq!(read(header, row).join(" "), sorted(columns), "{header}");
        }
    }

    /// In the order of our columns.
    fn sorted(columns: &str) -> String {
        let place = |name: &&str| Column::ALL.iter().position(|c| name.starts_with(c.name()));
        let mut names: Vec<String> = Vec::new();
        // A name of the file may hold a space.
        for word in columns.split(' ') {
            match names.last_mut().filter(|_| !word.contains('=')) {
                Some(last) => *last += &format!(" {word}"),
                None => names.push(word.to_owned()),
            }
        }
        names.sort_by_key(|name| place(&name.as_str()));
        names.join(" ")
    }

    #[test]
    fn a_heading_alone_is_asked_for() {
        let error = made("lat,lon,heading", "", None).expect_err("it may be either");
        for part in ["f.csv, line 1", "\"heading\"", "bearing_deg_compass", "heading_deg_compass"] {
            assert!(error.to_string().contains(part), "{error}");
        }
        for header in ["lat,lon,note", "time,distance,rssi"] {
            assert!(made(header, "", None).is_ok_and(|made| made.is_none()), "{header}");
        }
    }

    #[test]
    fn names_of_other_languages_and_dates_are_columns() {
        for (header, row, columns) in [
            (
                "Datum,Uhrzeit,Breite,Länge,Pegel [dBm]",
                "21.06.2026,14:03,50,14,-60",
                "time_utc=Datum and Uhrzeit lat_deg=Breite lon_deg=Länge rss_dbm=Pegel [dBm]",
            ),
            (
                "Fecha,Latitud,Longitud,Nivel",
                "46194.58,50,14,-60",
                "time_utc=Fecha lat_deg=Latitud lon_deg=Longitud rss_db=Nivel",
            ),
            (
                "Heure,Latitude,Longitude,Azimut mag.",
                "14:03,50,14,60",
                "time_s=Heure lat_deg=Latitude lon_deg=Longitude bearing_deg_compass=Azimut mag.",
            ),
            ("Date,lat,lon,rssi", "2026-06-21,50,14,-60", "lat_deg=lat lon_deg=lon rss_db=rssi"),
            ("Date,x,y,rssi", "21 June,50,14,-60", "east_m=x north_m=y rss_db=rssi"),
            ("Date,x,y,rssi", "172,50,14,-60", "east_m=x north_m=y rss_db=rssi"),
            ("t,lat,lon,rssi", "46194.5,50,14,-6", "time_s=t lat_deg=lat lon_deg=lon rss_db=rssi"),
        ] {
            assert_eq!(read(header, row).join(" "), sorted(columns), "{header}");
        }
        let magnetic = made("x,y,Azimut mag.", "1,2,3", None).expect("no doubt").expect("a table");
        assert_eq!(magnetic.north, North::Magnetic);
        let scaled = made("lat,lon,rssi", "481234567,163725000,-6", None);
        let scaled = scaled.expect("no doubt").expect("a table");
        assert_abs_diff_eq!(scaled.columns[&Column::LatDeg].scale, 1e-7, epsilon = 1e-20);
    }

    #[test]
    fn a_number_that_may_be_a_day_or_seconds_is_asked_for() {
        let header = "time,lat,lon,rssi";
        let row = "46194.58,50,14,-60";
        let error = made(header, row, None).expect_err("it may be either").to_string();
        for part in ["f.csv, line 2, time", "46194.58", "--time-format excel or seconds"] {
            assert!(error.contains(part), "{error}");
        }
        for (format, column) in
            [(TimeFormat::Excel, Column::TimeUtc), (TimeFormat::Seconds, Column::TimeS)]
        {
            let made = made(header, row, Some(format)).expect("stated").expect("a table");
            assert!(made.columns.contains_key(&column), "{format:?}");
        }
    }
}
