use foxhunt_core::Clock;
use foxhunt_wire::{ByteStream, firmata::StepperRequest};

use super::{
    FirmataStepper, FirmataStepperError, LostPosition,
    error::HomeFailure,
    phase::{Phase, Side, Stage, Wait},
};

/// How far the switch is looked for, in turns.
const SEEK_TURNS: f64 = 1.1;
/// How far it is left, in turns.
const LEAVE_TURNS: f64 = 0.25;
/// How long after a step the switch has reported its level, in seconds.
const LOOK_S: f64 = 0.03;

impl<S: ByteStream, C: Clock> FirmataStepper<S, C> {
    /// Has it look for its home switch again; then it goes where it was last sent.
    ///
    /// # Errors
    ///
    /// [`FirmataStepperError::NoSwitch`] where none is configured; [`FirmataStepperError::Busy`]
    /// while it turns; any error of the link.
    pub fn find_home(&mut self) -> Result<(), FirmataStepperError> {
        if self.config.switch().is_none() {
            return Err(FirmataStepperError::NoSwitch);
        }
        let now = self.clock.now();
        match self.phase {
            Phase::Standing { .. } => self.seek(now),
            Phase::Greeting(_) | Phase::Arranging { .. } => {}
            _ => return Err(FirmataStepperError::Busy),
        }
        (self.lost, self.home_failure) = (Some(LostPosition::NotHomed), None);
        self.advance()
    }

    /// Begins to look for the switch.
    pub(super) fn seek(&mut self, now: f64) {
        self.phase = Phase::Homing(Stage::Level(Wait::new(now)));
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
        if closed && let Phase::Homing(Stage::Seeking(_)) = self.phase {
            self.link.order(StepperRequest::Stop)?;
            self.phase = Phase::Homing(Stage::Stopping(self.stopping(now)));
        }
        Ok(())
    }

    /// Goes on once the switch is known.
    pub(super) fn look(&mut self, now: f64) -> Result<(), FirmataStepperError> {
        let turn = self.gearing.per_turn();
        match &mut self.phase {
            Phase::Homing(Stage::Level(wait)) => match self.switch_closed {
                Some(true) => self.leave(0, now),
                Some(false) => {
                    let far = whole(turn * SEEK_TURNS);
                    let leg = self.ordered(self.motor - far, now)?;
                    self.phase = Phase::Homing(Stage::Seeking(leg));
                    Ok(())
                }
                None if now >= wait.since + self.config.answer_timeout_s => {
                    self.fail("report whether it is closed", 0.0, now);
                    Ok(())
                }
                None => {
                    let due = wait.is_due(now);
                    if due { self.watch_switch() } else { Ok(()) }
                }
            },
            Phase::Homing(Stage::Looking(until, steps)) if now >= *until - 1e-9 => {
                let steps = *steps;
                if self.switch_closed == Some(false) {
                    let home = self.home();
                    self.base += home - self.motor;
                    // It was pushed here.
                    (self.motor, self.side) = (home, Side::Below);
                    self.lost = None;
                    self.stand(now);
                    self.go_on(now)
                } else if steps >= whole(turn * LEAVE_TURNS).unsigned_abs() {
                    self.fail("open", LEAVE_TURNS, now);
                    Ok(())
                } else {
                    self.leave(steps, now)
                }
            }
            _ => Ok(()),
        }
    }

    /// A move of the search has ended where the motor is now.
    pub(super) fn sought(&mut self, now: f64) -> Result<(), FirmataStepperError> {
        match self.phase {
            Phase::Homing(Stage::Seeking(_)) => {
                self.fail("close", SEEK_TURNS, now);
                Ok(())
            }
            Phase::Homing(Stage::Stopping(_)) => self.leave(0, now),
            Phase::Homing(Stage::Leaving(_, steps)) => {
                self.phase = Phase::Homing(Stage::Looking(now + LOOK_S, steps));
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// One step forwards, after so many.
    fn leave(&mut self, steps: u64, now: f64) -> Result<(), FirmataStepperError> {
        let leg = self.ordered(self.motor + 1, now)?;
        self.phase = Phase::Homing(Stage::Leaving(leg, steps + 1));
        Ok(())
    }

    fn fail(&mut self, expected: &'static str, turns: f64, now: f64) {
        let pin = self.config.switch().unwrap_or_default();
        self.home_failure = Some(HomeFailure { pin, expected, turns });
        self.wanted = None;
        self.stand(now);
    }
}

#[expect(clippy::cast_possible_truncation, reason = "some millions at most, by the configuration")]
fn whole(steps: f64) -> i64 {
    steps.round() as i64
}
