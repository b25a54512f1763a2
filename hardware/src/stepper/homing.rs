use foxhunt_core::Clock;
use foxhunt_wire::{ByteStream, firmata::StepperRequest};

use super::{
    FirmataStepper, FirmataStepperError, LostPosition, Next, Phase, Side, Stage, Wait,
    error::HomeFailure,
};

/// Distance over which the switch is searched for, in turns.
const SEEK_TURNS: f64 = 1.1;
/// Greatest distance in turns by which the antenna leaves the switch until it opens.
const LEAVE_TURNS: f64 = 0.25;
/// Time after a step at which the switch has its level, in seconds.
const LOOK_S: f64 = 0.02;

impl<S: ByteStream, C: Clock> FirmataStepper<S, C> {
    /// Has the stepper look for its home switch again; then it goes to its last ordered direction.
    ///
    /// # Errors
    ///
    /// [`FirmataStepperError::NoSwitch`] without a switch; [`FirmataStepperError::Busy`]
    /// while it turns; any error of the link.
    pub fn find_home(&mut self) -> Result<(), FirmataStepperError> {
        if self.config.switch().is_none() {
            return Err(FirmataStepperError::NoSwitch);
        }
        let now = self.clock.now();
        (self.lost, self.home_failure) = (Some(LostPosition::NotHomed), None);
        match self.phase {
            Phase::Standing { .. } => {
                self.forgive();
                self.go_on(now)?;
            }
            Phase::Greeting(_) | Phase::Arranging(_) => {}
            _ => return Err(FirmataStepperError::Busy),
        }
        self.advance()
    }

    /// Begins to look for the switch.
    pub(super) fn seek(&mut self, now: f64) -> Result<(), FirmataStepperError> {
        let left = whole(self.gearing.per_turn() * SEEK_TURNS);
        let wait = Wait::new(now).every(self.config.ask_s());
        self.phase = Phase::Homing(Stage::Level { wait, seen: None, left });
        self.look(now)
    }

    /// Takes the levels of a port.
    pub(super) fn switched(
        &mut self,
        port: u8,
        levels: u8,
        now: f64,
    ) -> Result<(), FirmataStepperError> {
        let Some(pin) = self.config.switch().filter(|pin| pin / 8 == port) else {
            return Ok(());
        };
        let closed = levels >> (pin % 8) & 1 == 0;
        self.switch_closed = Some(closed);
        match &mut self.phase {
            Phase::Homing(Stage::Seeking(leg)) if closed => {
                let to = leg.to.unwrap_or(self.motor);
                let stop = leg.stopped(&self.config, now);
                self.phase = Phase::Homing(Stage::Stopping(stop, to));
                self.link.order(StepperRequest::Stop)?;
                Ok(self.link.order(StepperRequest::Report)?)
            }
            Phase::Homing(Stage::Level { seen, .. }) if *seen != Some(closed) => {
                // One report may be garbled.
                *seen = Some(closed);
                self.read_switch()
            }
            Phase::Homing(Stage::Level { left, .. }) => {
                let left = *left;
                if closed {
                    return self.leave(0, now);
                }
                let leg = self.ordered(self.motor - left, [self.motor; 2], now)?;
                self.phase = Phase::Homing(Stage::Seeking(leg));
                Ok(())
            }
            Phase::Homing(Stage::Looking { until, steps, wait, opened }) => {
                if now < *until - 1e-9 || wait.count == 0 {
                    return Ok(());
                }
                let steps = *steps;
                if !closed && !std::mem::replace(opened, true) {
                    return self.read_switch();
                }
                if !closed {
                    return self.is_home(now);
                }
                if steps >= whole(self.gearing.per_turn() * LEAVE_TURNS).unsigned_abs() {
                    self.fail("open", LEAVE_TURNS, now);
                    return Ok(());
                }
                self.leave(steps, now)
            }
            _ => Ok(()),
        }
    }

    /// Requests the switch's level if it is due.
    pub(super) fn look(&mut self, now: f64) -> Result<(), FirmataStepperError> {
        let patience = self.config.answer_timeout_s;
        let wait = match &mut self.phase {
            Phase::Homing(Stage::Level { wait, .. }) => wait,
            Phase::Homing(Stage::Looking { until, wait, .. }) if now >= *until - 1e-9 => wait,
            _ => return Ok(()),
        };
        if now >= wait.since + patience {
            self.fail("report whether it is closed", 0.0, now);
        } else if wait.is_due(now) {
            // A pin that was not made an input reports nothing.
            return if wait.count > 1 { self.watch_switch() } else { self.read_switch() };
        }
        Ok(())
    }

    /// A move of the search has ended where the motor is now.
    pub(super) fn sought(&mut self, now: f64) -> Result<(), FirmataStepperError> {
        match self.phase {
            Phase::Homing(Stage::Seeking(_)) => {
                self.fail("close", SEEK_TURNS, now);
                Ok(())
            }
            Phase::Homing(Stage::Stopping(_, to)) => {
                self.calm()?;
                let left = self.motor - to;
                let wait = Wait::new(now).every(self.config.ask_s());
                self.phase = Phase::Homing(Stage::Level { wait, seen: None, left });
                self.look(now)
            }
            Phase::Homing(Stage::Leaving(_, steps)) => {
                let wait = Wait::new(now + LOOK_S).every(self.config.ask_s());
                let until = now + LOOK_S;
                self.phase = Phase::Homing(Stage::Looking { until, steps, wait, opened: false });
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Orders one step forwards, after `steps` others.
    fn leave(&mut self, steps: u64, now: f64) -> Result<(), FirmataStepperError> {
        let leg = self.ordered(self.motor + 1, [self.motor; 2], now)?;
        self.phase = Phase::Homing(Stage::Leaving(leg, steps + 1));
        Ok(())
    }

    /// The motor stands where the switch opens.
    fn is_home(&mut self, now: f64) -> Result<(), FirmataStepperError> {
        let home = self.home();
        self.base += home - self.motor;
        self.motor = home;
        (self.lost, self.tries) = (None, 0);
        // It was pushed here.
        self.confirm(home, Next::Stand(Side::Below), now)
    }

    fn fail(&mut self, expected: &'static str, turns: f64, now: f64) {
        let pin = self.config.switch().unwrap_or_default();
        self.home_failure = Some(HomeFailure { pin, expected, turns });
        self.wanted = None;
        self.link.has_stopped();
        self.stand(now);
    }
}

#[expect(clippy::cast_possible_truncation, reason = "some millions at most, by the configuration")]
fn whole(steps: f64) -> i64 {
    steps.round() as i64
}
