use super::rows::{Converted, Made, RowsWriter};

/// Lines in which a file is recognised.
const LOOKED_AT: usize = 200;

/// Tags that name themselves, in a file of a SensorGnome: lines of text, each of a kind.
///
/// `T1,1557438000.263,78664C33,-51` is a detection by the radio of port 1, its time in seconds
/// since 1970, the tag and its level in dBm; `G,1557438000,44.34,-66.11,21.6` the receiver's place.
/// Such a file is `*-ctt.txt`, or `*-all.txt` with the pulses of other radios (Motus, "File
/// formats").
pub(super) fn convert(text: &str) -> Option<csv::Result<Converted>> {
    let of_tag = |line: &str| Detection::of(line).is_some();
    let lines = || text.lines().filter(|line| !line.is_empty());
    let is_one = lines().take(LOOKED_AT).all(is_line) && lines().any(of_tag);
    is_one.then(|| table(text))
}

fn table(text: &str) -> csv::Result<Converted> {
    let header = ["time_utc", "lat_deg", "lon_deg", "alt_m", "beacon", "drone", "rss_dbm"];
    let mut rows = RowsWriter::new(&header);
    // The first place is that of the detections before it, too.
    let mut place = text.lines().find_map(place_of);
    let mut pulses = 0_u64;
    for (number, line) in (1..).zip(text.lines()) {
        place = place_of(line).or(place);
        pulses += u64::from(line.starts_with('p'));
        let Some(Detection { port, time, tag, level }) = Detection::of(line) else { continue };
        let [lat, lon, alt] = place.unwrap_or([""; 3]);
        let drone = format!("T{port}");
        rows.write(number, &[time, lat, lon, alt, tag, &drone, level])?;
    }
    let others = match pulses {
        0 => String::new(),
        pulses => format!(
            "; {pulses} pulses without a name are left out: their tags are found by `foxhunt tags`"
        ),
    };
    let what = format!(
        "a SensorGnome's file; tags that name \
                        themselves are the rows{others}"
    );
    Ok(Converted { table: Made::Rows(rows.finish()?), what })
}

/// Returns true for a line of any kind: a letter, perhaps a port, and a time.
fn is_line(line: &str) -> bool {
    let mut cells = line.split(',');
    let kind = cells.next().unwrap_or_default();
    let port = kind.strip_prefix(['p', 'T', 'G', 'S', 'C']);
    let is_kind = port.is_some_and(|port| port.bytes().all(|byte| byte.is_ascii_digit()));
    is_kind && cells.next().is_some_and(|time| time.parse::<f64>().is_ok())
}

/// A tag that named itself.
struct Detection<'l> {
    port: &'l str,
    time: &'l str,
    tag: &'l str,
    level: &'l str,
}

impl<'l> Detection<'l> {
    fn of(line: &'l str) -> Option<Self> {
        let mut cells = line.trim_end().split(',');
        let port = cells.next()?.strip_prefix('T')?;
        let found = Self { port, time: cells.next()?, tag: cells.next()?, level: cells.next()? };
        found.level.parse::<f64>().is_ok().then_some(found)
    }
}

/// Latitude, longitude and height of a line of the receiver's place.
fn place_of(line: &str) -> Option<[&str; 3]> {
    let mut cells = line.trim_end().strip_prefix("G,")?.split(',').skip(1);
    let [lat, lon] = [cells.next()?, cells.next()?];
    Some([lat, lon, cells.next().unwrap_or_default()])
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &str = "S,1557437990.1,1,frequency,166.376,0,\n\
                        p1,1557437995.6384,3.883,-49.09,-71.03\n\
                        G,1557437999,44.34,-66.11,21.6\n\
                        T1,1557438000.263,78664C33,-51\n\
                        T2,1557438001.5,78664C33,-63\n";

    #[test]
    fn tags_that_name_themselves_are_rows_in_their_lines() {
        let Converted { table, what } = convert(FILE).expect("one").expect("in memory");
        let Made::Rows(rows) = table else { panic!("rows") };
        let text = String::from_utf8(rows.csv).expect("text").replace('"', "");
        let expected = "1557438000.263,44.34,-66.11,21.6,78664C33,T1,-51\n\
                        1557438001.5,44.34,-66.11,21.6,78664C33,T2,-63\n";
        assert_eq!(text, expected);
        assert_eq!(rows.lines, [4, 5]);
        assert!(what.contains("1 pulses"), "{what}");
    }

    #[test]
    fn others_are_left_alone() {
        for other in ["", "time,lat,lon\n1,2,3\n", "G,1,2,3,4\n", "T1,1557438000.263,78664C33,x\n"]
        {
            assert!(convert(other).is_none(), "{other}");
        }
    }
}
