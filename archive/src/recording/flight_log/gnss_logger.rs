//! Logs of Google's GNSS Logger for Android: lines of several kinds, whose columns are named by
//! comments at the begin.

use std::collections::BTreeMap;

use foxhunt_wire::geodesy::Geodetic;

use super::log::{Fix, Levels, Log};

/// Bytes in which the comment that names a fix's columns is looked for.
const LOOKED_AT: usize = 1 << 15;

/// Providers of places, the best first, under the names of earlier and of later versions.
const PROVIDERS: [[&str; 2]; 2] = [["gps", "gps"], ["flp", "fused"]];

/// Columns of a fix, by their places in a line.
struct Columns {
    provider: usize,
    lat: usize,
    lon: usize,
    alt: usize,
    time_ms: usize,
}

impl Columns {
    /// The columns that a comment names; `None` for any other line.
    fn of(line: &str) -> Option<Self> {
        let named = line.strip_prefix('#')?.trim_start();
        if !named.starts_with("Fix,") {
            return None;
        }
        let names: Vec<String> = named.split(',').map(|name| name.trim().to_lowercase()).collect();
        let at = |begin: &str| names.iter().position(|name| name.starts_with(begin));
        // (UTC)TimeInMs before 2021, UnixTimeMillis since.
        let is_time = |name: &String| name.contains("unixtime") || name.contains("timeinms");
        Some(Self {
            provider: at("provider")?,
            lat: at("latitude")?,
            lon: at("longitude")?,
            alt: at("altitude")?,
            time_ms: names.iter().position(is_time)?,
        })
    }
}

/// Returns true for a file whose comments name the columns of a fix.
pub(super) fn is_gnss_logger(bytes: &[u8]) -> bool {
    let begin = bytes.get(..LOOKED_AT).unwrap_or(bytes);
    let is_comment = |line: &&[u8]| line.starts_with(b"#");
    let mut comments = begin.split(|byte| *byte == b'\n').filter(is_comment);
    comments.any(|line| Columns::of(&String::from_utf8_lossy(line)).is_some())
}

/// Reads the places of the best provider that has any. Damaged lines are left out.
pub(super) fn read(bytes: &[u8]) -> Result<Log, String> {
    let text = String::from_utf8_lossy(bytes);
    let mut columns = None;
    let mut providers: BTreeMap<String, Vec<Fix>> = BTreeMap::new();
    for line in text.lines() {
        if let Some(named) = Columns::of(line) {
            columns = Some(named);
        }
        let Some(columns) = columns.as_ref().filter(|_| line.starts_with("Fix,")) else { continue };
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        let number = |at: usize| cells.get(at)?.parse::<f64>().ok();
        let place = number(columns.lat).zip(number(columns.lon));
        let Some(((lat_deg, lon_deg), time_ms)) = place.zip(number(columns.time_ms)) else {
            continue;
        };
        let provider = cells.get(columns.provider).map(|name| name.to_lowercase());
        let of = providers.entry(provider.unwrap_or_default()).or_default();
        // A place without a height has that of the place before.
        let before_m = of.last().map_or(0.0, |fix| fix.place.alt_m);
        let alt_m = number(columns.alt).unwrap_or(before_m);
        of.push(Fix { time: 1e-3 * time_ms, place: Geodetic { lat_deg, lon_deg, alt_m } });
    }
    let best = PROVIDERS.iter().flatten().find(|name| providers.contains_key(**name)).copied();
    let fixes = match best {
        Some(name) => providers.remove(name).unwrap_or_default(),
        None => providers.into_values().flatten().collect(),
    };
    Ok(Log { fixes, levels: Levels::default() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    /// Comments as the program writes them, of which most are of other kinds of lines.
    const LOG: &str = "# \n# Header Description:\n# \n# Version: v3.0.6.4 Platform: 14\n# \n\
        # Raw,utcTimeMillis,TimeNanos,LeapSecond,Svid,ConstellationType,Cn0DbHz\n# \n\
        # Fix,Provider,LatitudeDegrees,LongitudeDegrees,AltitudeMeters,SpeedMps,AccuracyMeters,\
        BearingDegrees,UnixTimeMillis,SpeedAccuracyMps,BearingAccuracyDegrees,\
        elapsedRealtimeNanos,VerticalAccuracyMeters,MockLocation\n# \n\
        Fix,FLP,48.3,16.37,230.0,1.2,3.0,90.0,1782050580000,0.1,5,1,2,0\n\
        Fix,GPS,48.2,16.37,231.5,1.2,3.0,90.0,1782050580000,0.1,5,1,2,0\n\
        Raw,1782050580100,100,18,5,1,42.5\n\
        Fix,GPS,48.2001,16.37,,1.2,3.0,90.0,1782050581000,0.1,5,1,2,0\n\
        Fix,GPS,damaged\nFix,NLP,48.4,16.37,,,30.0,,1782050581000,,,1,,0\n";

    #[test]
    fn fixes_of_the_best_provider_are_the_path() {
        assert!(is_gnss_logger(LOG.as_bytes()));
        let fixes = read(LOG.as_bytes()).expect("a path").fixes;
        let each: Vec<[f64; 3]> = fixes
            .iter()
            .map(|fix| [fix.time - 1_782_050_580.0, fix.place.lat_deg, fix.place.alt_m])
            .collect();
        assert_eq!(each, [[0.0, 48.2, 231.5], [1.0, 48.2001, 231.5]]);
        // Version 2 names the columns otherwise.
        let older = "# Fix,Provider,Latitude,Longitude,Altitude,Speed,Accuracy,(UTC)TimeInMs\n\
                     Fix,fused,48.2,16.37,230,0,3,1782050580500\n";
        let fixes = read(older.as_bytes()).expect("a path").fixes;
        assert_abs_diff_eq!(fixes[0].time, 1_782_050_580.5, epsilon = 1e-6);
    }

    #[test]
    fn other_files_are_left_alone() {
        for other in ["", "Fix,GPS,48.2,16.37\n", "# Fix,Provider\n", "# a, b\nlat,lon\n1,2\n"] {
            assert!(!is_gnss_logger(other.as_bytes()), "{other}");
        }
    }
}
