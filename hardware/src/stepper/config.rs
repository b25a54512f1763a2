//! Settings of an antenna's stepper, and its gearing.

use std::f64::consts::TAU;

use foxhunt_core::parameter::{FieldError, in_range, require};
use serde::{Deserialize, Serialize};

/// Steps at the beginning of a move that may be quicker than its speed.
const QUICK_STEPS: f64 = 3.0;

/// Part of a duration that clocks may leave of it.
const SLACK: f64 = 0.985;

/// Time by which AccelStepper's ramps are shorter than exact ones, in seconds times √(steps/s²).
/// Computed for 100 to 20,000 steps/s²: at most 2.86.
const FIRST_WAITS: f64 = 3.0;

/// ConfigurableFirmata's default acceleration, in steps/s².
const AT_ONCE: f64 = 1e6;

/// Fractions of a turn are taken in units of 2⁻⁵².
const FRACTION_BITS: u32 = 52;

/// More turns than this are refused, so that nothing overflows.
const MOST_TURNS: f64 = 1e6;

/// An antenna on a stepper behind Firmata.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FirmataConfig {
    /// The stepper's number on its Arduino, from 0 to 9.
    pub device: u8,
    /// The Arduino's pins that lead to IN1, IN2, IN3 and IN4 of the motor's driver.
    pub pins: [u8; 4],
    /// Half steps of the motor in a turn of the antenna, as numerator and denominator.
    pub half_steps_per_turn: [u32; 2],
    /// True if steps forwards turn the antenna clockwise, from above.
    pub clockwise: bool,
    /// Speed in half steps per second.
    pub speed_half_steps_per_s: f64,
    /// Acceleration in half steps per second squared; 0 is at once.
    pub acceleration_half_steps_per_s2: f64,
    /// Approach to an angle in spite of the gear's play.
    pub approach: Approach,
    /// The play of the gear in degrees, rather too much for an approach from one side.
    pub backlash_deg: f64,
    /// Turns that the cable allows to either side of 0; `inf` for a slip ring.
    pub cable_turns: f64,
    /// Treatment of an order beyond that.
    pub beyond_cable: BeyondCable,
    /// Source of the antenna's direction at the beginning.
    pub homing: Homing,
    /// True if the antenna is taken to keep its direction when the Arduino is reset while it
    /// stands: right as long as nobody turned it meanwhile.
    pub trust_after_reset: bool,
    /// Time for which the antenna swings after a move, in seconds.
    pub settle_s: f64,
    /// Longest time that the Arduino may take to answer, in seconds; with its start after the port
    /// is opened.
    pub answer_timeout_s: f64,
}

/// Approach of the antenna to an angle in spite of the gear's play.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Approach {
    /// Always from below: an order backwards goes beyond its target by the play, and comes back.
    OneSided,
    /// From either side; what is ordered backwards goes on by exactly the play. Quicker, and as
    /// good as the configured play is.
    Compensated,
}

/// Treatment of an order beyond what the cable allows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum BeyondCable {
    /// The cable is unwound: the antenna goes to the same direction within half a turn of 0.
    Unwind,
    /// It is an error.
    Refuse,
}

/// Source of the antenna's direction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum Homing {
    /// Somebody has turned it there by hand.
    Declared {
        /// Direction of the antenna, in degrees counter-clockwise from the nose.
        at_deg: f64,
    },
    /// It turns until a switch closes, and forwards again until it opens.
    Switch {
        /// The Arduino's pin of the switch, which connects it to ground.
        pin: u8,
        /// Direction at which the switch opens, in degrees counter-clockwise from the nose.
        at_deg: f64,
    },
}

impl Default for FirmataConfig {
    /// A 28BYJ-48 at pins 8 to 11, 64 · (31·32·26·22)/(9·11·10·9) half steps a turn
    /// (4075.77), 600 of them a second at once; an approach from one side over 6°; one turn of
    /// cable to either side, which is unwound; an antenna that was turned to the nose by hand, and
    /// must be again after a reset; 30 ms to settle, 5 s to answer.
    fn default() -> Self {
        Self {
            device: 0,
            pins: [8, 9, 10, 11],
            half_steps_per_turn: [64 * 31 * 32 * 26 * 22, 9 * 11 * 10 * 9],
            clockwise: false,
            speed_half_steps_per_s: 600.0,
            acceleration_half_steps_per_s2: 0.0,
            approach: Approach::OneSided,
            backlash_deg: 6.0,
            cable_turns: 1.0,
            beyond_cable: BeyondCable::Unwind,
            homing: Homing::Declared { at_deg: 0.0 },
            trust_after_reset: false,
            settle_s: 0.03,
            answer_timeout_s: 5.0,
        }
    }
}

impl FirmataConfig {
    /// Checks that every value is one that the stepper can have.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names the first field that cannot be, with its value.
    pub fn check(&self) -> Result<(), FieldError> {
        in_range("device", f64::from(self.device), 0.0..=9.0, "at most 9")?;
        let [a, b, c, d] = self.pins;
        let differ = a != b && a != c && a != d && b != c && b != d && c != d;
        if !differ || self.pins.iter().any(|pin| *pin >= 0x7F) {
            let value = format!("{:?}", self.pins);
            return Err(FieldError::new("pins", value, "four different pins below 127"));
        }
        let gearing = self.gearing();
        if gearing.denominator == 0 || !(8.0..1e7).contains(&gearing.per_turn()) {
            let value = format!("{:?}", self.half_steps_per_turn);
            let requirement = "a fraction between 8 and 10 million";
            return Err(FieldError::new("half_steps_per_turn", value, requirement));
        }
        let speed = self.speed_half_steps_per_s;
        in_range("speed_half_steps_per_s", speed, 0.1..=80_000.0, "between 0.1 and 80000")?;
        let acceleration = self.acceleration_half_steps_per_s2;
        let requirement = "between 0 and 10⁹";
        in_range("acceleration_half_steps_per_s2", acceleration, 0.0..=1e9, requirement)?;
        in_range("backlash_deg", self.backlash_deg, 0.0..=90.0, "between 0 and 90")?;
        // An order may lie anywhere within half a turn of 0.
        require(self.cable_turns >= 0.5, "cable_turns", self.cable_turns, "at least 0.5")?;
        let (Homing::Declared { at_deg } | Homing::Switch { at_deg, .. }) = self.homing;
        in_range("homing.at_deg", at_deg, -360.0..=360.0, "within 360 of 0")?;
        if let Homing::Switch { pin, .. } = self.homing {
            let free = pin < 0x7F && !self.pins.contains(&pin);
            require(free, "homing.pin", f64::from(pin), "below 127, and none of the motor's")?;
        }
        in_range("settle_s", self.settle_s, 0.0..=60.0, "between 0 and 60")?;
        let answer = self.answer_timeout_s;
        in_range("answer_timeout_s", answer, 0.05..=600.0, "between 0.05 and 600")?;
        Ok(())
    }

    pub(super) fn gearing(&self) -> Gearing {
        let [numerator, denominator] = self.half_steps_per_turn;
        Gearing { numerator, denominator }
    }

    /// Returns the antenna's direction at home, in radians.
    pub(super) fn home_angle(&self) -> f64 {
        let (Homing::Declared { at_deg } | Homing::Switch { at_deg, .. }) = self.homing;
        at_deg.to_radians()
    }

    /// The pin of the home switch.
    pub(super) fn switch(&self) -> Option<u8> {
        match self.homing {
            Homing::Switch { pin, .. } => Some(pin),
            Homing::Declared { .. } => None,
        }
    }

    /// Seconds after which what was not answered is requested again: 0.1 s by default.
    pub(super) fn ask_s(&self) -> f64 {
        (self.answer_timeout_s / 50.0).max(0.1)
    }

    /// Longest duration in seconds of a move of `steps` steps.
    pub(super) fn duration_s(&self, steps: u64) -> f64 {
        #[expect(clippy::cast_precision_loss, reason = "a duration")]
        let cruise = steps as f64 / self.speed_half_steps_per_s;
        cruise + self.ramp_s()
    }

    /// Shortest duration in seconds of a move of `steps` steps, from standstill or not, less what
    /// clocks and roundings may differ by.
    #[expect(clippy::cast_precision_loss, reason = "a duration")]
    pub(super) fn least_s(&self, steps: u64, stood: bool) -> f64 {
        let steps = steps as f64;
        let acceleration = self.acceleration_half_steps_per_s2;
        if acceleration <= 0.0 || !stood {
            return (steps - QUICK_STEPS).max(0.0) * self.step_s() * SLACK;
        }
        let ramp = self.ramp_s();
        let whole = if steps * self.step_s() >= ramp {
            steps * self.step_s() + ramp
        } else {
            2.0 * (steps / acceleration).sqrt()
        };
        let first = FIRST_WAITS / acceleration.sqrt();
        ((whole - first) * SLACK).max(0.0)
    }

    /// Most steps that the motor can make in a time in seconds.
    #[expect(clippy::cast_possible_truncation, reason = "what is more saturates")]
    pub(super) fn most_steps(&self, seconds: f64) -> i64 {
        (seconds / self.step_s() / SLACK + QUICK_STEPS).ceil() as i64
    }

    /// Most steps that the motor goes on by before it turns round.
    #[expect(clippy::cast_possible_truncation, reason = "what is more saturates")]
    pub(super) fn stopping_steps(&self) -> i64 {
        let acceleration = self.acceleration_half_steps_per_s2;
        let acceleration = if acceleration > 0.0 { acceleration } else { AT_ONCE };
        let speed = self.speed_half_steps_per_s;
        (speed * speed / (2.0 * acceleration)).ceil() as i64 + 2
    }

    /// Seconds from a step to the next, in the whole microseconds of AccelStepper.
    fn step_s(&self) -> f64 {
        (1e6 / self.speed_half_steps_per_s).floor() * 1e-6
    }

    /// Time that ramps add to a move that reaches its speed, in seconds.
    fn ramp_s(&self) -> f64 {
        if self.acceleration_half_steps_per_s2 > 0.0 {
            self.speed_half_steps_per_s / self.acceleration_half_steps_per_s2
        } else {
            0.0
        }
    }
}

/// Steps in a turn, as an exact fraction: each target is rounded by itself, so that roundings do
/// not add up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gearing {
    numerator: u32,
    denominator: u32,
}

impl Gearing {
    /// The step next to an angle in radians, halves away from zero; `None` for more than a million
    /// turns or no number.
    #[expect(clippy::cast_possible_truncation, reason = "whole steps below 2⁵²")]
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
    use approx::assert_abs_diff_eq;
    use proptest::prelude::*;

    use super::*;

    /// The gear of a 28BYJ-48: (31·32·26·22)/(9·11·10·9), 64 half steps a turn of its rotor.
    const GEAR: Gearing = Gearing { numerator: 64 * 283_712, denominator: 4455 };

    #[test]
    fn a_thousand_turns_do_not_drift() {
        assert_abs_diff_eq!(GEAR.per_turn(), 4_075.772_8, epsilon = 1e-4);
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
