//! Errors that were learned of the receivers of a hunt, in words.

use foxhunt_core::Remark;
use foxhunt_estimators::LearnedReceiver;

/// Standard deviations from zero beyond which an offset is said: one of 370 receivers without an
/// offset has one beyond it.
const CERTAIN: f64 = 3.0;

/// Factor on the stated σ from which on it is said that a receiver scatters.
const SCATTERS: f64 = 2.0;

/// Remarks on the receivers whose levels or compass are off, or that scatter by more than they say;
/// `name` names a receiver by its number.
pub fn remarks_of_receivers(
    learned: &[(usize, LearnedReceiver)],
    name: impl Fn(usize) -> String,
) -> Vec<Remark> {
    let mut remarks = Vec::new();
    for (number, receiver) in learned {
        let name = name(*number);
        let is_off = |[off, sigma]: [f64; 2]| off.abs() > CERTAIN * sigma;
        if let Some([off, sigma]) = receiver.level_from_others_db.filter(|off| is_off(*off)) {
            let side = if off > 0.0 { "higher" } else { "lower" };
            let text = format!(
                "{name} reads all levels {:.1} dB {side} than the other receivers (σ {sigma:.1} \
                 dB); this was taken off. Look at its antenna, its cable and its gain, or \
                 calibrate it",
                off.abs()
            );
            remarks.push(Remark::new("receiver-level-off", text));
        }
        if is_off(receiver.bearing_offset) {
            let [off, sigma] = receiver.bearing_offset.map(f64::to_degrees);
            let side = if off > 0.0 { "counter-clockwise" } else { "clockwise" };
            let text = format!(
                "the bearings of {name} are {:.0}° too far {side} (σ {sigma:.0}°); this was \
                 taken off. Calibrate its compass, and look at how its antenna is mounted",
                off.abs()
            );
            remarks.push(Remark::new("receiver-compass-off", text));
        }
        for (quantity, scatter) in ["levels", "bearings"].into_iter().zip(receiver.scatter) {
            if scatter > SCATTERS {
                let text = format!(
                    "the {quantity} of {name} scatter {scatter:.1} times as much as they state, \
                     and count for less"
                );
                remarks.push(Remark::new("receiver-scatters", text));
            }
        }
    }
    remarks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn receivers_are_named_with_what_they_get_wrong() {
        let sound = LearnedReceiver {
            level_offset_db: [1.0, 0.9],
            level_from_others_db: Some([-6.0, 2.1]),
            bearing_offset: [-0.05, 0.03],
            scatter: [1.1, 0.9],
            receptions: 20,
        };
        let car = LearnedReceiver {
            level_from_others_db: Some([8.1, 1.2]),
            bearing_offset: [-25.0_f64.to_radians(), 0.05],
            scatter: [1.0, 2.4],
            ..sound
        };
        let name = |number: usize| ["walker", "car"][number].to_owned();
        let remarks = remarks_of_receivers(&[(0, sound), (1, car)], name);
        let codes: Vec<&str> = remarks.iter().map(|remark| &*remark.code).collect();
        assert_eq!(codes, ["receiver-level-off", "receiver-compass-off", "receiver-scatters"]);
        assert!(remarks[0].text.starts_with("car reads all levels 8.1 dB higher than the other"));
        assert!(remarks[1].text.starts_with("the bearings of car are 25° too far clockwise"));
        assert!(remarks[2].text.contains("bearings of car scatter 2.4 times"));
    }
}
