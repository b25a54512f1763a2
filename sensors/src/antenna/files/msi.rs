use alloc::{
    format,
    string::{String, ToString},
    vec::Vec,
};

use crate::{Antenna, PatternTable, PatternTableError, PrincipalCuts};

/// The gain of a half-wave dipole in dBi, as data sheets round it: dBd + 2.15 = dBi.
const DIPOLE_DBI: f64 = 2.15;

/// An antenna file of vendors and planning tools: MSI Planet, `.msi` or `.pln`.
///
/// Header lines of a name and a value; the maximum gain in dBi or dBd among them; then the
/// attenuation below it over a horizontal and a vertical turn. Angles are clockwise: from the
/// boresight to the right, and from the horizon down. All that is read is kept, so that it can be
/// written back; the text is made by [`Display`](core::fmt::Display).
///
/// ```
/// use foxhunt_sensors::{Antenna, Dipole, MsiFile};
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let file = MsiFile::sampled("dipole", &Dipole);
/// let read = MsiFile::parse(&file.to_string())?;
/// assert_eq!(read, file);
/// assert!((read.antenna()?.gain_dbi(1.0, 0.0) - 2.15).abs() < 0.01);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct MsiFile {
    /// Names and values in their order; that of GAIN is one of them.
    pub(super) fields: Vec<(String, String)>,
    pub(super) gain: f64,
    pub(super) unit: MsiUnit,
    /// Degrees and dB.
    pub(super) horizontal: Vec<(f64, f64)>,
    pub(super) vertical: Vec<(f64, f64)>,
    /// Between the fields of a line: a tab, or a space.
    pub(super) tabs: bool,
}

/// Reference of a gain in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MsiUnit {
    /// An isotropic antenna.
    Dbi,
    /// A half-wave dipole.
    Dbd,
}

impl MsiFile {
    /// The file of an antenna: its gain over whole degrees round the elevation of the main lobe
    /// and over the poles through its azimuth, in dB below the maximum to two decimals.
    #[must_use]
    pub fn sampled(name: &str, antenna: &dyn Antenna) -> Self {
        let lobe = antenna.main_lobe();
        let hundredths = |value: f64| libm::round(value * 100.0) / 100.0;
        let below = |azimuth: f64, elevation: f64| {
            hundredths((lobe.gain_dbi - antenna.gain_dbi(azimuth, elevation)).max(0.0))
        };
        let horizontal = |degree: f64| below(-degree.to_radians(), lobe.elevation);
        let vertical = |degree: f64| {
            // Down through the nadir to the back, and up over the zenith to the front again.
            let (azimuth, elevation) = match degree {
                ..=90.0 => (0.0, -degree),
                ..=270.0 => (180.0, degree - 180.0),
                _ => (0.0, 360.0 - degree),
            };
            below(lobe.azimuth + f64::to_radians(azimuth), f64::to_radians(elevation))
        };
        let cut = |of: &dyn Fn(f64) -> f64| {
            (0..360_u16).map(|degree| (f64::from(degree), of(f64::from(degree)))).collect()
        };
        let gain = hundredths(lobe.gain_dbi);
        let mut file = Self {
            fields: Vec::from([("GAIN".to_string(), format!("{gain} dBi"))]),
            gain,
            unit: MsiUnit::Dbi,
            horizontal: cut(&horizontal),
            vertical: cut(&vertical),
            tabs: false,
        };
        // What a line may hold ends with it.
        let name = name.split_whitespace().collect::<Vec<_>>().join(" ");
        file.fields.insert(0, ("NAME".to_string(), name));
        file
    }

    /// The value of a header field, blank where the file leaves it so; names are compared without
    /// regard to case.
    #[must_use]
    pub fn field(&self, name: &str) -> Option<&str> {
        let found = self.fields.iter().find(|(own, _)| own.eq_ignore_ascii_case(name));
        found.map(|(_, value)| value.as_str())
    }

    /// The header's names and values, in their order.
    pub fn fields(&self) -> impl Iterator<Item = (&str, &str)> {
        self.fields.iter().map(|(name, value)| (name.as_str(), value.as_str()))
    }

    /// The maximum gain as it stands in the file.
    #[must_use]
    pub fn gain(&self) -> (f64, MsiUnit) {
        (self.gain, self.unit)
    }

    /// The maximum gain in dBi.
    #[must_use]
    pub fn gain_dbi(&self) -> f64 {
        match self.unit {
            MsiUnit::Dbi => self.gain,
            MsiUnit::Dbd => self.gain + DIPOLE_DBI,
        }
    }

    /// The electrical tilt in degrees, down where positive, of a file that gives it in numbers; the
    /// vertical cut holds it already.
    #[must_use]
    pub fn electrical_tilt_deg(&self) -> Option<f64> {
        ["ELECTRICAL_TILT", "TILT"].iter().find_map(|name| {
            self.field(name)?.split_whitespace().find_map(|word| word.parse().ok())
        })
    }

    /// The antenna that the cuts make.
    ///
    /// # Errors
    ///
    /// [`PatternTableError`] where a cut has too few rows to go round, or too near each other.
    pub fn antenna(&self) -> Result<PrincipalCuts, PatternTableError> {
        let cut = |rows: &[(f64, f64)]| {
            // Clockwise there, counter-clockwise here.
            let rows: Vec<_> =
                rows.iter().rev().map(|(degree, below)| (-degree.to_radians(), -below)).collect();
            PatternTable::from_rows(&rows)
        };
        Ok(PrincipalCuts::new(self.gain_dbi(), cut(&self.horizontal)?, cut(&self.vertical)?))
    }
}
