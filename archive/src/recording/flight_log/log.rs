//! Contents of a log: fixes, levels, and the numbers of binary logs.

use std::collections::BTreeMap;

use foxhunt_wire::geodesy::Geodetic;

/// Places and levels of a log, by times in seconds since 1970.
#[derive(Debug, Default)]
pub(in crate::recording) struct Log {
    pub fixes: Vec<Fix>,
    pub levels: Levels,
}

/// A place at a time in seconds since 1970.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::recording) struct Fix {
    pub time: f64,
    pub place: Geodetic,
}

/// A place at a time of the vehicle's own clock in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OwnFix {
    pub own_s: f64,
    pub place: Geodetic,
}

/// Fixes and levels of the vehicle's own clock in UTC. `pairs` are times of the own clock and of
/// UTC; their median offset stands for all, as single ones are late.
pub(super) fn in_utc(fixes: &[OwnFix], levels: Levels, pairs: &[[f64; 2]]) -> Result<Log, String> {
    let mut offsets: Vec<f64> = pairs.iter().map(|[own, utc]| utc - own).collect();
    offsets.sort_by(f64::total_cmp);
    let Some(offset) = offsets.get(offsets.len() / 2) else {
        return Err("no message of its GNSS says what time it was in UTC".to_owned());
    };
    let fix = |fix: &OwnFix| Fix { time: fix.own_s + offset, place: fix.place };
    Ok(Log { fixes: fixes.iter().map(fix).collect(), levels: levels.later(*offset) })
}

/// Levels by the names of their message and field, each with its times.
#[derive(Debug, Default)]
pub(in crate::recording) struct Levels(BTreeMap<String, Vec<[f64; 2]>>);

/// Scale of the numbers in a field.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Scale {
    /// `SiK` radios and what speaks like them: 1.9 steps to the decibel from −127 dBm on
    /// (ArduPilot/SiK, "RSSI").
    Sik,
    /// A share from 0 to 1, a byte up to 254 or per cent: per cent count as decibels.
    Share(f64),
    /// As it is.
    Decibels,
}

impl Scale {
    /// Returns the scale of a field of a message.
    fn of(name: &str) -> Self {
        match name {
            "RSSI.RXRSSI" => Self::Share(100.0),
            "RC_CHANNELS.rssi" => Self::Share(100.0 / 254.0),
            "input_rc.rssi" => Self::Share(1.0),
            "input_rc.rssi_dbm" => Self::Decibels,
            name if name.starts_with("NAMED_VALUE_FLOAT.") => Self::Decibels,
            _ => Self::Sik,
        }
    }

    /// Returns the level of a number; `None` for one that stands for no level.
    fn level(self, number: f64) -> Option<f64> {
        match self {
            Self::Sik => (number > 0.0 && number < 255.0).then(|| number / 1.9 - 127.0),
            Self::Share(percent) => {
                (number > 0.0 && number * percent <= 100.0).then_some(number * percent)
            }
            Self::Decibels => number.is_finite().then_some(number),
        }
    }
}

impl Levels {
    /// Takes a number of a field, if it stands for a level.
    pub(super) fn take(&mut self, name: &str, time: f64, number: f64) {
        if let Some(level) = Scale::of(name).level(number) {
            self.0.entry(name.to_owned()).or_default().push([time, level]);
        }
    }

    /// Adds seconds to all times.
    fn later(mut self, seconds: f64) -> Self {
        for pair in self.0.values_mut().flatten() {
            pair[0] += seconds;
        }
        self
    }

    /// Returns the levels of a name, or the only ones without a name, if a decibel of theirs is
    /// known to be one.
    pub(in crate::recording) fn chosen(&self, name: Option<&str>) -> Option<(&str, &[[f64; 2]])> {
        let found = match (name, self.0.len()) {
            (Some(name), _) => self.0.get_key_value(name)?,
            (None, 1) => self.0.iter().find(|(name, _)| Scale::of(name) == Scale::Sik)?,
            (None, _) => return None,
        };
        Some((found.0, found.1))
    }

    pub(in crate::recording) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns each name with its number of levels, as the end of a sentence.
    pub(in crate::recording) fn listed(&self) -> String {
        let each = self.0.iter().map(|(name, levels)| format!("{name} ({})", levels.len()));
        each.collect::<Vec<_>>().join(", ")
    }

    /// Returns the words for the scale of a name.
    pub(in crate::recording) fn scale(name: &str) -> &'static str {
        match Scale::of(name) {
            Scale::Sik => "in dBm by the scale of SiK radios",
            Scale::Share(_) => "in per cent, each counted as a decibel",
            Scale::Decibels => "taken as decibels",
        }
    }
}

/// The bytes at an offset, as many as the array has; `None` beyond the end.
pub(super) fn binary_array<const N: usize>(bytes: &[u8], at: usize) -> Option<[u8; N]> {
    let end = at.checked_add(N)?;
    bytes.get(at..end)?.try_into().ok()
}

/// A number at an offset, by the name of its type in C.
pub(super) fn binary_number(bytes: &[u8], at: usize, kind: &str) -> Option<f64> {
    #[expect(clippy::cast_precision_loss, reason = "microseconds of a flight are below 2^53")]
    Some(match kind {
        "uint8_t" | "bool" | "char" => f64::from(u8::from_le_bytes(binary_array(bytes, at)?)),
        "int8_t" => f64::from(i8::from_le_bytes(binary_array(bytes, at)?)),
        "uint16_t" => f64::from(u16::from_le_bytes(binary_array(bytes, at)?)),
        "int16_t" => f64::from(i16::from_le_bytes(binary_array(bytes, at)?)),
        "uint32_t" => f64::from(u32::from_le_bytes(binary_array(bytes, at)?)),
        "int32_t" => f64::from(i32::from_le_bytes(binary_array(bytes, at)?)),
        "uint64_t" => u64::from_le_bytes(binary_array(bytes, at)?) as f64,
        "int64_t" => i64::from_le_bytes(binary_array(bytes, at)?) as f64,
        "float" => f64::from(f32::from_le_bytes(binary_array(bytes, at)?)),
        "double" => f64::from_le_bytes(binary_array(bytes, at)?),
        _ => return None,
    })
}

/// The size of a type in bytes.
pub(super) fn binary_size(kind: &str) -> Option<usize> {
    Some(match kind {
        "uint8_t" | "int8_t" | "bool" | "char" => 1,
        "uint16_t" | "int16_t" => 2,
        "uint32_t" | "int32_t" | "float" => 4,
        "uint64_t" | "int64_t" | "double" => 8,
        _ => return None,
    })
}
