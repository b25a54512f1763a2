use alloc::{string::String, vec::Vec};
use core::{fmt, str::FromStr};

use super::{MsiFile, MsiUnit, PatternFileError, PatternFileReason, csv::lines, number};

/// Names of the sections, in their order.
const SECTIONS: [&str; 2] = ["HORIZONTAL", "VERTICAL"];

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
