//! Reports of an autopilot with their times: texts, and values of parameters.

use std::collections::VecDeque;

use foxhunt_wire::mavlink::{
    Autopilot,
    dialect::{MavParamType, MavSeverity, PARAM_VALUE_DATA, STATUSTEXT_DATA},
};

/// Number of texts that are kept.
const KEPT_TEXTS: usize = 16;

/// Longest time in seconds between two chunks of one text.
const JOINED_S: f64 = 5.0;

/// Beginning of the texts of PX4's checks before arming.
const PX4_CHECK: &str = "Preflight Fail";

/// Number of reasons that are given at once.
const REASONS: usize = 3;

/// A message's content, and its time in seconds of the driver's clock.
#[derive(Clone, Copy, Debug)]
pub(super) struct Timed<T> {
    pub at: f64,
    pub value: T,
}

/// The last texts of the autopilot (STATUSTEXT), the newest last.
///
/// Longer texts come in chunks of 50 bytes with a common number; the last one is shorter. They are
/// joined as they come, and a chunk that is missing leaves an ellipsis.
#[derive(Debug, Default)]
pub(super) struct Texts(VecDeque<Text>);

#[derive(Debug)]
struct Text {
    at: f64,
    severity: MavSeverity,
    words: String,
    /// The number of a text in chunks, and of the chunk that is to follow.
    chunks: Option<(u16, u8)>,
}

impl Texts {
    pub(super) fn take(&mut self, now: f64, message: &STATUSTEXT_DATA) {
        let bytes: Vec<u8> = message.text.iter().copied().take_while(|byte| *byte != 0).collect();
        let ends = bytes.len() < message.text.iter().count();
        let words = String::from_utf8_lossy(&bytes);
        let id = message.id;
        let sequence = message.chunk_seq;
        let follows = (id != 0 && !ends).then_some((id, sequence.saturating_add(1)));
        let begun = self.0.iter_mut().rev().find(|text| {
            let same = text.chunks.is_some_and(|(begun, _)| id != 0 && begun == id);
            same && sequence > 0 && now - text.at <= JOINED_S
        });
        if let Some(text) = begun {
            if text.chunks != Some((id, sequence)) {
                text.words.push('…');
            }
            text.words.push_str(&words);
            (text.at, text.chunks) = (now, follows);
            return;
        }
        if self.0.len() >= KEPT_TEXTS {
            self.0.pop_front();
        }
        let missing = if id != 0 && sequence > 0 { "…" } else { "" };
        let words = format!("{missing}{words}");
        self.0.push_back(Text { at: now, severity: message.severity, words, chunks: follows });
    }

    /// All texts, the newest first.
    pub(super) fn all(&self) -> impl Iterator<Item = &str> {
        self.0.iter().rev().map(|text| text.words.trim())
    }

    /// Returns its complaints since `since`, the newest first.
    pub(super) fn complaints(&self, since: f64) -> impl Iterator<Item = &str> {
        self.timed_complaints(since).map(|(_, words)| words)
    }

    /// Returns its last complaint since `since`, with its time.
    pub(super) fn complained(&self, since: f64) -> Option<(f64, &str)> {
        self.timed_complaints(since).next()
    }

    fn timed_complaints(&self, since: f64) -> impl Iterator<Item = (f64, &str)> {
        self.0.iter().rev().filter_map(move |text| {
            let words = text.words.trim();
            let bad = text.severity as u32 <= MavSeverity::MAV_SEVERITY_WARNING as u32
                || words.starts_with("PreArm:")
                || words.starts_with("Arm:");
            (bad && !is_good_news(words) && text.at >= since).then_some((text.at, words))
        })
    }

    /// Returns why it refused an order, in the words that it wrote since `since`: PX4's checks,
    /// which come before "Arming denied", if there are any, or else the newest complaint.
    pub(super) fn reason(&self, since: f64) -> Option<String> {
        let mut checks: Vec<&str> = Vec::new();
        for words in self.complaints(since).filter(|words| words.starts_with(PX4_CHECK)) {
            if !checks.contains(&words) {
                checks.push(words);
            }
        }
        checks.truncate(REASONS);
        match checks.is_empty() {
            true => self.complaints(since).next().map(str::to_owned),
            false => Some(checks.join("; ")),
        }
    }
}

/// Returns true if a text reports that something is well again: ArduCopter sends "GCS Failsafe
/// Cleared" and its like as warnings.
pub(super) fn is_good_news(words: &str) -> bool {
    let words = words.to_ascii_lowercase();
    ["cleared", "recovered", "regained", "restored", "arming motors"]
        .iter()
        .any(|good| words.contains(good))
}

/// The number of a parameter. PX4 has the bits of whole numbers in the field of a float, ArduPilot
/// floats (MAVLink's parameter protocol: bytewise and C-cast encodings).
pub(super) fn parameter(autopilot: Autopilot, message: &PARAM_VALUE_DATA) -> f64 {
    let bits = message.param_value.to_bits();
    match (autopilot, message.param_type) {
        (Autopilot::Px4, MavParamType::MAV_PARAM_TYPE_INT32) => f64::from(bits.cast_signed()),
        (Autopilot::Px4, MavParamType::MAV_PARAM_TYPE_UINT32) => f64::from(bits),
        _ => f64::from(message.param_value),
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use foxhunt_wire::mavlink::CharArray;

    use super::*;

    fn chunk(id: u16, chunk_seq: u8, text: &str) -> STATUSTEXT_DATA {
        let severity = MavSeverity::MAV_SEVERITY_CRITICAL;
        STATUSTEXT_DATA { severity, id, chunk_seq, text: text.into() }
    }

    fn of(chunks: &[(u16, u8, &str)]) -> Vec<String> {
        let mut texts = Texts::default();
        for (id, sequence, text) in chunks {
            texts.take(1.0, &chunk(*id, *sequence, text));
        }
        texts.all().map(str::to_owned).collect()
    }

    #[test]
    fn chunks_are_joined() {
        let first = "Arming denied: Resolve system health failures firs";
        assert_eq!(first.len(), 50);
        let whole = "Arming denied: Resolve system health failures first";
        assert_eq!(of(&[(7, 0, first), (7, 1, "t")]), [whole]);
        // Another text in between, and a whole one that fills its message.
        assert_eq!(of(&[(7, 0, first), (0, 0, "Ready"), (7, 1, "t")]), ["Ready", whole]);
        assert_eq!(of(&[(0, 0, first), (0, 0, "t")]), ["t", first]);
        // The second of three, and the first of two, are lost.
        let second = "0123456789".repeat(5);
        let lost = of(&[(7, 0, first), (7, 2, "end")]);
        assert_eq!(lost, [format!("{first}…end")]);
        assert_eq!(of(&[(7, 1, &second), (7, 2, "end")]), [format!("…{second}end")]);
        // A number that begins again is another text.
        assert_eq!(of(&[(7, 0, "one"), (7, 0, "two")]), ["two", "one"]);
        assert_eq!(of(&[(7, 0, first), (7, 0, first), (7, 1, "t")]), [whole, first]);
    }

    #[test]
    fn a_reason_is_that_of_the_checks() {
        let mut texts = Texts::default();
        assert_eq!(texts.reason(0.0), None);
        texts.take(1.0, &chunk(0, 0, "Preflight Fail: Compass 0 uncalibrated"));
        texts.take(1.1, &chunk(0, 0, "Preflight Fail: No connection to the GCS"));
        texts.take(1.2, &chunk(0, 0, "Preflight Fail: No connection to the GCS"));
        texts.take(1.3, &chunk(0, 0, "Arming denied"));
        let reason =
            "Preflight Fail: No connection to the GCS; Preflight Fail: Compass 0 uncalibrated";
        assert_eq!(texts.reason(0.0).as_deref(), Some(reason));
        assert_eq!(texts.reason(1.25).as_deref(), Some("Arming denied"));
    }

    #[test]
    fn whole_numbers_of_px4_are_bits() {
        let message = |param_value, param_type| PARAM_VALUE_DATA {
            param_value,
            param_type,
            param_count: 1,
            param_index: 0,
            param_id: CharArray::from("X"),
        };
        let bits = message(f32::from_bits(3), MavParamType::MAV_PARAM_TYPE_INT32);
        assert_abs_diff_eq!(parameter(Autopilot::Px4, &bits), 3.0, epsilon = 1e-9);
        let minus = message(f32::from_bits(u32::MAX), MavParamType::MAV_PARAM_TYPE_INT32);
        assert_abs_diff_eq!(parameter(Autopilot::Px4, &minus), -1.0, epsilon = 1e-9);
        let cast = message(3.0, MavParamType::MAV_PARAM_TYPE_INT32);
        assert_abs_diff_eq!(parameter(Autopilot::ArduPilot, &cast), 3.0, epsilon = 1e-9);
        let float = message(2.5, MavParamType::MAV_PARAM_TYPE_REAL32);
        assert_abs_diff_eq!(parameter(Autopilot::Px4, &float), 2.5, epsilon = 1e-9);
    }
}
