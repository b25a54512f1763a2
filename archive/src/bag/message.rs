use foxhunt_wire::geodesy::radians_to_compass_deg;

use super::{BagError, cdr::Cdr};

/// The types of messages that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    PoseStamped,
    Odometry,
    NavSatFix,
    Float32,
    Float64,
    Reception,
}

/// Use of a kind of message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Use {
    /// The receiver's place.
    Place,
    /// The beacon's level.
    Level,
    /// Both, and a bearing.
    Reception,
}

impl Kind {
    /// The kind of a type's name, as ROS 2 or ROS 1 has it.
    pub(super) fn named(name: &str) -> Option<Self> {
        Some(match name.replace("/msg/", "/").as_str() {
            "geometry_msgs/PoseStamped" => Self::PoseStamped,
            "nav_msgs/Odometry" => Self::Odometry,
            "sensor_msgs/NavSatFix" => Self::NavSatFix,
            "std_msgs/Float32" => Self::Float32,
            "std_msgs/Float64" => Self::Float64,
            "foxhunt_msgs/Reception" => Self::Reception,
            _ => return None,
        })
    }

    pub(super) fn used_for(self) -> Use {
        match self {
            Self::PoseStamped | Self::Odometry | Self::NavSatFix => Use::Place,
            Self::Float32 | Self::Float64 => Use::Level,
            Self::Reception => Use::Reception,
        }
    }
}

/// A receiver's place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Place {
    /// East, North and Up in metres, and the nose in radians counter-clockwise from East.
    Local([f64; 3], f64),
    /// Latitude and longitude in degrees, and the height above the ellipsoid.
    Earth([f64; 3]),
}

/// Contents of foxhunt's own message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Received {
    pub(super) beacon: u16,
    pub(super) place: [f64; 3],
    pub(super) heading: f64,
    pub(super) rss_dbm: Option<f64>,
    /// The bearing and its σ in radians.
    pub(super) bearing: Option<[f64; 2]>,
}

/// Returns the place of a message; [`None`] for a message without a GNSS fix.
pub(super) fn place(kind: Kind, message: &[u8]) -> Result<Option<Place>, BagError> {
    let mut cdr = Cdr::new(message)?;
    cdr.skip_header()?;
    if kind == Kind::NavSatFix {
        // STATUS_NO_FIX is −1.
        let has_fix = cdr.u8()? < 0x80;
        cdr.u16()?;
        let place = cdr.f64s::<3>()?;
        return Ok(Some(Place::Earth(place)).filter(|_| has_fix));
    }
    if kind == Kind::Odometry {
        cdr.skip_text()?;
    }
    let place = cdr.f64s::<3>()?;
    let [x, y, z, w] = cdr.f64s::<4>()?;
    let heading = libm::atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z));
    Ok(Some(Place::Local(place, heading)))
}

/// The level of a message, in dBm.
pub(super) fn level(kind: Kind, message: &[u8]) -> Result<f64, BagError> {
    let mut cdr = Cdr::new(message)?;
    match kind {
        Kind::Float32 => cdr.f32().map(f64::from),
        _ => cdr.f64(),
    }
}

/// A reception; [`None`] of one that read nothing.
pub(super) fn reception(message: &[u8]) -> Result<Option<Received>, BagError> {
    let mut cdr = Cdr::new(message)?;
    cdr.skip_header()?;
    let beacon = cdr.u16()?;
    let is_read = cdr.bool()?;
    cdr.skip_text()?;
    let place = cdr.f64s::<3>()?;
    let [heading, _pitch, _roll] = cdr.f64s::<3>()?;
    cdr.skip_f64s()?;
    let [rss_dbm, _sigma] = cdr.f64s::<2>()?;
    let has_bearing = cdr.bool()?;
    let bearing = cdr.f64s::<2>()?;
    let received = Received {
        beacon,
        place,
        heading,
        rss_dbm: Some(rss_dbm).filter(|level| !level.is_nan()),
        bearing: Some(bearing).filter(|_| has_bearing),
    };
    Ok(Some(received).filter(|_| is_read))
}

/// Degrees clockwise from North.
pub(super) fn compass(angle: f64) -> f64 {
    radians_to_compass_deg(angle)
}
