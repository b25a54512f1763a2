use super::time::is_due;

/// An antenna's motor: it turns at constant speed to where it was last ordered.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Turntable {
    /// Its speed in radians per second.
    speed: f64,
    from: f64,
    to: f64,
    departure: f64,
    arrival: f64,
}

impl Turntable {
    /// A motor that stands at 0.
    pub(super) fn new(speed: f64) -> Self {
        Self { speed, from: 0.0, to: 0.0, departure: 0.0, arrival: 0.0 }
    }

    /// Turns to `angle` radians from where it is at `now`.
    pub(super) fn order(&mut self, angle: f64, now: f64) {
        self.from = self.angle(now);
        self.to = angle;
        self.departure = now;
        self.arrival = now + (self.to - self.from).abs() / self.speed;
    }

    /// Stands at `angle` radians from now on: something else turns it.
    #[cfg(feature = "emulators")]
    pub(super) fn hold_at(&mut self, angle: f64, now: f64) {
        (self.from, self.to, self.departure, self.arrival) = (angle, angle, now, now);
    }

    /// Its angle, in radians.
    pub(super) fn angle(&self, now: f64) -> f64 {
        self.standing(now).unwrap_or_else(|| {
            let turned = (now - self.departure) * self.speed;
            self.from + turned.copysign(self.to - self.from)
        })
    }

    /// The time when it comes to a standstill; infinite if it stands.
    #[inline]
    pub(crate) fn stands_at(&self, now: f64) -> f64 {
        if is_due(self.arrival, now) { f64::INFINITY } else { self.arrival }
    }

    /// The angle at which it stands; `None` while it turns.
    #[inline]
    pub(crate) fn standing(&self, now: f64) -> Option<f64> {
        is_due(self.arrival, now).then_some(self.to)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_turns_at_its_speed_and_may_be_sent_back() {
        let mut motor = Turntable::new(2.0);
        motor.order(3.0, 10.0);
        assert_eq!(motor.standing(11.499), None);
        assert_eq!(motor.standing(11.5), Some(3.0));
        assert!((motor.angle(11.0) - 2.0).abs() < 1e-12);
        motor.order(-1.0, 11.0);
        assert!((motor.angle(12.0) - 0.0).abs() < 1e-12);
        assert_eq!(motor.standing(12.499), None);
        assert_eq!(motor.standing(12.5), Some(-1.0));
    }
}
