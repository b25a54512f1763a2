use foxhunt_core::Clock;
use foxhunt_wire::{
    ByteStream,
    firmata::{Decimal, PinMode, Request, StepperInterface, StepperRequest, Wiring},
};

use super::{
    FirmataStepper, FirmataStepperError, LostPosition,
    leg::Due,
    phase::{Arrangement, Phase, Side, Stage, Wait},
};

/// A 28BYJ-48 is driven in half steps.
const HALF_STEPS: u8 = 1;

impl<S: ByteStream, C: Clock> FirmataStepper<S, C> {
    /// The Arduino was reset, or plugged in anew: it is set up again, and has forgotten where it
    /// was.
    pub(super) fn was_reset(&mut self, now: f64) {
        match self.phase {
            // Nothing was known of it yet that it could forget.
            Phase::Greeting(_) | Phase::Arranging { how: Arrangement::Setup, .. } => {}
            Phase::Standing { .. }
            | Phase::Arranging { .. }
            | Phase::Checking { turning: false, .. }
                if self.config.trust_after_reset => {}
            _ => self.lose(LostPosition::Reset),
        }
        self.side = Side::Unknown;
        self.switch_closed = None;
        self.phase = Phase::Greeting(Wait::new(now));
    }

    pub(super) fn lose(&mut self, why: LostPosition) {
        // An older reason is the better one.
        self.lost.get_or_insert(why);
        // With a switch it is found again, and goes on where it was sent.
        if self.config.switch().is_none() {
            self.wanted = None;
        }
    }

    /// The link was broken: the Arduino may have been reset without notice.
    pub(super) fn check(&mut self, now: f64) {
        let turning = match self.phase {
            Phase::Greeting(_) | Phase::Arranging { .. } | Phase::Checking { .. } => return,
            Phase::Standing { .. } => false,
            Phase::Homing(_) | Phase::Moving { .. } => true,
        };
        self.phase = Phase::Checking { wait: Wait::new(now), turning };
    }

    /// Does what is due.
    pub(super) fn act(&mut self, now: f64) -> Result<(), FirmataStepperError> {
        let patience = self.config.answer_timeout_s;
        match &mut self.phase {
            Phase::Greeting(wait) => {
                if wait.is_due(now) {
                    self.link.send(Request::Firmware)?;
                }
                Ok(())
            }
            Phase::Arranging { wait, how } => {
                let (due, how) = (wait.is_due(now), *how);
                if due { self.arrange(how) } else { Ok(()) }
            }
            Phase::Checking { wait, turning } => {
                if now >= wait.since + patience {
                    if *turning {
                        self.lose(LostPosition::Silent);
                    }
                    self.was_reset(now);
                } else if wait.is_due(now) {
                    self.link.order(StepperRequest::Report)?;
                }
                Ok(())
            }
            Phase::Moving { leg, .. } => {
                let (due, to, steps) = (leg.due(now), leg.to, leg.steps);
                self.urge(due, to, steps, now)
            }
            Phase::Homing(Stage::Seeking(leg) | Stage::Stopping(leg) | Stage::Leaving(leg, _)) => {
                let (due, to, steps) = (leg.due(now), leg.to, leg.steps);
                self.urge(due, to, steps, now)
            }
            Phase::Homing(Stage::Level(_) | Stage::Looking(..)) => self.look(now),
            Phase::Standing { .. } => Ok(()),
        }
    }

    /// Makes good what was lost of a move.
    fn urge(
        &mut self,
        due: Due,
        to: Option<i64>,
        steps: u64,
        now: f64,
    ) -> Result<(), FirmataStepperError> {
        match due {
            Due::Nothing => {}
            Due::RequestPosition => self.link.order(StepperRequest::Report)?,
            Due::Repeat => {
                let again = to.map_or(Ok(StepperRequest::Stop), |to| self.request_to(to))?;
                self.link.order(again)?;
                self.link.order(StepperRequest::Report)?;
            }
            Due::TimedOut(seconds) => {
                self.phase = Phase::Checking { wait: Wait::new(now), turning: true };
                return Err(FirmataStepperError::MoveTimeout { steps, seconds });
            }
        }
        Ok(())
    }

    /// Configures the Arduino's motor, or sets its position to 0, and queries it.
    fn arrange(&mut self, how: Arrangement) -> Result<(), FirmataStepperError> {
        match how {
            Arrangement::Zero => self.link.order(StepperRequest::Zero)?,
            Arrangement::Setup => {
                let [in1, in2, in3, in4] = self.config.pins;
                self.link.order(StepperRequest::Configure(StepperInterface {
                    wiring: Wiring::FourWire([in1, in3, in2, in4]),
                    divisor_log2: HALF_STEPS,
                    enable_pin: None,
                    inverted: 0,
                }))?;
                let decimal = |value| Decimal::truncated(value).unwrap_or_default();
                let speed = decimal(self.config.speed_half_steps_per_s);
                self.link.order(StepperRequest::Speed(speed))?;
                let acceleration = decimal(self.config.acceleration_half_steps_per_s2);
                self.link.order(StepperRequest::Acceleration(acceleration))?;
                self.link.order(StepperRequest::Enable(true))?;
                self.watch_switch()?;
            }
        }
        Ok(self.link.order(StepperRequest::Report)?)
    }

    /// Has the Arduino report the level of the home switch.
    pub(super) fn watch_switch(&mut self) -> Result<(), FirmataStepperError> {
        if let Some(pin) = self.config.switch() {
            self.link.send(Request::PinMode { pin, mode: PinMode::PullUp })?;
            self.link.send(Request::ReportDigital { port: pin / 8, on: true })?;
        }
        Ok(())
    }

    /// What keeps the antenna from turning.
    pub(super) fn hindrance(&self, now: f64) -> Result<(), FirmataStepperError> {
        let patience = self.config.answer_timeout_s;
        match self.phase {
            Phase::Greeting(wait) if now >= wait.since + patience => {
                Err(FirmataStepperError::NoAnswer { seconds: now - wait.since })
            }
            Phase::Arranging { wait, .. } if now >= wait.since + patience => {
                let firmware = self.firmware.clone().unwrap_or_default();
                Err(FirmataStepperError::NoStepper { firmware })
            }
            Phase::Homing(_) => Ok(()),
            _ => match (&self.home_failure, self.lost) {
                (Some(failure), _) => Err(failure.error()),
                // With a switch it will be homed.
                (None, Some(why)) if self.config.switch().is_none() => {
                    Err(FirmataStepperError::PositionLost { why })
                }
                _ => Ok(()),
            },
        }
    }
}
