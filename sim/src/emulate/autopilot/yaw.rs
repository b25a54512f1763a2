use foxhunt_core::angle;

/// The control of the nose.
#[derive(Clone, Copy, Debug)]
pub(super) struct Yaw {
    /// The heading to reach in the end.
    aim: f64,
    /// The heading wanted now, on the way to `aim`.
    slewed: f64,
    /// The rate at which `slewed` moves, in radians per second.
    slew: f64,
    /// A rate instead, counter-clockwise.
    rate: Option<f64>,
}

/// The default slew rate of a heading, in radians per second.
const SLEW: f64 = 1.0;

/// The gain of the control of the nose, per second.
const GAIN: f64 = 4.0;

impl Yaw {
    pub(super) fn new(heading: f64) -> Self {
        Self { aim: heading, slewed: heading, slew: SLEW, rate: None }
    }

    /// The heading wanted at the moment.
    pub(super) fn slewed(&self) -> f64 {
        self.slewed
    }

    pub(super) fn hold(&mut self, heading: f64) {
        *self = Self::new(heading);
    }

    /// Turns to a heading, at a rate where one is given.
    pub(super) fn aim(&mut self, heading: f64, now_at: f64, slew: Option<f64>) {
        if self.rate.take().is_some() {
            self.slewed = now_at;
        }
        self.aim = heading;
        self.slew = slew.filter(|slew| *slew > 0.0).unwrap_or(SLEW);
    }

    pub(super) fn turn(&mut self, rate: f64) {
        self.rate = Some(rate);
    }

    /// The rate at which to turn, in radians per second counter-clockwise.
    pub(super) fn step(&mut self, heading: f64, dt: f64) -> f64 {
        if let Some(rate) = self.rate {
            (self.aim, self.slewed) = (heading, heading);
            return rate;
        }
        let most = self.slew * dt;
        let moved = angle::wrap(self.aim - self.slewed).clamp(-most, most);
        self.slewed = angle::wrap(self.slewed + moved);
        let ahead = if dt > 0.0 { moved / dt } else { 0.0 };
        // No faster than the step allows without passing it.
        let gain = if dt > 0.0 { GAIN.min(0.5 / dt) } else { GAIN };
        ahead + gain * angle::wrap(self.slewed - heading)
    }
}
