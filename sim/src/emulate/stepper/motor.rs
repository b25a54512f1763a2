/// A stepper as AccelStepper drives it: a count of steps that follows a target.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motor {
    pub(super) position: i64,
    target: i64,
    /// The most, in steps per second.
    speed: f64,
    /// In steps/s²; 0 is at once.
    acceleration: f64,
    /// The square of the present speed, with its direction.
    squared: f64,
    /// When the last step was, or the order.
    stepped: f64,
    running: bool,
}

impl Motor {
    /// One at 0. ConfigurableFirmata begins with a step per second.
    pub(super) fn new(now: f64) -> Self {
        Self {
            position: 0,
            target: 0,
            speed: 1.0,
            acceleration: 0.0,
            squared: 0.0,
            stepped: now,
            running: false,
        }
    }

    pub(super) fn order(&mut self, target: i64, now: f64) {
        self.target = target;
        if !self.running {
            (self.squared, self.stepped) = (0.0, now);
        }
        self.running = true;
    }

    pub(super) fn stop(&mut self) {
        (self.running, self.squared, self.target) = (false, 0.0, self.position);
    }

    pub(super) fn zero(&mut self) {
        (self.position, self.target, self.squared) = (0, 0, 0.0);
    }

    pub(super) fn set_speed(&mut self, speed: f64) {
        self.speed = speed.abs();
    }

    pub(super) fn set_acceleration(&mut self, acceleration: f64) {
        self.acceleration = acceleration.abs();
    }

    /// Takes the next step if it is due by `now`, forwards (1) or backwards (−1); 0 ends the move.
    pub(super) fn step(&mut self, now: f64) -> Option<i64> {
        if !self.running {
            return None;
        }
        let next = self.next_speed();
        if next == 0.0 {
            self.stop();
            return Some(0);
        }
        let due = self.stepped + 1.0 / next.abs().sqrt();
        if due > now + 1e-9 {
            return None;
        }
        (self.squared, self.stepped) = (next, due);
        let direction = if next > 0.0 { 1 } else { -1 };
        self.position += direction;
        Some(direction)
    }

    /// The square of the speed of the next step, with its direction; 0 where there is none to take.
    #[expect(clippy::cast_precision_loss, reason = "a distance")]
    fn next_speed(&self) -> f64 {
        let left = (self.target - self.position) as f64;
        let most = self.speed * self.speed;
        if self.acceleration <= 0.0 || self.speed <= 0.0 {
            return if left == 0.0 { 0.0 } else { most.copysign(left) };
        }
        let change = 2.0 * self.acceleration;
        let to_stop = self.squared.abs() / change;
        let away = self.squared * left < 0.0;
        if self.squared != 0.0 && (away || to_stop >= left.abs()) {
            let slower = self.squared.abs() - change;
            if slower > 0.0 {
                return slower.copysign(self.squared);
            }
            // It has stopped, and turns to its target.
            return if left == 0.0 { 0.0 } else { change.min(most).copysign(left) };
        }
        if left == 0.0 { 0.0 } else { (self.squared.abs() + change).min(most).copysign(left) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Steps, and when the last one was.
    fn run(motor: &mut Motor, now: f64) -> (i64, f64) {
        let mut steps = 0;
        while let Some(step) = motor.step(now) {
            steps += step.abs();
            if step == 0 {
                break;
            }
        }
        (steps, motor.stepped)
    }

    #[test]
    fn steps_are_as_fast_as_ordered() {
        let mut motor = Motor::new(10.0);
        motor.set_speed(500.0);
        motor.order(250, 10.0);
        assert_eq!(run(&mut motor, 10.25).0, 125);
        assert_eq!(run(&mut motor, 20.0).0, 125);
        assert!((motor.stepped - 10.5).abs() < 1e-9 && !motor.running);
        motor.order(150, 20.0);
        assert_eq!((run(&mut motor, 30.0).0, motor.position), (100, 150));
    }

    #[test]
    fn a_ramp_takes_its_time_and_ends_at_the_target() {
        let mut motor = Motor::new(0.0);
        motor.set_speed(1000.0);
        motor.set_acceleration(2000.0);
        motor.order(2000, 0.0);
        let (steps, ended) = run(&mut motor, 100.0);
        // 2 s at full speed, and half a second more for the ramps.
        assert_eq!((steps, motor.position), (2000, 2000));
        assert!((ended - 2.5).abs() < 0.1, "{ended}");
        // Sent back while it runs: it goes on for the way that it takes to stop, v²/2a = 250.
        motor.order(4000, 100.0);
        run(&mut motor, 101.0);
        let turned = motor.position;
        motor.order(2000, 101.0);
        run(&mut motor, 200.0);
        assert_eq!(motor.position, 2000);
        assert!(turned > 2500 && !motor.running);
    }
}
