use core::f64::consts::TAU;

/// Number of fields of a line.
const FIELDS: usize = 377;
/// Number of fields of the pseudo-spectrum, and of the fields before it.
const BINS: usize = 360;
const BEFORE: usize = FIELDS - BINS;
/// Maximum number of lines of a page: a `KrakenSDR` has at most 16 channels.
const LINES: usize = 16;

/// A line of `KrakenSDR`'s page `DOA_value.html`: the directions from which one channel is
/// received.
#[derive(Clone, Debug, PartialEq)]
pub struct KrakenDoa {
    /// The time in milliseconds of UNIX time, by its clock.
    pub unix_ms: u64,
    /// Its own opinion of how sure the direction is, from 0 to 99.
    pub confidence: f64,
    /// The power, in dB over its full scale.
    pub power_db: f64,
    /// The channel's frequency in Hz.
    pub frequency_hz: f64,
    /// Likelihood of each of 360 directions, in dB below the likeliest; `i` is `i` degrees
    /// counter-clockwise of the array's front.
    pub spectrum_db: Vec<f64>,
}

/// Reason for refusing a line.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum KrakenError {
    /// It was read while it was written, or is something else.
    #[error("a line of KrakenSDR has {FIELDS} fields; this one has {fields}")]
    Fields {
        /// Number of its fields.
        fields: usize,
    },
    /// A field is no number.
    #[error("field {field} of a line of KrakenSDR is {text:?}, which is no number")]
    Number {
        /// Number of the field, from 1.
        field: usize,
        /// Text of the field.
        text: String,
    },
}

/// Numbers are smaller than this; a frequency in Hz is the largest.
const LARGEST: f64 = 1e12;

impl KrakenDoa {
    /// The lines of a page; tags around them are left out.
    #[must_use]
    pub fn page(text: &str) -> Vec<Result<Self, KrakenError>> {
        let lines = text.lines().map(|line| {
            let line = line.trim();
            let line = line.rsplit_once("<html>").map_or(line, |(_, rest)| rest);
            line.split('<').next().unwrap_or_default().trim()
        });
        lines.filter(|line| !line.is_empty()).take(LINES).map(Self::line).collect()
    }

    /// The line that this text is.
    ///
    /// # Errors
    ///
    /// [`KrakenError`] names what is wrong with it.
    pub fn line(text: &str) -> Result<Self, KrakenError> {
        let texts: Vec<&str> = text.split(',').map(str::trim).take(FIELDS + 1).collect();
        if texts.len() != FIELDS {
            return Err(KrakenError::Fields { fields: text.split(',').count() });
        }
        let wrong = |field: usize| {
            let text = texts.get(field - 1).copied().unwrap_or_default();
            KrakenError::Number { field, text: text.chars().take(40).collect() }
        };
        // Counted from 1, as everybody does.
        let number = |field: usize| {
            let value = texts.get(field - 1).and_then(|text| text.parse().ok());
            value.filter(|value: &f64| value.abs() < LARGEST).ok_or_else(|| wrong(field))
        };
        let unix_ms = texts.first().and_then(|text| text.parse().ok()).ok_or_else(|| wrong(1))?;
        let spectrum = (BEFORE + 1..=FIELDS).map(number).collect::<Result<Vec<_>, _>>()?;
        let highest = spectrum.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Ok(Self {
            unix_ms,
            confidence: number(3)?,
            power_db: number(4)?,
            frequency_hz: number(5)?,
            spectrum_db: spectrum.into_iter().map(|value| value - highest).collect(),
        })
    }

    /// The direction of the spectrum's maximum, in radians counter-clockwise of the array's front.
    #[must_use]
    pub fn direction(&self) -> f64 {
        let highest = (0_u16..).zip(&self.spectrum_db).max_by(|a, b| a.1.total_cmp(b.1));
        highest.map_or(0.0, |(index, _)| f64::from(index) * TAU / 360.0)
    }

    /// The line as the receiver writes it, without the fields that are not read.
    #[must_use]
    pub fn write(&self) -> String {
        let clockwise = (360.0 - self.direction().to_degrees()).rem_euclid(360.0);
        let mut text = format!(
            "{}, {clockwise:.0}, {:.2}, {:.2}, {:.0}, UCA, 100, foxhunt, 0.0, 0.0, 0, 0, \
             Kraken, R, R, R, R",
            self.unix_ms, self.confidence, self.power_db, self.frequency_hz
        );
        for value in &self.spectrum_db {
            text.push_str(&format!(", {value:.2}"));
        }
        text.push('\n');
        text
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn doa(front: u16) -> KrakenDoa {
        let aside = |bin: u16| {
            let apart = bin.abs_diff(front);
            f64::from(apart.min(360 - apart))
        };
        KrakenDoa {
            unix_ms: 1_700_000_000_123,
            confidence: 9.5,
            power_db: -42.25,
            frequency_hz: 433_920_000.0,
            spectrum_db: (0..360).map(|bin| -0.25 * aside(bin)).collect(),
        }
    }

    #[test]
    fn lines_come_back_as_they_were() {
        for front in [0, 1, 90, 359] {
            let written = doa(front);
            let read = KrakenDoa::line(written.write().trim()).expect("it is in order");
            assert_eq!(read, written);
            assert!((read.direction() - f64::from(front).to_radians()).abs() < 1e-12);
        }
        let page = format!("<html>{}</html>\n{}", doa(3).write().trim(), doa(7).write());
        let lines = KrakenDoa::page(&page);
        assert_eq!(lines, [Ok(doa(3)), Ok(doa(7))]);
    }

    #[test]
    fn torn_lines_and_other_texts_are_refused() {
        let line = doa(3).write();
        let (torn, _) = line.trim().rsplit_once(',').expect("it has fields");
        assert_eq!(KrakenDoa::line(torn), Err(KrakenError::Fields { fields: 376 }));
        assert_eq!(KrakenDoa::line("hello"), Err(KrakenError::Fields { fields: 1 }));
        let wrong = KrakenDoa::line(&line.trim().replace("-42.25, 4339", "NaN, 4339"));
        assert_eq!(wrong, Err(KrakenError::Number { field: 4, text: "NaN".into() }));
    }

    proptest! {
        #[test]
        fn nothing_breaks_it(text in ".*", fields in prop::collection::vec("[0-9.e-]{1,6}", 377)) {
            let _ = KrakenDoa::page(&text);
            let _ = KrakenDoa::line(&fields.join(","));
        }
    }
}
