//! Logs of a KrakenSDR, which has no header, with what such logs suffer from.

use core::fmt::Write as _;

use super::{
    bearings,
    geodesy::Origin,
    random::Random,
    recording::{DrawnFile, DrawnRecording},
};

/// Draws a drive with an array on the roof, with rows without a fix or a clock that steps back.
pub(super) fn drive(random: &mut Random) -> DrawnRecording {
    let origin = Origin { lat_deg: -36.85, lon_deg: 174.76 };
    let length_m = random.between(1_500.0, 6_000.0);
    let count = random.count(40, 120);
    let from = [random.between(0.1, 0.9) * length_m, random.sign() * 0.3 * length_m];
    let no_fix = random.chance(0.5);
    let back_at = if no_fix { count } else { random.count(1, count) };
    let back_ms = whole_ms(random.between(1_000.0, 60_000.0));
    let mut text = String::new();
    for row in 0..count {
        let east_m = length_m * f64::from(row) / f64::from(count);
        let bearing_deg = bearings::compass_deg([east_m, 0.0], from);
        let bearing_deg = bearing_deg + random.normal(4.0);
        let doa_deg = (bearing_deg - 90.0).rem_euclid(360.0).round();
        let distance_m = (from[0] - east_m).hypot(from[1]);
        let power_db = -5.0 - 25.0 * (distance_m / 100.0).log10() + random.normal(4.0);
        let mut at = origin.degrees([east_m, 0.0]);
        if no_fix && random.chance(0.05) {
            at = [0.0, 0.0];
        }
        let back = if row >= back_at { back_ms } else { 0 };
        let time_ms = 1_767_225_603_000 + 3000 * u64::from(row) - back;
        let confidence = random.between(2.0, 9.0);
        // Writing to a string does not fail.
        let _ = write!(
            text,
            "{time_ms}, {doa_deg}, {confidence:.2}, {power_db:.2}, 144500000, Circular, 350, KR1, \
             {:.7}, {:.7}, 90.0, 90.0, GPS, R, R, R, R",
            at[0], at[1],
        );
        text.push_str(&", -30.00".repeat(360));
        text.push('\n');
    }
    let [lat_deg, lon_deg] = origin.degrees(from);
    DrawnRecording {
        files: vec![DrawnFile { name: "kraken.csv".to_owned(), text }],
        flags: vec!["--format=krakensdr".to_owned(), format!("--truth={lat_deg:.7},{lon_deg:.7}")],
        header: 0,
        bound: None,
        is_empty: false,
    }
}

/// Converts positive milliseconds to whole ones.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a minute at most")]
fn whole_ms(value: f64) -> u64 {
    value as u64
}
