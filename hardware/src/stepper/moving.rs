use foxhunt_core::Clock;
use foxhunt_wire::{ByteStream, firmata::StepperRequest};

use super::{
    Approach, FirmataStepper, FirmataStepperError,
    leg::Leg,
    phase::{Arrangement, Phase, Side, Wait},
};

/// The Arduino's own count is kept below this; the real firmware loses the bits above 2²⁸.
const MOST_COUNTED: u64 = 1 << 27;

/// A way to a target: where to first, where to then, and on which side of the gear's play it ends.
type Way = (i64, Option<i64>, Side);

impl<S: ByteStream, C: Clock> FirmataStepper<S, C> {
    /// The play of the gear in steps.
    pub(super) fn play(&self) -> i64 {
        self.gearing.steps(self.config.backlash_deg.to_radians()).unwrap_or(0)
    }

    /// Whether a target is within what the Arduino can count at once.
    pub(super) fn reachable(&self, target: i64) -> Result<(), FirmataStepperError> {
        let steps = target.abs_diff(self.motor);
        if steps + self.play().unsigned_abs() < MOST_COUNTED {
            return Ok(());
        }
        Err(FirmataStepperError::TooFar { steps })
    }

    /// It stands where the motor is.
    pub(super) fn stand(&mut self, now: f64) {
        self.phase = Phase::Standing { settled: now + self.config.settle_s };
    }

    /// Goes where it was last sent, if it is known where it is.
    pub(super) fn go_on(&mut self, now: f64) -> Result<(), FirmataStepperError> {
        if self.lost.is_some() {
            if self.config.switch().is_some() && self.home_failure.is_none() {
                self.seek(now);
            }
            return Ok(());
        }
        let Some(target) = self.wanted else { return Ok(()) };
        if self.motor.abs_diff(self.base) >= MOST_COUNTED {
            self.phase = Phase::Arranging { wait: Wait::new(now), how: Arrangement::Zero };
            return self.act(now);
        }
        match self.way(target) {
            None => self.wanted = None,
            Some((first, then, side)) => self.set_off(first, then, side, now)?,
        }
        Ok(())
    }

    /// How to come to `target`; `None` where it is there.
    fn way(&self, target: i64) -> Option<Way> {
        let (play, here) = (self.play(), self.antenna());
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
        if bound == Some(target) && side == Side::Below {
            return Ok(());
        }
        let (first, then, side) = roundabout(target, self.play());
        // It is between where it set off and where it was sent.
        let behind = leg.steps;
        self.set_off(first, then, side, now)?;
        if let Phase::Moving { leg, .. } = &mut self.phase {
            let steps = leg.steps + behind;
            let (duration, patience) =
                (self.config.duration_s(steps), self.config.answer_timeout_s);
            *leg = Leg::new(leg.to, steps, duration, patience, now);
        }
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
        let leg = self.ordered(first, now)?;
        (self.phase, self.side) = (Phase::Moving { leg, then, side }, Side::Unknown);
        Ok(())
    }

    /// Orders the motor to a step.
    pub(super) fn ordered(&mut self, to: i64, now: f64) -> Result<Leg, FirmataStepperError> {
        let request = self.request_to(to)?;
        self.link.order(request)?;
        let steps = to.abs_diff(self.motor);
        let (duration, patience) = (self.config.duration_s(steps), self.config.answer_timeout_s);
        Ok(Leg::new(Some(to), steps, duration, patience, now))
    }

    pub(super) fn request_to(&self, to: i64) -> Result<StepperRequest, FirmataStepperError> {
        let too_far = |_| FirmataStepperError::TooFar { steps: to.abs_diff(self.base) };
        i32::try_from(to - self.base).map(StepperRequest::To).map_err(too_far)
    }

    /// Stops it, wherever it is.
    pub(super) fn halt(&mut self, now: f64) -> Result<(), FirmataStepperError> {
        self.link.order(StepperRequest::Stop)?;
        self.phase = Phase::Moving { leg: self.stopping(now), then: None, side: Side::Unknown };
        Ok(())
    }

    /// The end of a move that was stopped.
    pub(super) fn stopping(&self, now: f64) -> Leg {
        let (duration, patience) = (self.config.duration_s(0), self.config.answer_timeout_s);
        Leg::new(None, 0, duration, patience, now)
    }

    /// A leg has ended where the motor is now.
    pub(super) fn moved(
        &mut self,
        then: Option<i64>,
        side: Side,
        now: f64,
    ) -> Result<(), FirmataStepperError> {
        if let Some(next) = then {
            return self.set_off(next, None, side, now);
        }
        self.side = side;
        self.stand(now);
        if side != Side::Unknown && self.wanted == Some(self.antenna()) {
            self.wanted = None;
        }
        self.go_on(now)
    }
}

/// Below the target by the play, and up to it.
fn roundabout(target: i64, play: i64) -> Way {
    (target - play, (play > 0).then_some(target), Side::Below)
}
