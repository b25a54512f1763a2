//! Antennas in the MSI Planet files of vendors.

use alloc::{
    format,
    string::{String, ToString},
    vec::Vec,
};
use core::{fmt, str::FromStr};

use super::{
    PatternFileError, PatternFileReason,
    pattern_file::{lines, number},
};
use crate::{Antenna, PatternTable, PatternTableError, PrincipalCuts};

/// The gain of a half-wave dipole in dBi, as data sheets round it: dBd + 2.15 = dBi.
const DIPOLE_DBI: f64 = 2.15;

/// Names of the sections, in their order.
const SECTIONS: [&str; 2] = ["HORIZONTAL", "VERTICAL"];

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
    fields: Vec<(String, String)>,
    gain: f64,
    unit: MsiUnit,
    /// Degrees and dB.
    horizontal: Vec<(f64, f64)>,
    vertical: Vec<(f64, f64)>,
    /// Between the fields of a line: a tab, or a space.
    tabs: bool,
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

/// A cut as it is read.
struct Section {
    /// The line in which it begins.
    line: usize,
    name: &'static str,
    declared: usize,
    rows: Vec<(f64, f64)>,
}

impl Section {
    fn push(&mut self, line: usize, text: &str) -> Result<(), PatternFileError> {
        let fields: Vec<&str> = text.split_whitespace().collect();
        let [angle, below] = fields[..] else {
            return Err(PatternFileReason::Fields { found: fields.len(), expected: 2 }.at(line));
        };
        let angle = number(line, "angle", angle)?;
        let below = number(line, "attenuation", below)?;
        if self.rows.last().is_some_and(|(last, _)| angle <= *last) {
            return Err(PatternFileReason::Order { angle }.at(line));
        }
        let first = self.rows.first().map_or(angle, |(first, _)| *first);
        if angle - first >= 360.0 {
            return Err(PatternFileReason::Turn { angle }.at(line));
        }
        if below < 0.0 {
            return Err(PatternFileReason::Attenuation { value: below }.at(line));
        }
        self.rows.push((angle, below));
        Ok(())
    }

    /// The rows, if they are as many as the section declares.
    fn close(self) -> Result<Vec<(f64, f64)>, PatternFileError> {
        let found = self.rows.len();
        let declared = self.declared;
        if found == declared {
            Ok(self.rows)
        } else {
            Err(PatternFileReason::Rows { section: self.name, found, declared }.at(self.line))
        }
    }
}

impl MsiFile {
    /// Reads the text of a file. The fields of a line are parted by tabs or spaces; a field may be
    /// blank; the sections may hold any number of rows, if they declare it.
    ///
    /// # Errors
    ///
    /// [`PatternFileError`] names the line and what is wrong with it.
    pub fn parse(text: &str) -> Result<Self, PatternFileError> {
        let mut fields: Vec<(String, String)> = Vec::new();
        let mut cuts: [Option<Section>; 2] = [None, None];
        let mut open = None;
        let mut gain = None;
        let mut last = 1;
        for (line, text) in lines(text) {
            last = line;
            let (name, value) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
            let value = value.trim();
            let section = SECTIONS.iter().position(|own| own.eq_ignore_ascii_case(name));
            if let Some(index) = section {
                if cuts[index].is_some() {
                    return Err(PatternFileReason::Twice { name: name.into() }.at(line));
                }
                let declared = value.parse().map_err(|_| {
                    let value = value.into();
                    PatternFileReason::NotANumber { field: "number of rows", value }.at(line)
                })?;
                let name = SECTIONS[index];
                cuts[index] = Some(Section { line, name, declared, rows: Vec::new() });
                open = Some(index);
            } else if let Some(section) = open.and_then(|index: usize| cuts[index].as_mut()) {
                section.push(line, text)?;
            } else {
                if fields.iter().any(|(own, _)| own.eq_ignore_ascii_case(name)) {
                    return Err(PatternFileReason::Twice { name: name.into() }.at(line));
                }
                if name.eq_ignore_ascii_case("GAIN") {
                    gain = Some(gain_of(line, value)?);
                }
                fields.push((name.into(), value.into()));
            }
        }
        let missing = |name| PatternFileReason::Missing { name }.at(last);
        let (gain, unit) = gain.ok_or_else(|| missing("GAIN"))?;
        let [horizontal, vertical] = cuts;
        let horizontal = horizontal.ok_or_else(|| missing(SECTIONS[0]))?.close()?;
        let vertical = vertical.ok_or_else(|| missing(SECTIONS[1]))?.close()?;
        let tabs = text.contains('\t');
        let file = Self { fields, gain, unit, horizontal, vertical, tabs };
        match file.antenna() {
            Ok(_) => Ok(file),
            Err(error) => Err(PatternFileReason::Table(error).at(last)),
        }
    }
}

/// The text of the file, as it was read but for how its numbers are written.
impl fmt::Display for MsiFile {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let gap = if self.tabs { '\t' } else { ' ' };
        for (name, value) in self.fields() {
            if value.is_empty() {
                writeln!(f, "{name}")?;
            } else {
                writeln!(f, "{name}{gap}{value}")?;
            }
        }
        for (name, rows) in SECTIONS.iter().zip([&self.horizontal, &self.vertical]) {
            writeln!(f, "{name}{gap}{}", rows.len())?;
            for (angle, below) in rows {
                writeln!(f, "{angle}{gap}{below}")?;
            }
        }
        Ok(())
    }
}

impl FromStr for MsiFile {
    type Err = PatternFileError;

    fn from_str(text: &str) -> Result<Self, PatternFileError> {
        Self::parse(text)
    }
}

/// The number and the unit of a gain.
fn gain_of(line: usize, value: &str) -> Result<(f64, MsiUnit), PatternFileError> {
    let unit = |suffix: &str| {
        let at = value.len().checked_sub(suffix.len())?;
        let (number, tail) = value.split_at_checked(at)?;
        tail.eq_ignore_ascii_case(suffix).then_some(number)
    };
    let (text, unit) = match (unit("dBi"), unit("dBd")) {
        (Some(text), _) => (text, MsiUnit::Dbi),
        (_, Some(text)) => (text, MsiUnit::Dbd),
        _ => return Err(PatternFileReason::Unit { value: value.into() }.at(line)),
    };
    Ok((number(line, "gain", text)?, unit))
}
