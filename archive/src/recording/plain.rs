use std::{borrow::Cow, collections::BTreeMap};

use super::{Column, Mapping, RecordingError, Source, Turns, utc::utc_seconds};

/// The name of the mapping that is made for a table with columns of common names.
pub(super) const PLAIN: &str = "plain";

/// Common names of columns, the most usual first, without unit, signs and capitals.
const NAMES: [(Column, &[&str]); 12] = [
    (Column::LatDeg, &["lat", "latitude", "gpslat", "gpslatitude", "currentlatitude"]),
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
        ],
    ),
    (Column::EastM, &["east", "easting", "x"]),
    (Column::NorthM, &["north", "northing", "y"]),
    (
        Column::TimeS,
        &[
            "time",
            "timestamp",
            "datetime",
            "utc",
            "t",
            "seconds",
            "second",
            "sec",
            "epoch",
            "unixtime",
            "firstseen",
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
            "rxpower",
            "dbm",
            "snr",
            "smeter",
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
        ],
    ),
    (Column::AttenuationDb, &["attenuation", "attenuator"]),
    (Column::BearingDegCompass, &["bearing", "azimuth", "az"]),
    (Column::BearingSigmaDeg, &["bearingsigma", "bearingerror", "sigma"]),
    (Column::Beacon, &["beacon", "tag", "tagid", "transmitter", "mac", "bssid", "address"]),
    (Column::Drone, &["drone", "receiver", "station", "node", "observer"]),
];

/// Names that may be a bearing to the transmitter or the direction of the receiver.
const DOUBTFUL: [&str; 5] = ["heading", "direction", "course", "doa", "angle"];

/// A header of a file, as far as its columns have common names.
struct Recognised<'h> {
    columns: BTreeMap<Column, &'h str>,
    doubtful: Option<&'h str>,
    in_dbm: bool,
    in_milliseconds: bool,
}

/// The name of a column without capitals and signs, and its unit in brackets or behind it.
fn parts(name: &str) -> (String, String) {
    let lower = name.to_lowercase();
    let (name, unit) = lower.split_once(['[', '(']).unwrap_or((&lower, ""));
    let letters = |text: &str| text.chars().filter(char::is_ascii_alphanumeric).collect::<String>();
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
        };
        for (column, names) in NAMES {
            let rank = |name: &'h String| {
                let of = parts(name);
                let rank = names.iter().position(|known| *known == of.0)?;
                Some((rank, name, of.1))
            };
            let Some((_, name, unit)) = header.iter().filter_map(rank).min_by_key(|of| of.0) else {
                continue;
            };
            found.columns.insert(column, name);
            if column == Column::RssDb {
                found.in_dbm = unit == "dbm" || parts(name).0 == "dbm";
            }
            if column == Column::TimeS {
                found.in_milliseconds = unit == "ms";
            }
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
        has([Column::LatDeg, Column::LonDeg]) || has([Column::EastM, Column::NorthM])
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

/// Returns true if a line names places and what was measured there.
pub(super) fn is_plain(header: &[String]) -> bool {
    let found = Recognised::of(header);
    found.is_placed() && (found.is_measured() || found.doubtful.is_some())
}

/// Makes a mapping for a table whose columns have common names; `None` if it has no places or
/// nothing that was measured. `first` returns a cell of the first row.
///
/// # Errors
///
/// [`RecordingError::Doubtful`] for a column that may be a bearing or the receiver's direction.
pub(super) fn mapping(
    file: &str,
    line: u64,
    header: &[String],
    first: impl Fn(&str) -> Option<String>,
) -> Result<Option<Mapping>, RecordingError> {
    let mut found = Recognised::of(header);
    if !found.is_placed() {
        return Ok(None);
    }
    if !found.is_measured() {
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
    let others = match in_degrees {
        true => [Column::EastM, Column::NorthM],
        false => [Column::LatDeg, Column::LonDeg],
    };
    found.columns.retain(|column, _| !others.contains(column));
    if !found.has(Column::BearingDegCompass) {
        found.columns.remove(&Column::BearingSigmaDeg);
    }
    if !found.has(Column::RssDb) {
        found.columns.remove(&Column::AttenuationDb);
    }
    let mut columns = BTreeMap::new();
    for (column, name) in &found.columns {
        let mut source = Source::column(name);
        let column = match column {
            Column::RssDb if found.in_dbm => Column::RssDbm,
            Column::TimeS if *name != Column::TimeS.name() => {
                let (column, scale) = time(first(name).as_deref(), found.in_milliseconds);
                source.scale = scale;
                column
            }
            Column::ReceiverSigmaM if *name != Column::ReceiverSigmaM.name() => {
                source.scale = SIGMA_OF_ACCURACY;
                *column
            }
            column => *column,
        };
        columns.insert(column, source);
    }
    Ok(Some(Mapping {
        name: PLAIN.to_owned(),
        description: "a table whose columns have common names".to_owned(),
        header: Vec::new(),
        names: Vec::new(),
        spectrum: None,
        rising: false,
        columns,
        constants: BTreeMap::new(),
        north: super::North::True,
        keep: Vec::new(),
        turns: Turns::Circle,
        beside: Vec::new(),
        melt: None,
        separator: None,
    }))
}

/// σ on each axis over the radius that holds the place with 68 %, as phones state it: 1/√(−2 ln
/// 0.32).
const SIGMA_OF_ACCURACY: f64 = 0.662;

/// The column that a time is, and its scale, by the first cell.
fn time(cell: Option<&str>, in_milliseconds: bool) -> (Column, f64) {
    /// Seconds since 1970 in the years 2001 to 2286.
    const UNIX_S: std::ops::Range<f64> = 1e9..1e10;
    let Some(number) = cell.and_then(|cell| cell.replace(',', ".").parse::<f64>().ok()) else {
        let is_date = cell.is_some_and(|cell| utc_seconds(cell).is_some());
        return (if is_date { Column::TimeUtc } else { Column::TimeS }, 1.0);
    };
    if UNIX_S.contains(&number) {
        return (Column::TimeUtc, 1.0);
    }
    if UNIX_S.contains(&(number / 1e3)) {
        return (Column::TimeUtc, 1e-3);
    }
    (Column::TimeS, if in_milliseconds { 1e-3 } else { 1.0 })
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
        (label != column.name()).then(|| Cow::Owned(format!("{label} as {column}")))
    };
    let pairs: Vec<Cow<'_, str>> = mapping.columns.iter().filter_map(pair).collect();
    pairs.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(header: &str, row: &str) -> Vec<String> {
        let header: Vec<String> = header.split(',').map(str::to_owned).collect();
        let cell = |name: &str| {
            let index = header.iter().position(|column| column == name)?;
            row.split(',').nth(index).map(str::to_owned)
        };
        let made = mapping("f.csv", 1, &header, cell).expect("no doubt").expect("a table");
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
        let header = ["lat", "lon", "heading"].map(str::to_owned);
        let error = mapping("f.csv", 1, &header, |_| None).expect_err("it may be either");
        for part in ["f.csv, line 1", "\"heading\"", "bearing_deg_compass", "heading_deg_compass"] {
            assert!(error.to_string().contains(part), "{error}");
        }
        for header in [["lat", "lon", "note"], ["time", "distance", "rssi"]] {
            let made = mapping("f.csv", 1, &header.map(str::to_owned), |_| None);
            assert!(made.is_ok_and(|made| made.is_none()), "{header:?}");
        }
    }
}
