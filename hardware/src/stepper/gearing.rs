use std::f64::consts::TAU;

/// Steps in a turn, as an exact fraction: each target is rounded by itself, so that roundings do
/// not add up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gearing {
    pub(super) numerator: u32,
    pub(super) denominator: u32,
}

/// Fractions of a turn are taken in units of 2⁻⁵².
const FRACTION_BITS: u32 = 52;

/// More turns than this are refused, so that nothing overflows.
const MOST_TURNS: f64 = 1e6;

impl Gearing {
    /// The step next to an angle in radians, halves away from zero; `None` for more than a million
    /// turns or no number.
    #[expect(clippy::cast_possible_truncation, reason = "below 2⁵² after scaling, whole turns few")]
    pub(super) fn steps(self, angle: f64) -> Option<i64> {
        let turns = angle / TAU;
        if turns.is_nan() || turns.abs() > MOST_TURNS {
            return None;
        }
        let whole = turns.floor();
        let fraction = ((turns - whole) * 2_f64.powi(FRACTION_BITS.cast_signed())).round();
        let scaled = (i128::from(whole as i64) << FRACTION_BITS) + i128::from(fraction as i64);
        let steps = scaled * i128::from(self.numerator);
        let unit = i128::from(self.denominator) << FRACTION_BITS;
        let rounded = (steps.abs() + unit / 2) / unit * steps.signum();
        i64::try_from(rounded).ok()
    }

    /// The angle of a step in radians.
    #[expect(clippy::cast_precision_loss, reason = "whole turns are few, the rest is below 2³²")]
    pub(super) fn angle(self, steps: i64) -> f64 {
        let steps = i128::from(steps);
        let turn = i128::from(self.numerator);
        let scaled = steps * i128::from(self.denominator);
        let whole = scaled.div_euclid(turn) as f64;
        let rest = scaled.rem_euclid(turn) as f64 / f64::from(self.numerator);
        (whole + rest) * TAU
    }

    /// Steps in a turn.
    pub(super) fn per_turn(self) -> f64 {
        f64::from(self.numerator) / f64::from(self.denominator)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The gear of a 28BYJ-48: (31·32·26·22)/(9·11·10·9), 64 half steps a turn of its rotor.
    const GEAR: Gearing = Gearing { numerator: 64 * 283_712, denominator: 4455 };

    #[test]
    fn a_thousand_turns_do_not_drift() {
        assert!((GEAR.per_turn() - 4_075.772_8).abs() < 1e-4);
        for turn in -1000..=1000_i32 {
            for position in 0..16 {
                let angle = TAU * (f64::from(turn) + f64::from(position) / 16.0);
                let steps = GEAR.steps(angle).expect("in range");
                let error = (GEAR.angle(steps) - angle).abs();
                assert!(error <= TAU / GEAR.per_turn() * 0.5 + 1e-9, "{turn}: {error}");
            }
        }
        // 4455 turns are a whole number of steps.
        assert_eq!(GEAR.steps(TAU * 4455.0), Some(64 * 283_712));
        assert_eq!([GEAR.steps(f64::NAN), GEAR.steps(1e7)], [None; 2]);
        assert_eq!(GEAR.steps(f64::NEG_INFINITY), None);
    }

    proptest! {
        #[test]
        fn a_step_is_its_own_nearest(steps in -100_000_000..100_000_000_i64) {
            prop_assert_eq!(GEAR.steps(GEAR.angle(steps)), Some(steps));
        }
    }
}
