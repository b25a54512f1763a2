//! Moves of the motor: the way to an angle, and each leg until it is known to have ended.

use foxhunt_core::Clock;
use foxhunt_wire::{
    ByteStream,
    firmata::{Decimal, StepperRequest},
};

use super::{
    Approach, Due, FirmataConfig, FirmataStepper, FirmataStepperError, Leg, LostPosition,
    MONITOR_S, Next, Phase, Seen, Side, Stage,
};

/// The Arduino's own count is kept below this; the real firmware loses the bits above 2²⁸.
const MOST_COUNTED: u64 = 1 << 27;

/// Number of times that a move that ended short of its target is ordered again.
const MOST_TRIES: u8 = 5;

/// Time for which a motor that stands is left alone first, in seconds.
const WATCH_S: f64 = 1.0;

/// Delay in seconds of the first query after the expected end, and of each further one.
const QUERY_S: f64 = 0.25;

/// Time in which a stop is carried out, in seconds.
const STOP_S: f64 = 0.3;

/// A way to a target: where to first, where to then, and on which side of the gear's play it ends.
type Way = (i64, Option<i64>, Side);

impl<S: ByteStream, C: Clock> FirmataStepper<S, C> {
    /// The play of the gear in steps.
    pub(super) fn play(&self) -> i64 {
        self.gearing.steps(self.config.backlash_deg.to_radians()).unwrap_or(0)
    }

    /// Returns an error if a target is beyond what the Arduino can count at once.
    pub(super) fn reachable(&self, target: i64) -> Result<(), FirmataStepperError> {
        let steps = target.abs_diff(self.motor);
        if steps + self.play().unsigned_abs() < MOST_COUNTED {
            return Ok(());
        }
        Err(FirmataStepperError::TooFar { steps })
    }

    /// It stands where the motor is, since then.
    pub(super) fn stand(&mut self, since: f64) {
        let settled = since + self.config.settle_s;
        let watch_at = since + WATCH_S;
        self.phase = Phase::Standing { settled, watch_at };
    }

    /// Goes to the last ordered direction, if the present position is known.
    pub(super) fn go_on(&mut self, now: f64) -> Result<(), FirmataStepperError> {
        if self.coil_failure.is_some() {
            return Ok(());
        }
        if self.lost.is_some() {
            if self.config.switch().is_some() && self.home_failure.is_none() {
                return if self.aligned { self.seek(now) } else { self.align(now) };
            }
            return Ok(());
        }
        let Some(target) = self.wanted else { return Ok(()) };
        if self.motor.abs_diff(self.base) >= MOST_COUNTED {
            return self.rearrange(now);
        }
        if !self.aligned {
            return self.align(now);
        }
        if self.tries > 0 {
            self.send_pace()?;
        }
        match self.way(target) {
            None => self.wanted = None,
            Some((first, then, side)) => self.set_off(first, then, side, now)?,
        }
        Ok(())
    }

    /// Returns the way to `target`, or `None` if the antenna is there.
    fn way(&self, target: i64) -> Option<Way> {
        let play = self.play();
        let here = self.antenna();
        let two_sided = self.config.approach == Approach::Compensated;
        match self.side {
            Side::Below | Side::Above if two_sided && target == here => None,
            Side::Below | Side::Above if two_sided && target < here => {
                Some((target - play, None, Side::Above))
            }
            Side::Above if two_sided => Some((target, None, Side::Below)),
            Side::Below if target == here => None,
            Side::Below if target > here => Some((target, None, Side::Below)),
            // A way forwards of more than the play takes it up by itself.
            _ if target - play >= self.motor => Some((target, None, Side::Below)),
            _ => Some(roundabout(target, play)),
        }
    }

    /// Sends it elsewhere while it turns: it is anywhere, so it goes below the target first.
    pub(super) fn turn_aside(&mut self, target: i64, now: f64) -> Result<(), FirmataStepperError> {
        let Phase::Moving { leg, then, side } = self.phase else { return Ok(()) };
        let bound = then.or(leg.to);
        // A motor that is being stopped goes on from where it stops.
        if leg.to.is_none() || bound == Some(target) && side == Side::Below {
            return Ok(());
        }
        let (first, then, side) = roundabout(target, self.play());
        let leg = self.ordered(first, leg.range(), now)?.overtaking(&leg);
        self.phase = Phase::Moving { leg, then, side };
        Ok(())
    }

    /// Orders a move that ends on `side` of the play.
    pub(super) fn set_off(
        &mut self,
        first: i64,
        then: Option<i64>,
        side: Side,
        now: f64,
    ) -> Result<(), FirmataStepperError> {
        let leg = self.ordered(first, [self.motor; 2], now)?;
        (self.phase, self.side) = (Phase::Moving { leg, then, side }, Side::Unknown);
        Ok(())
    }

    /// Orders the motor to a step, which is somewhere within a range.
    pub(super) fn ordered(
        &mut self,
        to: i64,
        range: [i64; 2],
        now: f64,
    ) -> Result<Leg, FirmataStepperError> {
        let request = self.request_to(to)?;
        let leg = Leg::new(to, range, self.base, &self.config, now);
        self.link.order(request)?;
        if leg.is_doubtful() {
            self.link.order(StepperRequest::Report)?;
        }
        Ok(leg)
    }

    fn request_to(&self, to: i64) -> Result<StepperRequest, FirmataStepperError> {
        let too_far = |_| FirmataStepperError::TooFar { steps: to.abs_diff(self.base) };
        i32::try_from(to - self.base).map(StepperRequest::To).map_err(too_far)
    }

    /// Stops the motor, wherever it is.
    pub(super) fn halt(&mut self, leg: Leg) -> Result<(), FirmataStepperError> {
        self.phase = Phase::Moving { leg, then: None, side: Side::Unknown };
        self.link.order(StepperRequest::Stop)?;
        Ok(self.link.order(StepperRequest::Report)?)
    }

    /// Takes the motor's reported position in the light of its move.
    pub(super) fn seen(
        &mut self,
        seen: Seen,
        leg: &Leg,
        at: i64,
        now: f64,
    ) -> Result<(), FirmataStepperError> {
        match (seen, self.phase) {
            (Seen::Going, _) => Ok(()),
            (Seen::Zeroed, _) => self.lose(LostPosition::Zeroed, now),
            (Seen::TooFast, _) => self.lose(LostPosition::TooFast, now),
            (Seen::Astray, Phase::Moving { .. }) if leg.to.is_some() => {
                // It may be the report that is garbled.
                self.halt(leg.stopped(&self.config, now))
            }
            (Seen::Astray, _) => self.lose(LostPosition::Astray, now),
            (Seen::Short, phase) => {
                self.tries += 1;
                if self.tries > MOST_TRIES {
                    return self.time_out(leg, leg.lasted(now), now);
                }
                match phase {
                    Phase::Aligning(_) => self.align(now),
                    Phase::Homing(_) => self.again(leg, now),
                    _ => self.confirm(at, Next::Stand(Side::Unknown), now),
                }
            }
            (Seen::Complete, Phase::Aligning(_)) => self.confirm(at, Next::Align, now),
            (Seen::Complete, Phase::Homing(_)) => {
                self.motor = at;
                self.sought(now)
            }
            (Seen::Complete, Phase::Moving { then, side, .. }) => {
                self.motor = at;
                match then {
                    Some(next) => self.set_off(next, None, side, now),
                    None if leg.to.is_none() && self.has_ramp() => {
                        self.calm()?;
                        let leg = Leg::new(at, [at; 2], self.base, &self.config, now);
                        self.phase = Phase::Moving { leg, then, side };
                        Ok(())
                    }
                    None => self.confirm(at, Next::Stand(side), now),
                }
            }
            (Seen::Complete, _) => Ok(()),
        }
    }

    /// Orders a move of the search for home once more.
    fn again(&mut self, leg: &Leg, now: f64) -> Result<(), FirmataStepperError> {
        let Some(to) = leg.to else { return Ok(()) };
        self.send_pace()?;
        let new = self.ordered(to, leg.range(), now)?;
        if let Phase::Homing(Stage::Seeking(leg) | Stage::Leaving(leg, _)) = &mut self.phase {
            *leg = new;
        }
        Ok(())
    }

    fn has_ramp(&self) -> bool {
        self.config.acceleration_half_steps_per_s2 > 0.0
    }

    /// Takes the speed from a motor that was stopped: AccelStepper keeps it, and goes on by as much
    /// as it would take to stop before it turns round. Without a ramp it takes no step to stop, so
    /// that an order to its present position ends its move.
    pub(super) fn calm(&mut self) -> Result<(), FirmataStepperError> {
        if !self.has_ramp() {
            return Ok(());
        }
        self.link.order(StepperRequest::Acceleration(Decimal::default()))?;
        let here = self.request_to(self.motor)?;
        self.link.order(here)?;
        self.send_pace()
    }
}

impl Leg {
    /// One to `to` that begins now at `from`, or anywhere between two places if the motor turns.
    fn new(
        to: i64,
        [lowest, highest]: [i64; 2],
        zero: i64,
        config: &FirmataConfig,
        now: f64,
    ) -> Self {
        let steps = to.abs_diff(lowest).max(to.abs_diff(highest));
        let away = to.abs_diff(to.clamp(lowest, highest));
        let stood = lowest == highest;
        // With a ramp, a motor that turns first goes on.
        let beyond = if stood { 0 } else { config.stopping_steps() };
        let duration = config.duration_s(steps);
        let mut leg = Self {
            to: Some(to),
            steps,
            from: stood.then_some(lowest),
            lowest: lowest.min(to) - beyond,
            highest: highest.max(to) + beyond,
            zero,
            began: now,
            least_s: config.least_s(away, stood),
            ends_at: now + duration,
            query_at: now,
            deadline: now + 2.0 * duration + config.answer_timeout_s,
            last: None,
            stirred: false,
            overtaken: None,
            is_given_up: false,
        };
        leg.query_next(now);
        leg
    }

    /// This one, ordered before another one was known to have ended.
    fn overtaking(self, other: &Self) -> Self {
        Self { overtaken: other.to, ..self }
    }

    /// The stop of this move.
    pub(super) fn stopped(&self, config: &FirmataConfig, now: f64) -> Self {
        let [mut lowest, mut highest] = self.range();
        if let Some(from) = self.from {
            let most = config.most_steps(now + STOP_S - self.began);
            (lowest, highest) = (lowest.max(from - most), highest.min(from + most));
        }
        // A move that falls silent is given up when it would have been.
        let deadline = self.deadline.max(now + config.answer_timeout_s);
        let ends_at = now;
        let query_at = now + MONITOR_S;
        Self { to: None, lowest, highest, ends_at, query_at, deadline, last: None, ..*self }
    }

    /// The stop of this move, which was given up.
    pub(super) fn given_up(&self, config: &FirmataConfig, now: f64) -> Self {
        Self { is_given_up: true, ..self.stopped(config, now) }
    }

    /// Returns its age in seconds.
    fn lasted(&self, now: f64) -> f64 {
        now - self.began
    }

    /// Returns the range in which the motor may be meanwhile.
    fn range(&self) -> [i64; 2] {
        [self.lowest, self.highest]
    }

    /// Returns true if the Arduino's 0 is its end, and its beginning does not show that it went
    /// there: an order that was garbled into a zero would look the same.
    fn is_doubtful(&self) -> bool {
        self.to == Some(self.zero)
            && self.from != Some(self.zero)
            && self.from.is_none_or(|from| (from - self.zero) % 8 == 0)
    }

    /// Takes the motor's reported position.
    pub(super) fn see(&mut self, at: i64, done: bool, config: &FirmataConfig, now: f64) -> Seen {
        if done && self.to != Some(at) && self.overtaken.take_if(|to| *to == at).is_some() {
            return Seen::Going;
        }
        let stands = self.last.replace(at) == Some(at);
        let within = (self.lowest..=self.highest).contains(&at);
        let Some(to) = self.to else {
            // A stop is believed when two reports agree.
            return match stands {
                false => {
                    self.query_at = now;
                    Seen::Going
                }
                true if at == self.zero => Seen::Zeroed,
                true if within => Seen::Complete,
                true => Seen::Astray,
            };
        };
        let ahead = self.from.is_some_and(|from| {
            let most = config.most_steps(now - self.began);
            from.abs_diff(at) > most.unsigned_abs()
        });
        if !within {
            return Seen::Astray;
        }
        if !done && !stands {
            self.stirred |= at != self.zero;
            if at == to {
                self.query_at = now;
            }
            return if ahead { Seen::Astray } else { Seen::Going };
        }
        let zeroed = at == self.zero
            && if at == to {
                self.is_doubtful() && !self.stirred
            } else {
                done || self.stirred || self.from != Some(self.zero)
            };
        if zeroed {
            return Seen::Zeroed;
        }
        if at == to && now - self.began < self.least_s || ahead {
            return Seen::TooFast;
        }
        if at == to { Seen::Complete } else { Seen::Short }
    }

    pub(super) fn due(&mut self, now: f64) -> Due {
        if now >= self.deadline {
            return Due::TimedOut(now - self.began);
        }
        if now < self.query_at {
            return Due::Nothing;
        }
        let late = now >= self.ends_at + QUERY_S;
        self.query_next(now);
        if late { Due::Urge } else { Due::RequestPosition }
    }

    fn query_next(&mut self, now: f64) {
        let monitored = now + MONITOR_S;
        let late = self.ends_at + QUERY_S;
        self.query_at = if monitored + MONITOR_S / 2.0 < self.ends_at {
            monitored
        } else if now < late {
            late
        } else if self.to.is_none() {
            monitored
        } else {
            now + QUERY_S
        };
    }
}

/// Below the target by the play, and up to it.
fn roundabout(target: i64, play: i64) -> Way {
    (target - play, (play > 0).then_some(target), Side::Below)
}
