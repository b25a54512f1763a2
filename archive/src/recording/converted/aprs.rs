use super::rows::{Converted, Made, RowsWriter};

/// Lines in which a file is recognised.
const LOOKED_AT: usize = 200;

/// Bearings that stations report by APRS: packets as monitors print them, one a line.
///
/// Behind the position of a direction finder's symbol (`/` … `\`) stand course, speed, bearing
/// and quality: `088/036/270/729` is a bearing of 270° from true North whose number 7, range 2 and
/// quality 9 follow (APRS Protocol Reference 1.0.1, chapter 7, "DF Report"). A quality of 1 to 9 is
/// an error of 240° down to 1°, halved each time, which is taken as two σ; without one a bearing
/// means nothing, as with a number of 0.
pub(super) fn convert(text: &str) -> Option<csv::Result<Converted>> {
    let lines = || text.lines().filter(|line| !line.is_empty() && !line.starts_with('#'));
    let mut packets = lines().take(LOOKED_AT);
    let are_packets = packets.all(|line| line.contains('>') && line.contains(':'));
    let has_bearing = || lines().any(|line| Report::of(line).is_some());
    (are_packets && has_bearing()).then(|| table(text))
}

fn table(text: &str) -> csv::Result<Converted> {
    let header = ["drone", "lat_deg", "lon_deg", "bearing_deg_compass", "bearing_sigma_deg"];
    let mut rows = RowsWriter::new(&header);
    let mut others = 0_u64;
    for (number, line) in (1..).zip(text.lines()) {
        let Some(Report { station, place, bearing_deg, sigma_deg }) = Report::of(line) else {
            others += u64::from(!line.is_empty() && !line.starts_with('#'));
            continue;
        };
        let [lat, lon] = place.map(|degrees| format!("{degrees:.6}"));
        let angles = [bearing_deg, sigma_deg].map(|degrees| degrees.to_string());
        let [bearing, sigma] = &angles;
        rows.write(number, &[station, &lat, &lon, bearing, sigma])?;
    }
    let what = format!(
        "packets of APRS; bearings with a number and a quality are the rows, without their times; \
         packets without: {others}"
    );
    Ok(Converted { table: Made::Rows(rows.finish()?), what })
}

/// A bearing with its station and place.
struct Report<'l> {
    station: &'l str,
    /// Latitude and longitude in degrees.
    place: [f64; 2],
    bearing_deg: f64,
    sigma_deg: f64,
}

impl<'l> Report<'l> {
    /// The report of a packet, behind whatever a monitor prints before the station.
    fn of(line: &'l str) -> Option<Self> {
        let (from, rest) = line.split_once('>')?;
        let station = from.rsplit([' ', '\t', ']']).next().filter(|name| !name.is_empty())?;
        let (_, information) = rest.split_once(':')?;
        // A position stands behind its kind, and behind a time of seven characters for two of them.
        let position = match information.as_bytes().first()? {
            b'!' | b'=' => information.get(1..)?,
            b'/' | b'@' => information.get(8..)?,
            _ => return None,
        };
        let lat = degrees(position.get(..8)?, 2, ['N', 'S'])?;
        let lon = degrees(position.get(9..18)?, 3, ['E', 'W'])?;
        let symbol = [position.get(8..9)?, position.get(18..19)?];
        let mut fields = position.get(19..34)?.split('/').skip(2);
        let [bearing, quality] = [fields.next()?, fields.next()?];
        let digit = |at: usize| quality.get(at..=at)?.parse::<u8>().ok();
        let [number, quality] = [digit(0)?, digit(2)?];
        if symbol != ["/", "\\"] || number == 0 || quality == 0 {
            return None;
        }
        let bearing_deg = bearing.parse().ok()?;
        // Below 240° each quality is half of the one before: 120, 64, 32 … 2, and less than 1.
        let most_deg = match quality {
            1 => 240.0,
            2 => 120.0,
            quality => f64::from(1_u32 << (9 - quality)),
        };
        Some(Self { station, place: [lat, lon], bearing_deg, sigma_deg: 0.5 * most_deg })
    }
}

/// Degrees of `4903.50N`, whose first `whole` digits are degrees and the others minutes.
fn degrees(text: &str, whole: usize, [plus, minus]: [char; 2]) -> Option<f64> {
    let sign = match text.chars().next_back()? {
        last if last == plus => 1.0,
        last if last == minus => -1.0,
        _ => return None,
    };
    let text = text.get(..text.len() - 1)?;
    let degrees: f64 = text.get(..whole)?.parse().ok()?;
    let minutes: f64 = text.get(whole..)?.parse().ok()?;
    Some(sign * (degrees + minutes / 60.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_is_a_bearing_with_its_sigma() {
        let text = "# a monitor\n\
                    2026-06-21 14:03:00 UTC: AE5PL-9>APRS,TCPIP*:\
                    @211403z4903.50N/07201.75W\\088/036/270/729\n\
                    N0CALL>APRS:!4903.50N/07201.75W-a house\n";
        assert!(convert(text).is_some_and(|made| made.is_ok()));
        let made = convert(
            "AE5PL-9>APRS,TCPIP*:@211403z4903.50N/07201.75W\\088/036/270/729\n\
                            N0CALL>APRS:!4903.50N/07201.75W-a house\n\
                            K5XYZ>APRS:=3303.50S/17201.75E\\000/000/010/325\n\
                            K5XYZ>APRS:=3303.50S/17201.75E\\000/000/010/025\n",
        )
        .expect("packets")
        .expect("in memory");
        let Made::Rows(rows) = made.table else { panic!("rows") };
        let text = String::from_utf8(rows.csv).expect("text").replace('"', "");
        let expected = "AE5PL-9,49.058333,-72.029167,270,0.5\nK5XYZ,-33.058333,172.029167,10,8\n";
        assert_eq!(text, expected);
        assert_eq!(rows.lines, [1, 3]);
        assert!(made.what.ends_with("without: 2"), "{}", made.what);
    }

    #[test]
    fn others_are_left_alone() {
        for other in ["", "time,lat,lon\n1,2,3\n", "N0CALL>APRS:!4903.50N/07201.75W-a house\n"] {
            assert!(convert(other).is_none(), "{other}");
        }
    }
}
