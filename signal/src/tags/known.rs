use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{
    TagError,
    row::{Row, Rows, bytes_of},
};

/// A tag that is known to be about.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct KnownTag {
    /// Its name.
    pub name: String,
    /// The frequency of its carrier, in hertz, about the same reference as that of the pulses.
    pub frequency_hz: Option<f64>,
    /// Interval from pulse to pulse, or from burst to burst of a coded tag, in seconds.
    pub interval_s: f64,
    /// A second interval: that of mortality or activity, in seconds.
    pub other_interval_s: Option<f64>,
    /// Duration of a pulse, in seconds.
    pub width_s: Option<f64>,
    /// The gaps between the pulses of a coded tag's burst, in seconds; empty for an uncoded one.
    pub gaps_s: Vec<f64>,
}

impl KnownTag {
    /// An uncoded tag of unknown frequency and width.
    #[must_use]
    pub fn new(name: impl Into<String>, interval_s: f64) -> Self {
        Self {
            name: name.into(),
            frequency_hz: None,
            interval_s,
            other_interval_s: None,
            width_s: None,
            gaps_s: Vec::new(),
        }
    }

    /// Sets the frequency of its carrier, in hertz.
    #[must_use]
    pub fn with_frequency_hz(self, frequency_hz: f64) -> Self {
        Self { frequency_hz: Some(frequency_hz), ..self }
    }

    /// Sets the width of its pulses, in seconds.
    #[must_use]
    pub fn with_width_s(self, width_s: f64) -> Self {
        Self { width_s: Some(width_s), ..self }
    }

    /// Sets the second interval, in seconds.
    #[must_use]
    pub fn with_other_interval_s(self, other_interval_s: f64) -> Self {
        Self { other_interval_s: Some(other_interval_s), ..self }
    }

    /// Sets the gaps between the pulses of its bursts, in seconds.
    #[must_use]
    pub fn with_gaps_s(self, gaps_s: Vec<f64>) -> Self {
        Self { gaps_s, ..self }
    }

    /// Duration of a burst from its first pulse to its last, in seconds.
    #[must_use]
    pub fn burst_s(&self) -> f64 {
        self.gaps_s.iter().sum()
    }
}

/// The tags that are known to be about.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct TagTable {
    tags: Vec<KnownTag>,
}

const WANTED: &str = "a table of tags: name, interval_s and at will frequency_hz, width_s, \
                      gaps_ms, other_interval_s (foxhunt); tagID, nomFreq, offsetFreq, period, pulseLen, \
                      param1, param2, param3 (SensorGnome)";

impl TagTable {
    /// A table of these tags.
    #[must_use]
    pub fn new(tags: Vec<KnownTag>) -> Self {
        Self { tags }
    }

    /// Reads a table.
    ///
    /// - foxhunt: `name, interval_s`, and where they are known `frequency_hz, width_s, gaps_ms,
    ///   other_interval_s`; the gaps of a burst are separated by spaces;
    /// - SensorGnome: `tagID, nomFreq` (MHz), `offsetFreq` (kHz), `period` (s), `pulseLen` (ms),
    ///   `param1` to `param3` (gaps in ms). Its frequencies are left out: the pulses of such a
    ///   receiver are about a centre that its files do not hold.
    ///
    /// # Errors
    ///
    /// If the file cannot be read, its columns are neither, a field is not what it must be, or a
    /// name occurs twice.
    pub fn read(file: &Path) -> Result<Self, TagError> {
        Self::parse(file, &bytes_of(file)?)
    }

    /// Reads the bytes of a table; errors name `file`.
    ///
    /// # Errors
    ///
    /// The errors of [`TagTable::read`].
    pub fn parse(file: &Path, bytes: &[u8]) -> Result<Self, TagError> {
        let rows = Rows::parse(file, bytes)?;
        let read = if rows.has(&["name", "interval_s"]) {
            own
        } else if rows.has(&["tagID", "nomFreq", "period", "pulseLen", "param1"]) {
            sensorgnome
        } else {
            return Err(rows.unknown(WANTED));
        };
        let mut tags: Vec<KnownTag> = Vec::new();
        for row in rows.iter() {
            let tag = read(&row)?;
            if tags.iter().any(|other| other.name == tag.name) {
                return Err(row.twice(&tag.name));
            }
            tags.push(tag);
        }
        Ok(Self { tags })
    }

    /// The tags, in the table's order.
    #[must_use]
    pub fn tags(&self) -> &[KnownTag] {
        &self.tags
    }
}

fn own(row: &Row<'_>) -> Result<KnownTag, TagError> {
    let name = row.text("name").ok_or_else(|| row.error("name", "a name"))?;
    let gap = |text: &str| text.parse::<f64>().ok().filter(|gap| gap.is_finite() && *gap > 0.0);
    let gaps: Option<Vec<f64>> =
        row.text("gaps_ms").unwrap_or_default().split_whitespace().map(gap).collect();
    let gaps = gaps.ok_or_else(|| row.error("gaps_ms", "numbers above 0 between spaces"))?;
    let frequency = row.text("frequency_hz").map(|_| row.number("frequency_hz")).transpose()?;
    Ok(KnownTag {
        name: name.to_owned(),
        frequency_hz: frequency,
        interval_s: row.positive("interval_s")?,
        other_interval_s: row.optional("other_interval_s")?,
        width_s: row.optional("width_s")?,
        gaps_s: gaps.iter().map(|gap| 1e-3 * gap).collect(),
    })
}

fn sensorgnome(row: &Row<'_>) -> Result<KnownTag, TagError> {
    let name = row.text("tagID").ok_or_else(|| row.error("tagID", "a name"))?;
    let gaps = ["param1", "param2", "param3"].map(|column| row.optional(column));
    let mut gaps_s = Vec::new();
    for gap in gaps {
        gaps_s.extend(gap?.map(|gap| 1e-3 * gap));
    }
    let tag = KnownTag::new(name, row.positive("period")?);
    Ok(tag.with_width_s(1e-3 * row.positive("pulseLen")?).with_gaps_s(gaps_s))
}
