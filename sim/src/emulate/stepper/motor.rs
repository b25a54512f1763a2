/// A stepper as the library AccelStepper drives it: a count of steps that follows a target.
///
/// Waits between steps follow D. Austin's recurrence ("Generate stepper-motor speed profiles in
/// real time", 2005). What the library keeps after a stop is kept here, too: its speed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motor {
    pub(super) position: i64,
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
pub(super) enum Action {
    /// A step, `after_s` seconds after the one before it.
    Step { after_s: f64 },
    /// The motor is where it was sent.
    Arrived,
}

/// ConfigurableFirmata's acceleration if no acceleration is wanted, in steps/s².
const AT_ONCE: f64 = 1e6;

impl Motor {
    /// A motor at 0. ConfigurableFirmata begins with a step per second.
    pub(super) fn new(now: f64) -> Self {
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

    pub(super) fn order(&mut self, target: i64, now: f64) {
        self.aim(target);
        (self.running, self.ordered) = (true, now);
    }

    /// Freezes it where it is. Its speed is kept: the next order goes on with that.
    pub(super) fn stop(&mut self) {
        if self.speed != 0.0 {
            let way = self.steps_to_stop() + 1;
            self.aim(self.position + if self.speed > 0.0 { way } else { -way });
        }
        self.running = false;
    }

    pub(super) fn zero(&mut self) {
        (self.position, self.target, self.ramp) = (0, 0, 0);
        (self.speed, self.interval_us) = (0.0, 0);
    }

    pub(super) fn set_speed(&mut self, most: f64) {
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

    pub(super) fn set_acceleration(&mut self, acceleration: f64) {
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
    pub(super) fn act(&mut self, now: f64) -> Option<Action> {
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
    pub(super) fn cruise(&mut self, now: f64) -> (i64, f64) {
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

    pub(super) fn direction(&self) -> i64 {
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

/// Wait before the first step, with Austin's correction.
fn first_us(acceleration: f64) -> f64 {
    0.676 * (2.0 / acceleration).sqrt() * 1e6
}

#[expect(clippy::cast_possible_truncation, reason = "counts of steps; what is more saturates")]
fn whole(steps: f64) -> i64 {
    steps as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps that it makes by `now`, and where it was farthest back.
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
        assert!((motor.stepped - 10.499).abs() < 1e-4 && !motor.running, "{motor:?}");
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
        assert!((motor.stepped - 2.5).abs() < 0.1, "{motor:?}");
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
        assert!((stopped - least - 250).abs() < 5, "it first went on by {}", stopped - least);
    }
}
