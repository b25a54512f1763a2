use std::fmt;

use serde::Deserialize;

use super::near_miss::did_you_mean;

/// A column of our own format; other formats are mapped onto these. Each name carries its unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize)]
#[serde(try_from = "String")]
#[non_exhaustive]
pub enum Column {
    /// `beacon`: the beacon's name.
    Beacon,
    /// `drone`: the receiver's name.
    Drone,
    /// `time_s`: seconds since any origin.
    TimeS,
    /// `time_utc`: `YYYY-MM-DD HH:MM:SS`, read as seconds since 1970, or that number itself.
    TimeUtc,
    /// `lat_deg`: the receiver's WGS84 latitude.
    LatDeg,
    /// `lon_deg`: the receiver's WGS84 longitude.
    LonDeg,
    /// `alt_agl_m`: the receiver's height above the ground.
    AltAglM,
    /// `alt_m`: the receiver's height above the ellipsoid.
    AltM,
    /// `east_m`: the receiver's East in the local frame.
    EastM,
    /// `north_m`: the receiver's North.
    NorthM,
    /// `up_m`: the receiver's Up.
    UpM,
    /// `receiver_sigma_m`: the standard deviation of the receiver's place on each axis; not known
    /// where it is 0 or less.
    ReceiverSigmaM,
    /// `heading_deg_compass`: the drone's nose.
    HeadingDegCompass,
    /// `pitch_deg`: the angle of the drone's nose above the horizon.
    PitchDeg,
    /// `roll_deg`: the angle of the drone's right side below its left.
    RollDeg,
    /// `antenna_deg`: the antenna's boresight, clockwise from the nose.
    AntennaDeg,
    /// `boresight_deg_compass`: the antenna's boresight.
    BoresightDegCompass,
    /// `position`: the index of the turn's position, from 0.
    Position,
    /// `turn`: the number of the antenna's turn.
    Turn,
    /// `rss_dbm`: the received power.
    RssDbm,
    /// `rss_db`: the received power relative to an unknown reference.
    RssDb,
    /// `attenuation_db`: the attenuation before the receiver, which is added to its levels.
    AttenuationDb,
    /// `gain_db`: the gain before the receiver, which is subtracted from its levels.
    GainDb,
    /// `floor_dbm`: the level, as the levels are given, at or below which the receiver's noise
    /// stands for the beacon's power.
    FloorDbm,
    /// `ceiling_dbm`: the level, as the levels are given, at or above which the receiver is
    /// saturated and the true level is higher.
    CeilingDbm,
    /// `bearing_deg_compass`: a ready-made bearing from the receiver to the beacon.
    BearingDegCompass,
    /// `relative_bearing_deg`: a ready-made bearing, clockwise from the drone's nose.
    RelativeBearingDeg,
    /// `bearing_sigma_deg`: the bearing's standard deviation.
    BearingSigmaDeg,
    /// `range_m`: the distance to the beacon; known and for calibration, or measured where there
    /// is a `range_sigma_m`.
    RangeM,
    /// `range_sigma_m`: the standard deviation of a measured distance.
    RangeSigmaM,
    /// `range_difference_m`: how much farther the beacon is from the receiver than from the
    /// reference receiver.
    RangeDifferenceM,
    /// `range_difference_sigma_m`: the range difference's standard deviation.
    RangeDifferenceSigmaM,
    /// `rss_difference_db`: how much stronger the beacon is at the receiver than at the reference
    /// receiver.
    RssDifferenceDb,
    /// `rss_difference_sigma_db`: the level difference's standard deviation.
    RssDifferenceSigmaDb,
    /// `truth_lat_deg`: the beacon's true WGS84 latitude.
    TruthLatDeg,
    /// `truth_lon_deg`: the beacon's true WGS84 longitude.
    TruthLonDeg,
    /// `truth_east_m`: the beacon's true East.
    TruthEastM,
    /// `truth_north_m`: the beacon's true North.
    TruthNorthM,
}

/// Kind of value in a column's cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    /// Any text.
    Text,
    /// A number between two bounds.
    Number(f64, f64),
    /// A whole number from 0 to a bound.
    Index(f64),
}

/// Farther from anything in metres is a mistake, and its square would soon overflow.
const FAR: f64 = 1e8;

/// No standard deviation is smaller than this.
const LEAST_SIGMA: f64 = 1e-6;

impl Column {
    /// Every column.
    pub const ALL: [Self; 38] = [
        Self::Beacon,
        Self::Drone,
        Self::TimeS,
        Self::TimeUtc,
        Self::LatDeg,
        Self::LonDeg,
        Self::AltAglM,
        Self::AltM,
        Self::EastM,
        Self::NorthM,
        Self::UpM,
        Self::ReceiverSigmaM,
        Self::HeadingDegCompass,
        Self::PitchDeg,
        Self::RollDeg,
        Self::AntennaDeg,
        Self::BoresightDegCompass,
        Self::Position,
        Self::Turn,
        Self::RssDbm,
        Self::RssDb,
        Self::AttenuationDb,
        Self::GainDb,
        Self::FloorDbm,
        Self::CeilingDbm,
        Self::BearingDegCompass,
        Self::RelativeBearingDeg,
        Self::BearingSigmaDeg,
        Self::RangeM,
        Self::RangeSigmaM,
        Self::RangeDifferenceM,
        Self::RangeDifferenceSigmaM,
        Self::RssDifferenceDb,
        Self::RssDifferenceSigmaDb,
        Self::TruthLatDeg,
        Self::TruthLonDeg,
        Self::TruthEastM,
        Self::TruthNorthM,
    ];

    /// The column's name in our format.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.spec().0
    }

    /// Returns the kind of value in its cells.
    pub(super) fn kind(self) -> Kind {
        self.spec().1
    }

    /// Returns true if a cell may hold this number.
    pub(super) fn admits(self, value: f64) -> bool {
        match self.kind() {
            Kind::Text => false,
            Kind::Number(min, max) => (min..=max).contains(&value),
            Kind::Index(max) => value.fract() == 0.0 && (0.0..=max).contains(&value),
        }
    }

    /// Returns true if its cells are levels or floors of the receiver.
    pub(super) fn is_level(self) -> bool {
        matches!(self, Self::RssDbm | Self::RssDb | Self::FloorDbm | Self::CeilingDbm)
    }

    /// Returns true if it names who transmits or receives.
    pub(super) fn is_name(self) -> bool {
        matches!(self, Self::Beacon | Self::Drone)
    }

    /// Returns true if its numbers are degrees of a circle.
    pub(super) fn is_angle(self) -> bool {
        use Column as C;
        matches!(
            self,
            C::AntennaDeg
                | C::BearingDegCompass
                | C::BoresightDegCompass
                | C::HeadingDegCompass
                | C::RelativeBearingDeg
        )
    }

    fn spec(self) -> (&'static str, Kind) {
        match self {
            Self::Beacon => ("beacon", Kind::Text),
            Self::Drone => ("drone", Kind::Text),
            Self::TimeS => ("time_s", Kind::Number(-1e12, 1e12)),
            Self::TimeUtc => ("time_utc", Kind::Text),
            Self::LatDeg => ("lat_deg", Kind::Number(-90.0, 90.0)),
            Self::LonDeg => ("lon_deg", Kind::Number(-180.0, 360.0)),
            Self::AltAglM => ("alt_agl_m", Kind::Number(-1e5, 1e5)),
            Self::AltM => ("alt_m", Kind::Number(-1e5, 1e5)),
            Self::EastM => ("east_m", Kind::Number(-FAR, FAR)),
            Self::NorthM => ("north_m", Kind::Number(-FAR, FAR)),
            Self::UpM => ("up_m", Kind::Number(-1e5, 1e5)),
            Self::ReceiverSigmaM => ("receiver_sigma_m", Kind::Number(-FAR, FAR)),
            Self::HeadingDegCompass => ("heading_deg_compass", Kind::Number(-360.0, 360.0)),
            Self::PitchDeg => ("pitch_deg", Kind::Number(-90.0, 90.0)),
            Self::RollDeg => ("roll_deg", Kind::Number(-180.0, 180.0)),
            // A stepper counts on past the full turn.
            Self::AntennaDeg => ("antenna_deg", Kind::Number(-36_000.0, 36_000.0)),
            Self::BoresightDegCompass => ("boresight_deg_compass", Kind::Number(-360.0, 360.0)),
            Self::Position => ("position", Kind::Index(65_535.0)),
            Self::Turn => ("turn", Kind::Index(4_294_967_295.0)),
            Self::RssDbm => ("rss_dbm", Kind::Number(-250.0, 100.0)),
            // Wide enough for any scale, too narrow for the usual stand-ins for "nothing".
            Self::RssDb => ("rss_db", Kind::Number(-500.0, 500.0)),
            Self::AttenuationDb => ("attenuation_db", Kind::Number(-200.0, 200.0)),
            Self::GainDb => ("gain_db", Kind::Number(-200.0, 200.0)),
            Self::FloorDbm => ("floor_dbm", Kind::Number(-500.0, 500.0)),
            Self::CeilingDbm => ("ceiling_dbm", Kind::Number(-500.0, 500.0)),
            Self::BearingDegCompass => ("bearing_deg_compass", Kind::Number(-360.0, 360.0)),
            Self::RelativeBearingDeg => ("relative_bearing_deg", Kind::Number(-360.0, 360.0)),
            Self::BearingSigmaDeg => ("bearing_sigma_deg", Kind::Number(LEAST_SIGMA, 180.0)),
            Self::RangeM => ("range_m", Kind::Number(1e-3, FAR)),
            Self::RangeSigmaM => ("range_sigma_m", Kind::Number(LEAST_SIGMA, FAR)),
            Self::RangeDifferenceM => ("range_difference_m", Kind::Number(-FAR, FAR)),
            Self::RangeDifferenceSigmaM => {
                ("range_difference_sigma_m", Kind::Number(LEAST_SIGMA, FAR))
            }
            Self::RssDifferenceDb => ("rss_difference_db", Kind::Number(-500.0, 500.0)),
            Self::RssDifferenceSigmaDb => {
                ("rss_difference_sigma_db", Kind::Number(LEAST_SIGMA, 500.0))
            }
            Self::TruthLatDeg => ("truth_lat_deg", Kind::Number(-90.0, 90.0)),
            Self::TruthLonDeg => ("truth_lon_deg", Kind::Number(-180.0, 360.0)),
            Self::TruthEastM => ("truth_east_m", Kind::Number(-FAR, FAR)),
            Self::TruthNorthM => ("truth_north_m", Kind::Number(-FAR, FAR)),
        }
    }
}

impl fmt::Display for Column {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl TryFrom<String> for Column {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        Self::ALL.into_iter().find(|column| column.name() == name).ok_or_else(|| {
            let known = Self::ALL.map(Self::name);
            let meant = did_you_mean(&name, known);
            format!("{name:?} is not a known column{meant}; choose one of {}", known.join(", "))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_find_their_columns() {
        for column in Column::ALL {
            assert_eq!(Column::try_from(column.name().to_owned()), Ok(column));
        }
        let message = Column::try_from("rss_dbmm".to_owned()).expect_err("a slip");
        assert!(message.contains("rss_dbmm") && message.contains("rss_dbm,"), "{message}");
        assert!(message.contains("did you mean \"rss_dbm\"?"), "{message}");
    }
}
