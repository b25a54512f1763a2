use std::str::FromStr;

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

#[cfg(test)]
mod tests {
    use super::*;

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
}
