use std::str::FromStr;

use super::FieldProblem;

/// Major semi-axis and flattening of WGS84.
const AXIS_M: f64 = 6_378_137.0;
const FLATTENING: f64 = 1.0 / 298.257_223_563;

/// Scale on the central meridian.
const SCALE: f64 = 0.9996;

/// Easting of the central meridian.
const FALSE_EAST_M: f64 = 500_000.0;

/// Northing of the equator in the southern hemisphere.
const FALSE_NORTH_M: f64 = 10_000_000.0;

/// A zone of UTM: its number and the hemisphere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UtmZone {
    number: u8,
    is_south: bool,
}

impl FromStr for UtmZone {
    type Err = &'static str;

    /// A zone with its latitude band, such as 33U, or with its hemisphere in a word: 33 north.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        const FORM: &str = "is not a zone of UTM such as 33U or 33 north";
        let text = text.trim();
        let end = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
        let (number, letters) = text.split_at_checked(end).ok_or(FORM)?;
        let number = number.parse::<u8>().ok().filter(|number| (1..=60).contains(number));
        let number = number.ok_or(FORM)?;
        let letters = letters.trim().to_ascii_lowercase();
        let is_south = match letters.as_str() {
            "" => return Err("has no hemisphere; write the band, such as 33U, or 33 north"),
            "s" => {
                return Err("may be the southern hemisphere or the band S, which is north of the \
                            equator; write 33 south or 33 north");
            }
            "north" => false,
            "south" => true,
            band => match band.as_bytes() {
                // Without I and O, which look like digits.
                [b'i' | b'o'] => return Err(FORM),
                [b'c'..=b'm'] => true,
                [b'n'..=b'x'] => false,
                _ => return Err(FORM),
            },
        };
        Ok(Self { number, is_south })
    }
}

impl UtmZone {
    /// Latitude and longitude in degrees of a place in the zone (Krüger 1912, series in the third
    /// flattening to the fourth order: to a millimetre within the zone).
    pub(super) fn degrees(self, east_m: f64, north_m: f64) -> [f64; 2] {
        let n = FLATTENING / (2.0 - FLATTENING);
        let powers = [n, n.powi(2), n.powi(3), n.powi(4)];
        let sum = |factors: [f64; 4]| -> f64 {
            factors.iter().zip(powers).map(|(factor, power)| factor * power).sum()
        };
        let radius = AXIS_M / (1.0 + n) * (1.0 + n.powi(2) / 4.0 + n.powi(4) / 64.0);
        let beta = [
            sum([1.0 / 2.0, -2.0 / 3.0, 37.0 / 96.0, -1.0 / 360.0]),
            sum([0.0, 1.0 / 48.0, 1.0 / 15.0, -437.0 / 1440.0]),
            sum([0.0, 0.0, 17.0 / 480.0, -37.0 / 840.0]),
            sum([0.0, 0.0, 0.0, 4397.0 / 161_280.0]),
        ];
        let delta = [
            sum([2.0, -2.0 / 3.0, -2.0, 116.0 / 45.0]),
            sum([0.0, 7.0 / 3.0, -8.0 / 5.0, -227.0 / 45.0]),
            sum([0.0, 0.0, 56.0 / 15.0, -136.0 / 35.0]),
            sum([0.0, 0.0, 0.0, 4279.0 / 630.0]),
        ];
        let equator = if self.is_south { FALSE_NORTH_M } else { 0.0 };
        let xi = (north_m - equator) / (SCALE * radius);
        let eta = (east_m - FALSE_EAST_M) / (SCALE * radius);
        let doubled = [2.0, 4.0, 6.0, 8.0];
        let north_of: f64 = beta
            .iter()
            .zip(doubled)
            .map(|(b, k)| b * libm::sin(k * xi) * libm::cosh(k * eta))
            .sum();
        let east_of: f64 = beta
            .iter()
            .zip(doubled)
            .map(|(b, k)| b * libm::cos(k * xi) * libm::sinh(k * eta))
            .sum();
        let [xi, eta] = [xi - north_of, eta - east_of];
        let conformal = libm::asin(libm::sin(xi) / libm::cosh(eta));
        let latitude =
            delta.iter().zip(doubled).map(|(d, k)| d * libm::sin(k * conformal)).sum::<f64>();
        let central_deg = f64::from(self.number) * 6.0 - 183.0;
        let east = libm::atan2(libm::sinh(eta), libm::cos(xi));
        [(conformal + latitude).to_degrees(), central_deg + east.to_degrees()]
    }
}

/// Reads latitude and longitude in degrees of a place that one cell holds with its zone: of UTM,
/// such as `33U 601983 5339533`, or a grid reference of MGRS, such as `33U XP 01983 39533`. `None`
/// for any other cell.
pub(super) fn place(text: &str) -> Option<Result<[f64; 2], FieldProblem>> {
    let is_between = |c: char| c.is_whitespace() || ",;/".contains(c);
    let words: Vec<&str> = text.split(is_between).filter(|word| !word.is_empty()).collect();
    let joined = words.concat().to_ascii_uppercase();
    if let Some(place) = grid_reference(&joined) {
        return Some(Ok(place));
    }
    let (zone, [east, north]) = match words.as_slice() {
        [zone, east, north] => ((*zone).to_owned(), [east, north]),
        [number, letter, east, north] => (format!("{number} {letter}"), [east, north]),
        _ => return None,
    };
    let is_zone = zone.starts_with(|c: char| c.is_ascii_digit())
        && zone.ends_with(|c: char| c.is_ascii_alphabetic());
    let east_m = metres(east, 'E').filter(|east_m| (0.0..=1e6).contains(east_m) && is_zone)?;
    let north_m = metres(north, 'N').filter(|north_m| (0.0..=1e7).contains(north_m))?;
    let zone = zone.parse::<UtmZone>().map_err(FieldProblem::NotAZone);
    Some(zone.map(|zone| zone.degrees(east_m, north_m)))
}

/// Number of an easting or northing that may have its unit and its letter: 0601983, 601983mE,
/// E601983.
fn metres(text: &str, letter: char) -> Option<f64> {
    let upper = text.to_ascii_uppercase();
    let bare = upper.trim_start_matches(letter).trim_end_matches(letter).trim_end_matches('M');
    let is_number = bare.bytes().all(|byte| byte.is_ascii_digit() || byte == b'.');
    bare.parse().ok().filter(|_| is_number)
}

/// Latitude and longitude in degrees of a grid reference of MGRS without spaces, to 100 m or finer:
/// the middle of its square (NGA.STND.0037, 2014, section 3).
fn grid_reference(text: &str) -> Option<[f64; 2]> {
    /// Side of the squares that two letters name.
    const SQUARE_M: f64 = 100_000.0;
    /// Northing after which the letters of the rows begin again.
    const CIRCLE_M: f64 = 2_000_000.0;
    /// Letters of the rows: the alphabet as far as V, without I and O.
    const ROWS: &str = "ABCDEFGHJKLMNPQRSTUV";
    /// Letters of the columns, which begin again in every third zone.
    const COLUMNS: [&str; 3] = ["ABCDEFGH", "JKLMNPQR", "STUVWXYZ"];
    /// Bands of eight degrees of latitude from 80° S, with their least northing in 100 km.
    const BANDS: [(char, f64); 20] = [
        ('C', 11.0),
        ('D', 20.0),
        ('E', 28.0),
        ('F', 37.0),
        ('G', 46.0),
        ('H', 55.0),
        ('J', 64.0),
        ('K', 73.0),
        ('L', 82.0),
        ('M', 91.0),
        ('N', 0.0),
        ('P', 8.0),
        ('Q', 17.0),
        ('R', 26.0),
        ('S', 35.0),
        ('T', 44.0),
        ('U', 53.0),
        ('V', 62.0),
        ('W', 70.0),
        ('X', 79.0),
    ];
    let zone_end = text.find(|c: char| !c.is_ascii_digit()).filter(|end| (1..=2).contains(end))?;
    let (number, rest) = text.split_at_checked(zone_end)?;
    let number = number.parse::<u8>().ok().filter(|number| (1..=60).contains(number))?;
    let mut letters = rest.chars();
    let [band, column, row] = [letters.next()?, letters.next()?, letters.next()?];
    let digits = letters.as_str();
    let is_paired = digits.len().is_multiple_of(2) && (6..=10).contains(&digits.len());
    if !is_paired || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let (east, north) = digits.split_at_checked(digits.len() / 2)?;
    let side_m = SQUARE_M / 10_f64.powi(i32::try_from(east.len()).ok()?);
    // The middle of the square that the digits name.
    let within = |digits: &str| Some((digits.parse::<f64>().ok()? + 0.5) * side_m);
    let least_m = BANDS.iter().find(|(letter, _)| *letter == band)?.1 * SQUARE_M;
    let columns = COLUMNS.get(usize::from((number - 1) % 3))?;
    let row = ROWS.find(row)?;
    // Rows of zones with an even number begin at F.
    let row = if number.is_multiple_of(2) { (row + 15) % 20 } else { row };
    let column = u8::try_from(columns.find(column)? + 1).ok()?;
    let east_m = f64::from(column) * SQUARE_M + within(east)?;
    let row_m = f64::from(u8::try_from(row).ok()?) * SQUARE_M;
    let circles = ((least_m - row_m) / CIRCLE_M).ceil().max(0.0);
    let north_m = row_m + circles * CIRCLE_M + within(north)?;
    Some(UtmZone { number, is_south: band < 'N' }.degrees(east_m, north_m))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    /// Zone, easting, northing, latitude and longitude by the Python package `utm`, which uses
    /// other series.
    const VALUES: [(&str, f64, f64, f64, f64); 4] = [
        ("33U", 601_983.252_472_173_1, 5_339_533.087_107_521_5, 48.200_833_3, 16.3725),
        ("56H", 334_900.569_650_601_3, 6_252_288.752_863_666, -33.8568, 151.2153),
        ("32V", 597_897.812_884_389_9, 6_641_568.107_928_127, 59.9, 10.75),
        ("30N", 500_000.0, 55_265.037_142_100_62, 0.5, -3.0),
    ];

    #[test]
    fn places_of_a_zone_are_degrees() {
        for (zone, east_m, north_m, lat_deg, lon_deg) in VALUES {
            let zone: UtmZone = zone.parse().expect("a zone");
            let [lat, lon] = zone.degrees(east_m, north_m);
            let off = (lat - lat_deg).abs() + (lon - lon_deg).abs();
            assert!(off < 1e-7, "{zone:?}: {lat}, {lon}");
        }
    }

    #[test]
    fn a_zone_has_a_hemisphere() {
        let zone = |number, is_south| Ok(UtmZone { number, is_south });
        for text in ["33U", "33 u", "33 north", "33N"] {
            assert_eq!(text.parse(), zone(33, false), "{text}");
        }
        assert_eq!("56H".parse(), zone(56, true));
        assert_eq!("56 south".parse(), zone(56, true));
        for (wrong, part) in [("33", "hemisphere"), ("33S", "band S"), ("61N", "33U"), ("U", "33U")]
        {
            let error = wrong.parse::<UtmZone>().expect_err(wrong);
            assert!(error.contains(part), "{wrong}: {error}");
        }
    }

    /// Latitude and longitude of a cell.
    fn degrees(text: &str) -> [f64; 2] {
        place(text).and_then(Result::ok).unwrap_or([f64::NAN; 2])
    }

    #[test]
    fn a_place_of_utm_may_be_one_cell() {
        for text in [
            "33U 601983.2525 5339533.0871",
            "33 U 601983.2525 5339533.0871",
            "33u, 601983.2525, 5339533.0871",
            "33U 601983.2525mE 5339533.0871mN",
            "33U E601983.2525 N5339533.0871",
            "33 north 601983.2525 5339533.0871",
        ] {
            let [lat, lon] = degrees(text);
            assert_abs_diff_eq!(lat, 48.200_833_3, epsilon = 1e-7);
            assert_abs_diff_eq!(lon, 16.3725, epsilon = 1e-7);
        }
        for text in ["48.2 16.37", "48.2, 16.37", "Vienna", "", "33U 601983", "33U 16 48 12 3"] {
            assert_eq!(place(text), None, "{text}");
        }
        let unclear = place("33S 601983 5339533");
        assert!(matches!(unclear, Some(Err(FieldProblem::NotAZone(_)))), "{unclear:?}");
    }

    /// Grid references with the places that the Python package `mgrs`, which is the library
    /// GEOTRANS, has for them.
    const REFERENCES: [(&str, f64, f64); 10] = [
        ("33U XP 01983 39533", 48.200_836_98, 16.372_503_43),
        ("56HLH3490052288", -33.856_802_27, 151.215_299_20),
        ("32V NM 9789 4156", 59.899_972_78, 10.749_948_28),
        ("30NWF0000055265", 0.500_004_19, -2.999_995_51),
        ("19FEV4500027239", -54.799_998_89, -68.299_993_07),
        ("27W VM 561 118", 64.130_352_72, -21.900_726_24),
        ("54S UE 87789 49165", 35.680_004_53, 139.760_002_90),
        ("17MQV7827477872", -0.200_002_60, -78.500_001_17),
        ("33XVH3612371615", 78.999_995_68, 11.999_985_30),
        ("35W MV 58391 78192", 71.899_999_25, 25.799_990_86),
    ];

    #[test]
    fn a_grid_reference_is_a_place() {
        for (text, lat_deg, lon_deg) in REFERENCES {
            let [lat, lon] = degrees(text);
            assert_abs_diff_eq!(lat, lat_deg, epsilon = 1e-6);
            assert_abs_diff_eq!(lon, lon_deg, epsilon = 1e-6);
        }
        for text in ["33UXP", "33UXP0198", "33UIP0198339533", "61UXP0198339533", "33UXP019833953"] {
            assert_eq!(place(text), None, "{text}");
        }
    }
}
