//! Messages of ROS 2 that a bag holds, and their encoding in CDR.

use foxhunt_wire::geodesy::radians_to_compass_deg;

use super::BagError;

/// Reads the values of a message in CDR, as ROS 2 writes it: OMG's Common Data Representation,
/// version 1, where each number is aligned to its own size.
#[derive(Debug)]
struct Cdr<'a> {
    bytes: &'a [u8],
    at: usize,
    little: bool,
}

/// Maximum length of a text or a list; a longer one would not fit into any message.
const MOST: usize = 1 << 20;

impl<'a> Cdr<'a> {
    /// The message after its header of four bytes.
    fn new(message: &'a [u8]) -> Result<Self, BagError> {
        match message {
            [0, 0, _, _, bytes @ ..] => Ok(Self { bytes, at: 0, little: false }),
            [0, 1, _, _, bytes @ ..] => Ok(Self { bytes, at: 0, little: true }),
            _ => Err(BagError::Encoding),
        }
    }

    /// The next `N` bytes, aligned to as many.
    fn take<const N: usize>(&mut self) -> Result<[u8; N], BagError> {
        let begin = self.at.next_multiple_of(N);
        let end = begin + N;
        let bytes = self.bytes.get(begin..end).and_then(|bytes| bytes.try_into().ok());
        let mut bytes: [u8; N] = bytes.ok_or(BagError::Short { length: self.bytes.len() })?;
        self.at = end;
        if !self.little {
            bytes.reverse();
        }
        Ok(bytes)
    }

    fn u8(&mut self) -> Result<u8, BagError> {
        self.take().map(u8::from_le_bytes)
    }

    fn bool(&mut self) -> Result<bool, BagError> {
        Ok(self.u8()? != 0)
    }

    fn u16(&mut self) -> Result<u16, BagError> {
        self.take().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> Result<u32, BagError> {
        self.take().map(u32::from_le_bytes)
    }

    fn f32(&mut self) -> Result<f32, BagError> {
        self.take().map(f32::from_le_bytes)
    }

    fn f64(&mut self) -> Result<f64, BagError> {
        self.take().map(f64::from_le_bytes)
    }

    fn f64s<const N: usize>(&mut self) -> Result<[f64; N], BagError> {
        let mut values = [0.0; N];
        for value in &mut values {
            *value = self.f64()?;
        }
        Ok(values)
    }

    /// Reads the length of the text or the list that follows.
    fn length(&mut self) -> Result<usize, BagError> {
        let length = usize::try_from(self.u32()?).unwrap_or(usize::MAX);
        if length > MOST { Err(BagError::Short { length: self.bytes.len() }) } else { Ok(length) }
    }

    /// Passes over a text.
    fn skip_text(&mut self) -> Result<(), BagError> {
        let length = self.length()?;
        self.at += length;
        if self.at > self.bytes.len() {
            return Err(BagError::Short { length: self.bytes.len() });
        }
        Ok(())
    }

    /// Passes over a list of numbers.
    fn skip_f64s(&mut self) -> Result<(), BagError> {
        for _ in 0..self.length()? {
            self.f64()?;
        }
        Ok(())
    }

    /// Passes over a `std_msgs/Header`.
    fn skip_header(&mut self) -> Result<(), BagError> {
        self.u32()?;
        self.u32()?;
        self.skip_text()
    }
}

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
    pub beacon: u16,
    pub place: [f64; 3],
    pub heading: f64,
    pub rss_dbm: Option<f64>,
    /// The bearing and its σ in radians.
    pub bearing: Option<[f64; 2]>,
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_aligned_and_of_either_order() {
        // A byte, three of padding, 0x01020304, then 1.5 as a double at 8.
        let little = [0, 1, 0, 0, 7, 0, 0, 0, 4, 3, 2, 1, 0, 0, 0, 0, 0, 0, 0xF8, 0x3F];
        let mut cdr = Cdr::new(&little).expect("a header");
        assert_eq!(cdr.u8(), Ok(7));
        assert_eq!(cdr.u32(), Ok(0x0102_0304));
        assert_eq!(cdr.f64(), Ok(1.5));
        assert!(matches!(cdr.u8(), Err(BagError::Short { .. })));
        let big = [0, 0, 0, 0, 0, 0, 0, 2, b'a', 0, 0, 9];
        let mut cdr = Cdr::new(&big).expect("a header");
        cdr.skip_text().expect("a text of two bytes");
        assert_eq!(cdr.u16(), Ok(9));
        assert!(matches!(Cdr::new(&[1, 2]), Err(BagError::Encoding)));
        let long = [0, 1, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF];
        assert!(Cdr::new(&long).expect("a header").skip_text().is_err());
        assert!(Cdr::new(&long).expect("a header").skip_f64s().is_err());
    }
}
