/// Levels of the Arduino's ports of eight pins, as far as they were reported since they were
/// requested.
pub(super) type Levels = [Option<u8>; 16];

/// Returns true if the pins of IN1 to IN4 have the levels of a count of half steps; `None` while
/// some are not reported.
pub(super) fn agree(pins: [u8; 4], count: i64, levels: &Levels) -> Option<bool> {
    let mut agree = true;
    for (coil, pin) in (0..).zip(pins) {
        let level = (*levels.get(usize::from(pin / 8))?)? >> (pin % 8) & 1 == 1;
        // Each coil is on in its own half step, and in those before and after.
        let on = (count - 2 * coil + 1).rem_euclid(8) < 3;
        agree &= level == on;
    }
    Some(agree)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coils_take_turns_at_the_pins_that_lead_to_them() {
        let with = |port_1: u8| {
            let mut levels = Levels::default();
            levels[1] = Some(port_1);
            levels
        };
        let patterns = [0x1, 0x3, 0x2, 0x6, 0x4, 0xC, 0x8, 0x9];
        for (count, pattern) in (0..).zip(patterns) {
            assert_eq!(agree([8, 9, 10, 11], count - 16, &with(pattern)), Some(true), "{count}");
            assert_eq!(agree([8, 9, 10, 11], count + 1, &with(pattern)), Some(false), "{count}");
        }
        // Levels of another port are missing.
        assert_eq!(agree([7, 9, 10, 11], 0, &with(0x1)), None);
    }
}
