use foxhunt_core::angle;

/// How the nose is controlled.
#[derive(Clone, Copy, Debug)]
pub(super) struct Yaw {
    /// Where it is to point in the end.
    aim: f64,
    /// Where it is to point now, on the way there.
    slewed: f64,
    /// How fast that moves, in radians per second.
    slew: f64,
    /// A rate instead, counter-clockwise.
    rate: Option<f64>,
}

/// How fast a heading is slewed to by default, in radians per second.
const SLEW: f64 = 1.0;

/// How quickly the nose follows, per second.
const GAIN: f64 = 4.0;

impl Yaw {
    pub(super) fn new(heading: f64) -> Self {
        Self { aim: heading, slewed: heading, slew: SLEW, rate: None }
    }

    /// Where it is slewing to at the moment.
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
