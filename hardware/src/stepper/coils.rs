//! Confirmation of the motor's position by the levels at its coils.

use foxhunt_core::Clock;
use foxhunt_wire::{
    ByteStream,
    firmata::{PinMode, Request, StepperRequest},
};

use super::{
    Confirming, FirmataStepper, FirmataStepperError, Levels, LostPosition, Next, Phase, Side,
    error::CoilFailure,
};

/// Answers of one kind that contradict the count before that is given up: one may be garbled.
const STRIKES: u8 = 2;

/// First half steps, in which two coils are on, and those in which the other two are: a pin that
/// was garbled shows in one of them.
pub(super) const FIRST_STEPS: i64 = 1;
const SHOWN_STEPS: i64 = 5;

/// Number of trials of the coils.
const MOST_ALIGNMENTS: u8 = 3;

impl<S: ByteStream, C: Clock> FirmataStepper<S, C> {
    /// Has the levels of the coils' pins reported, which ConfigurableFirmata does of inputs: each
    /// becomes one, and AccelStepper then makes it an output again without the firmware's notice.
    pub(super) fn expose_coils(&mut self) -> Result<(), FirmataStepperError> {
        for pin in self.config.pins {
            self.link.send(Request::PinMode { pin, mode: PinMode::Input })?;
        }
        Ok(self.link.order(StepperRequest::Enable(true))?)
    }

    /// Has the coils, and the position where a query of it is open, confirm that the motor stands
    /// at a step.
    pub(super) fn confirm(
        &mut self,
        at: i64,
        next: Next,
        now: f64,
    ) -> Result<(), FirmataStepperError> {
        self.phase = Phase::Confirming(Confirming {
            at,
            next,
            since: now,
            asked_at: now,
            reads: self.aligned || matches!(next, Next::Align),
            asks: self.link.unanswered() > 0 || !self.aligned,
            strikes: 0,
        });
        self.request_confirmation()
    }

    fn request_confirmation(&mut self) -> Result<(), FirmataStepperError> {
        let Phase::Confirming(confirming) = self.phase else { return Ok(()) };
        if confirming.reads {
            self.levels = Levels::default();
            let mut ports = self.config.pins.map(|pin| pin / 8);
            ports.sort_unstable();
            for (i, port) in ports.into_iter().enumerate() {
                if i > 0 && ports.get(i - 1) == Some(&port) {
                    continue;
                }
                self.link.send(Request::ReportDigital { port, on: true })?;
                // Otherwise every step would be reported.
                if self.config.switch().is_none_or(|pin| pin / 8 != port) {
                    self.link.send(Request::ReportDigital { port, on: false })?;
                }
            }
        }
        if confirming.asks {
            self.link.order(StepperRequest::Report)?;
        }
        Ok(())
    }

    /// Takes a reported position while the motor's place is confirmed.
    pub(super) fn confirm_position(
        &mut self,
        at: i64,
        now: f64,
    ) -> Result<(), FirmataStepperError> {
        let unanswered = self.link.unanswered();
        let Phase::Confirming(confirming) = &mut self.phase else { return Ok(()) };
        if at != confirming.at {
            confirming.asks = true;
            return self.strike(LostPosition::Astray, now);
        }
        confirming.asks &= unanswered > 0;
        self.confirmed(now)
    }

    /// Takes reported levels while the motor's place is confirmed.
    pub(super) fn confirm_levels(&mut self, now: f64) -> Result<(), FirmataStepperError> {
        let Phase::Confirming(confirming) = &mut self.phase else { return Ok(()) };
        if !confirming.reads {
            return Ok(());
        }
        match agree(self.config.pins, confirming.at - self.base, &self.levels) {
            None => Ok(()),
            Some(false) => self.strike(LostPosition::Coils, now),
            Some(true) => {
                confirming.reads = false;
                self.confirmed(now)
            }
        }
    }

    /// Does what is due while the motor's place is confirmed.
    pub(super) fn await_confirmation(&mut self, now: f64) -> Result<(), FirmataStepperError> {
        let patience = self.config.answer_timeout_s;
        let ask_s = self.config.ask_s();
        let Phase::Confirming(confirming) = &mut self.phase else { return Ok(()) };
        if now < confirming.asked_at + ask_s {
            return Ok(());
        }
        if now < confirming.since + patience {
            confirming.asked_at = now;
            self.link.forget_queries();
            return self.request_confirmation();
        }
        if matches!(confirming.next, Next::Align) && confirming.reads {
            return self.fail_coils(CoilFailure::Silent, now);
        }
        self.lose(LostPosition::Silent, now)?;
        self.was_reset(now);
        Ok(())
    }

    fn strike(&mut self, why: LostPosition, now: f64) -> Result<(), FirmataStepperError> {
        let Phase::Confirming(confirming) = &mut self.phase else { return Ok(()) };
        confirming.strikes += 1;
        confirming.asked_at = now;
        if confirming.strikes < STRIKES {
            self.link.forget_queries();
            return self.request_confirmation();
        }
        match confirming.next {
            Next::Align => self.fail_coils(CoilFailure::Wrong, now),
            Next::Stand(_) => self.lose(why, now),
        }
    }

    fn confirmed(&mut self, now: f64) -> Result<(), FirmataStepperError> {
        let Phase::Confirming(Confirming { at, next, since, reads: false, asks: false, .. }) =
            self.phase
        else {
            return Ok(());
        };
        // Until its first step it stands where it stood, whatever the Arduino counts.
        if self.aligned || matches!(next, Next::Align) {
            self.motor = at;
        }
        self.link.has_stopped();
        match next {
            Next::Align if at.abs_diff(self.base) < SHOWN_STEPS.unsigned_abs() => {
                return self.align_to(SHOWN_STEPS, [at; 2], now);
            }
            Next::Align => {
                (self.aligned, self.is_held, self.misaligned) = (true, true, 0);
                self.stand(since);
            }
            Next::Stand(side) => {
                self.side = side;
                self.stand(since);
                if side != Side::Unknown && self.wanted == Some(self.antenna()) {
                    (self.wanted, self.tries) = (None, 0);
                }
            }
        }
        self.go_on(now)
    }

    /// The coils did not follow the first steps: once more from the beginning, as those were few.
    pub(super) fn fail_coils(
        &mut self,
        failure: CoilFailure,
        now: f64,
    ) -> Result<(), FirmataStepperError> {
        self.misaligned += 1;
        self.is_held = false;
        if self.misaligned >= MOST_ALIGNMENTS {
            self.coil_failure = Some(failure);
        }
        self.rearrange(now)
    }
}

/// Returns true if the pins of IN1 to IN4 have the levels of a count of half steps; `None` while
/// some are not reported.
fn agree(pins: [u8; 4], count: i64, levels: &Levels) -> Option<bool> {
    let mut agree = true;
    for (coil, pin) in (0..).zip(pins) {
        let level = (*levels.get(usize::from(pin / 8))?)? >> (pin % 8) & 1 == 1;
        // Each coil is on in its own half step, and in those before and after.
        let on = (count - 2 * coil + 1).rem_euclid(8) < 3;
        agree &= level == on;
    }
    Some(agree)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coils_take_turns_at_the_pins_that_lead_to_them() {
        let with = |port_1: u8| {
            let mut levels = Levels::default();
            levels[1] = Some(port_1);
            levels
        };
        let patterns = [0x1, 0x3, 0x2, 0x6, 0x4, 0xC, 0x8, 0x9];
        for (count, pattern) in (0..).zip(patterns) {
            assert_eq!(agree([8, 9, 10, 11], count - 16, &with(pattern)), Some(true), "{count}");
            assert_eq!(agree([8, 9, 10, 11], count + 1, &with(pattern)), Some(false), "{count}");
        }
        // Levels of another port are missing.
        assert_eq!(agree([7, 9, 10, 11], 0, &with(0x1)), None);
    }
}
