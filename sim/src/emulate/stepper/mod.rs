//! A Firmata Arduino with the stepper of a drone's antenna: the motor's settings, the library that
//! drives it, its wires, and the gear that it turns.

mod board;

pub use board::EmulatedStepper;

use std::f64::consts::TAU;

use foxhunt_core::parameter::{FieldError, finite, in_range, require};
use serde::{Deserialize, Serialize};

/// ConfigurableFirmata's acceleration if no acceleration is wanted, in steps/s².
const AT_ONCE: f64 = 1e6;

/// Outputs for each step; bit 0 is the first pin.
const HALF_4: [u8; 8] = [0b0001, 0b0101, 0b0100, 0b0110, 0b0010, 0b1010, 0b1000, 0b1001];
const WHOLE_4: [u8; 4] = [0b0101, 0b0110, 0b1010, 0b1001];
const HALF_3: [u8; 6] = [0b100, 0b101, 0b001, 0b011, 0b010, 0b110];
const WHOLE_3: [u8; 3] = [0b100, 0b001, 0b010];
const WHOLE_2: [u8; 4] = [0b10, 0b11, 0b01, 0b00];

/// A driver's step pin is high for a microsecond; its direction is all that stays.
const DRIVER: [u8; 1] = [0b10];

/// A stepper as the library AccelStepper drives it: a count of steps that follows a target.
///
/// Waits between steps follow D. Austin's recurrence ("Generate stepper-motor speed profiles in
/// real time", 2005). What the library keeps after a stop is kept here, too: its speed.
#[derive(Clone, Copy, Debug)]
struct Motor {
    position: i64,
    target: i64,
    /// The most, in steps per second.
    most: f64,
    /// The acceleration in steps/s².
    acceleration: f64,
    /// Present speed, negative backwards.
    speed: f64,
    /// Steps since standstill while it gets faster, and negative ones to it while it gets slower.
    ramp: i64,
    forwards: bool,
    /// Wait before the next step in microseconds: exact, of the first step, and at full speed.
    wait_us: f64,
    first_us: f64,
    least_us: f64,
    /// Wait that counts, in whole microseconds; 0 where no step is due.
    interval_us: u32,
    /// Time of the last step.
    stepped: f64,
    /// Time of the last order.
    ordered: f64,
    running: bool,
}

/// Report of what a motor did.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Action {
    /// A step, `after_s` seconds after the one before it.
    Step { after_s: f64 },
    /// The motor is at its target.
    Arrived,
}

impl Motor {
    /// A motor at 0. ConfigurableFirmata begins with a step per second.
    fn new(now: f64) -> Self {
        let mut motor = Self {
            position: 0,
            target: 0,
            most: 1.0,
            acceleration: AT_ONCE,
            speed: 0.0,
            ramp: 0,
            forwards: false,
            wait_us: 0.0,
            first_us: 0.0,
            least_us: 1e6,
            interval_us: 0,
            stepped: now,
            ordered: now,
            running: false,
        };
        motor.first_us = first_us(AT_ONCE);
        motor
    }

    fn order(&mut self, target: i64, now: f64) {
        self.aim(target);
        (self.running, self.ordered) = (true, now);
    }

    /// Freezes the motor at its present position. Its speed is kept: the next order goes on with
    /// that.
    fn stop(&mut self) {
        if self.speed != 0.0 {
            let way = self.steps_to_stop() + 1;
            self.aim(self.position + if self.speed > 0.0 { way } else { -way });
        }
        self.running = false;
    }

    fn zero(&mut self) {
        (self.position, self.target, self.ramp) = (0, 0, 0);
        (self.speed, self.interval_us) = (0.0, 0);
    }

    fn set_speed(&mut self, most: f64) {
        let most = most.abs();
        if most.to_bits() == self.most.to_bits() {
            return;
        }
        (self.most, self.least_us) = (most, 1e6 / most);
        if self.ramp > 0 {
            self.ramp = self.steps_to_stop();
            self.plan();
        }
    }

    fn set_acceleration(&mut self, acceleration: f64) {
        let acceleration = if acceleration == 0.0 { AT_ONCE } else { acceleration.abs() };
        if acceleration.to_bits() == self.acceleration.to_bits() {
            return;
        }
        #[expect(clippy::cast_precision_loss, reason = "a count of steps")]
        let ramp = self.ramp as f64 * (self.acceleration / acceleration);
        (self.ramp, self.acceleration) = (whole(ramp), acceleration);
        self.first_us = first_us(acceleration);
        self.plan();
    }

    /// Takes what is due next by `now`; `None` where nothing is.
    fn act(&mut self, now: f64) -> Option<Action> {
        if !self.running {
            return None;
        }
        if self.interval_us == 0 {
            self.running = self.speed != 0.0 || self.target != self.position;
            return (!self.running).then_some(Action::Arrived);
        }
        let due = (self.stepped + f64::from(self.interval_us) * 1e-6).max(self.ordered);
        if due > now + 1e-9 {
            return None;
        }
        let after_s = due - self.stepped;
        (self.position, self.stepped) = (self.position + self.direction(), due);
        self.plan();
        Some(Action::Step { after_s })
    }

    /// Takes all steps at full speed that are due by `now`, but those near the target: how many,
    /// and the seconds between them.
    #[expect(clippy::cast_precision_loss, reason = "a count of steps")]
    fn cruise(&mut self, now: f64) -> (i64, f64) {
        let between_s = f64::from(self.interval_us) * 1e-6;
        let left = (self.target - self.position) * self.direction();
        let full = self.wait_us.to_bits() == self.least_us.to_bits();
        let away = self.steps_to_stop() + 2;
        if !self.running || !full || self.ramp <= 0 || left <= away || self.stepped < self.ordered {
            return (0, between_s);
        }
        let due = whole((now + 1e-9 - self.stepped) / between_s);
        let steps = due.min(left - away).max(0);
        self.position += steps * self.direction();
        self.ramp += steps;
        self.stepped += steps as f64 * between_s;
        (steps * self.direction(), between_s)
    }

    fn direction(&self) -> i64 {
        if self.forwards { 1 } else { -1 }
    }

    fn aim(&mut self, target: i64) {
        if target != self.target {
            self.target = target;
            self.plan();
        }
    }

    fn steps_to_stop(&self) -> i64 {
        whole(self.speed * self.speed / (2.0 * self.acceleration))
    }

    /// The wait before the next step.
    #[expect(clippy::cast_possible_truncation, reason = "a wait of 71 minutes saturates")]
    #[expect(clippy::cast_sign_loss, reason = "a wait is positive")]
    #[expect(clippy::cast_precision_loss, reason = "a count of steps")]
    fn plan(&mut self) {
        let left = self.target - self.position;
        let to_stop = self.steps_to_stop();
        if left == 0 && to_stop <= 1 {
            (self.interval_us, self.speed, self.ramp) = (0, 0.0, 0);
            return;
        }
        if left != 0 {
            let away = (left > 0) != self.forwards;
            let brake = to_stop >= left.abs() || away;
            if self.ramp > 0 && brake {
                self.ramp = -to_stop;
            } else if self.ramp < 0 && !brake {
                self.ramp = -self.ramp;
            }
        }
        if self.ramp == 0 {
            (self.wait_us, self.forwards) = (self.first_us, left > 0);
        } else {
            self.wait_us -= 2.0 * self.wait_us / (4.0 * self.ramp as f64 + 1.0);
            self.wait_us = self.wait_us.max(self.least_us);
        }
        self.ramp += 1;
        self.interval_us = self.wait_us as u32;
        self.speed = 1e6 / self.wait_us * if self.forwards { 1.0 } else { -1.0 };
    }
}

/// Pins of a stepper as AccelStepper energises them.
#[derive(Clone, Copy, Debug)]
struct Wires {
    pins: [u8; 4],
    count: usize,
    /// Bit by bit, from the first pin on.
    inverted: u8,
    enable_pin: Option<u8>,
    patterns: &'static [u8],
}

impl Wires {
    /// Wires of an interface byte; `None` where the library has no such stepper.
    fn new(interface: u8, pins: [u8; 4]) -> Option<Self> {
        let (count, patterns): (_, &[u8]) = match (interface >> 4 & 7, interface >> 1 & 7) {
            (1, _) => (2, &DRIVER),
            (2, _) => (2, &WHOLE_2),
            (3, 0) => (3, &WHOLE_3),
            (3, 1) => (3, &HALF_3),
            (4, 0) => (4, &WHOLE_4),
            (4, 1) => (4, &HALF_4),
            _ => return None,
        };
        Some(Self { pins, count, inverted: 0, enable_pin: None, patterns })
    }

    /// Each pin and its level at a position.
    fn at(&self, position: i64) -> impl Iterator<Item = (u8, bool)> + use<> {
        let cycle = i64::try_from(self.patterns.len()).unwrap_or(1);
        let at = usize::try_from(position.rem_euclid(cycle)).unwrap_or(0);
        self.levels(self.patterns[at])
    }

    /// Each pin and its level without current.
    fn off(&self) -> impl Iterator<Item = (u8, bool)> + use<> {
        self.levels(0)
    }

    fn levels(&self, outputs: u8) -> impl Iterator<Item = (u8, bool)> + use<> {
        let outputs = outputs ^ self.inverted;
        self.pins
            .into_iter()
            .take(self.count)
            .enumerate()
            .map(move |(i, pin)| (pin, outputs >> i & 1 == 1))
    }

    /// Returns the half steps that a rotor makes at each step, its coils being at `wired`; `None`
    /// if it does not just follow.
    fn gain(&self, wired: [u8; 4]) -> Option<i64> {
        if self.patterns != HALF_4 || self.inverted & 0x0F != 0 {
            return None;
        }
        let coil = |pin: u8| wired.iter().position(|at| *at == pin);
        let [a, c, b, d] = self.pins;
        let order = [coil(a)?, coil(b)?, coil(c)?, coil(d)?];
        let follows = |by: usize| (0..4).all(|i| (order[i] + by) % 4 == order[(i + 1) % 4]);
        if follows(1) { Some(1) } else { follows(3).then_some(-1) }
    }
}

/// The motor's rotor, which its coils pull, and the gear between it and the antenna.
#[derive(Clone, Copy, Debug)]
struct Gear {
    /// Half steps that the rotor has really made.
    rotor: i64,
    /// Half step of the coils where `rotor` is 0.
    phase: i64,
    /// The antenna's place, in half steps.
    antenna: f64,
    /// The play of the gear, in half steps.
    play: f64,
    /// A half step in radians.
    half_step: f64,
    start: f64,
}

impl Gear {
    fn new(config: &EmulatedStepperConfig) -> Self {
        let [numerator, denominator] = config.half_steps_per_turn.map(f64::from);
        let half_step = TAU * denominator / numerator;
        let play = config.backlash_deg.to_radians() / half_step;
        let phase = config.phase.into();
        let start = config.start_deg.to_radians();
        Self { rotor: 0, phase, antenna: 0.0, play, half_step, start }
    }

    /// Half steps that the rotor has really made, forwards less backwards.
    fn rotor(&self) -> i64 {
        self.rotor
    }

    /// Half step of the coils that the rotor stands at.
    fn phase(&self) -> i64 {
        (self.rotor + self.phase).rem_euclid(8)
    }

    /// Pulls the rotor to the next place that belongs to a half step of the coils. Coils that are
    /// opposite to it, four half steps away, pull to neither side.
    fn follow(&mut self, phase: i64) {
        match (phase - self.phase()).rem_euclid(8) {
            0 | 4 => {}
            ahead @ 1..4 => self.turn(ahead),
            ahead => self.turn(ahead - 8),
        }
    }

    /// Turns the rotor. It pushes the antenna forwards, and pulls it backwards after the play.
    #[expect(clippy::cast_precision_loss, reason = "2⁵³ half steps are not made")]
    fn turn(&mut self, half_steps: i64) {
        self.rotor += half_steps;
        let rotor = self.rotor as f64;
        self.antenna = self.antenna.clamp(rotor, rotor + self.play);
    }

    /// The antenna's direction, in radians from the nose.
    fn angle(&self) -> f64 {
        self.start + self.antenna * self.half_step
    }
}

/// The stepper and the switch of an emulated Arduino.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EmulatedStepperConfig {
    /// The pins that lead to IN1, IN2, IN3 and IN4 of the motor's driver.
    pub pins: [u8; 4],
    /// Half steps of the motor in a turn of the antenna, as numerator and denominator.
    pub half_steps_per_turn: [u32; 2],
    /// The play of the gear in degrees.
    pub backlash_deg: f64,
    /// Direction of the antenna at the beginning, in degrees counter-clockwise from the nose; the
    /// gear is then pushed forwards.
    pub start_deg: f64,
    /// A switch that the antenna closes.
    pub switch: Option<EmulatedSwitch>,
    /// Half step of the coils, from 0 to 7, that the rotor stands at in the beginning. A motor that
    /// is switched on at another one jumps by up to four half steps.
    pub phase: u8,
    /// Half steps per second above which the rotor stands still while its coils go on; absent, it
    /// follows at any speed. A 28BYJ-48 follows some 1000.
    pub fastest_half_steps_per_s: Option<f64>,
    /// True if AccelStepper is in the sketch. It is commented out in the sketch that comes with
    /// ConfigurableFirmata.
    pub accel_stepper: bool,
    /// Number of steppers that the memory holds. Each Configure without a system reset before it
    /// leaks one, and a Configure that finds no room hangs the firmware.
    pub steppers_in_memory: u32,
}

/// A switch to ground that the antenna closes between two angles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EmulatedSwitch {
    /// The pin that it connects to ground.
    pub pin: u8,
    /// The angle from which on, counter-clockwise, it is open again, in degrees from the nose.
    pub opens_at_deg: f64,
    /// Width of the closed part before that, in degrees.
    pub width_deg: f64,
}

impl Default for EmulatedStepperConfig {
    /// A 28BYJ-48 at pins 8 to 11, 64 · (31·32·26·22)/(9·11·10·9) half steps a turn, 3° of
    /// play; an antenna along the nose, without a switch; a rotor at half step 0 that follows at
    /// any speed; a sketch with AccelStepper, and memory for 12.
    fn default() -> Self {
        Self {
            pins: [8, 9, 10, 11],
            half_steps_per_turn: [64 * 31 * 32 * 26 * 22, 9 * 11 * 10 * 9],
            backlash_deg: 3.0,
            start_deg: 0.0,
            switch: None,
            phase: 0,
            fastest_half_steps_per_s: None,
            accel_stepper: true,
            steppers_in_memory: 12,
        }
    }
}

impl EmulatedStepperConfig {
    fn check(&self) -> Result<(), FieldError> {
        let [numerator, denominator] = self.half_steps_per_turn.map(f64::from);
        let holds = numerator > 0.0 && denominator > 0.0;
        require(holds, "half_steps_per_turn", numerator, "a positive fraction")?;
        in_range("backlash_deg", self.backlash_deg, 0.0..=90.0, "between 0 and 90")?;
        finite("start_deg", self.start_deg)?;
        in_range("phase", f64::from(self.phase), 0.0..=7.0, "at most 7")?;
        if let Some(fastest) = self.fastest_half_steps_per_s {
            require(fastest > 0.0, "fastest_half_steps_per_s", fastest, "positive")?;
        }
        if let Some(EmulatedSwitch { opens_at_deg, width_deg, .. }) = self.switch {
            finite("switch.opens_at_deg", opens_at_deg)?;
            let narrow = (0.0..360.0).contains(&width_deg);
            require(narrow, "switch.width_deg", width_deg, "between 0 and 360")?;
        }
        Ok(())
    }
}

/// Wait before the first step, with Austin's correction.
fn first_us(acceleration: f64) -> f64 {
    0.676 * (2.0 / acceleration).sqrt() * 1e6
}

#[expect(clippy::cast_possible_truncation, reason = "counts of steps; what is more saturates")]
fn whole(steps: f64) -> i64 {
    steps as i64
}

/// Half step of a rotor, from 0 to 7, that current through coils IN1 to IN4 pulls it to; `None`
/// where they pull it nowhere.
fn half_step(coils: [bool; 4]) -> Option<i64> {
    match coils {
        [true, false, false, false] => Some(0),
        [true, true, false, false] => Some(1),
        [false, true, false, false] => Some(2),
        [false, true, true, false] => Some(3),
        [false, false, true, false] => Some(4),
        [false, false, true, true] => Some(5),
        [false, false, false, true] => Some(6),
        [true, false, false, true] => Some(7),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::{abs_diff_eq, assert_abs_diff_eq};

    /// Returns the steps that a motor makes by `now`, and its lowest position.
    fn run(motor: &mut Motor, now: f64) -> (i64, i64) {
        let mut steps = 0;
        let mut least = motor.position;
        loop {
            steps += motor.cruise(now).0.abs();
            match motor.act(now) {
                Some(Action::Step { .. }) => steps += 1,
                Some(Action::Arrived) | None => return (steps, least),
            }
            least = least.min(motor.position);
        }
    }

    #[test]
    fn steps_are_as_fast_as_ordered() {
        let mut motor = Motor::new(10.0);
        motor.set_speed(500.0);
        motor.order(250, 10.0);
        // The first wait is that of the acceleration, 0.96 ms.
        assert_eq!(run(&mut motor, 10.25).0, 125);
        assert_eq!(run(&mut motor, 20.0).0, 125);
        assert!(abs_diff_eq!(motor.stepped, 10.499, epsilon = 1e-4) && !motor.running, "{motor:?}");
        motor.order(150, 20.0);
        assert_eq!((run(&mut motor, 30.0).0, motor.position), (100, 150));
    }

    #[test]
    fn a_ramp_takes_its_time_and_ends_at_the_target() {
        let mut motor = Motor::new(0.0);
        motor.set_speed(1000.0);
        motor.set_acceleration(2000.0);
        motor.order(2000, 0.0);
        run(&mut motor, 100.0);
        // 2 s at full speed, and half a second more for the ramps.
        assert_eq!(motor.position, 2000);
        assert_abs_diff_eq!(motor.stepped, 2.5, epsilon = 0.1);
        // Sent back while it runs: it goes on for the way that it takes to stop, v²/2a = 250.
        motor.order(4000, 100.0);
        run(&mut motor, 101.0);
        let turned = motor.position;
        motor.order(2000, 101.0);
        run(&mut motor, 200.0);
        assert_eq!(motor.position, 2000);
        assert!(turned > 2500 && !motor.running);
    }

    #[test]
    fn a_stop_keeps_the_speed() {
        let mut motor = Motor::new(0.0);
        motor.set_speed(1000.0);
        motor.set_acceleration(2000.0);
        motor.order(-4000, 0.0);
        run(&mut motor, 2.0);
        motor.stop();
        let stopped = motor.position;
        assert_eq!(run(&mut motor, 3.0).0, 0, "it stands");
        motor.order(stopped + 1, 3.0);
        let (_, least) = run(&mut motor, 10.0);
        assert_eq!(motor.position, stopped + 1);
        assert_abs_diff_eq!(stopped - least, 250, epsilon = 5);
    }
}
