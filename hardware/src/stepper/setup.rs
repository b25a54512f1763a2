use foxhunt_core::Clock;
use foxhunt_wire::{
    ByteStream,
    firmata::{Decimal, PinMode, Request, StepperInterface, StepperRequest, Wiring},
};

use super::{
    Due, FirmataStepper, FirmataStepperError, Leg, LostPosition, MONITOR_S, Phase, Side, Stage,
    Wait,
    coils::FIRST_STEPS,
    error::{CoilFailure, MissingStepper},
};

/// A 28BYJ-48 is driven in half steps.
const HALF_STEPS: u8 = 1;
/// Half steps of the coils until the first ones are on again.
const CYCLE: i64 = 8;
/// Queries of the position to a set-up; then it is repeated.
const QUERIES: u32 = 5;
/// Intervals of queries of the position: while the motor stands, and after one without an answer.
const WATCH_S: [f64; 2] = [1.0, 0.25];
/// Silence that a motor that turns is granted, in times that an answer takes.
const MOST_SILENT: f64 = 3.0;
/// Queries of a motor that stands that may stay unanswered.
const MOST_UNANSWERED: u32 = 4;

impl<S: ByteStream, C: Clock> FirmataStepper<S, C> {
    /// The Arduino was reset, or plugged in again, or fell silent: it is set up again, and has lost
    /// its position.
    pub(super) fn was_reset(&mut self, now: f64) {
        match self.phase {
            // Nothing was known of it yet that it could forget.
            Phase::Greeting(_) | Phase::Arranging(_) => {}
            Phase::Standing { .. } | Phase::Checking(_) if self.config.trust_after_reset => {}
            _ => self.forget(LostPosition::Reset),
        }
        self.link.forget_queries();
        (self.aligned, self.side, self.switch_closed) = (false, Side::Unknown, None);
        self.phase = Phase::Greeting(Wait::new(now));
    }

    /// It is not known any more where the antenna looks.
    fn forget(&mut self, why: LostPosition) {
        // An older reason is the better one.
        self.lost.get_or_insert(why);
        self.is_held = false;
        // With a switch it is found again, and goes on where it was sent.
        if self.config.switch().is_none() {
            self.wanted = None;
        }
    }

    /// It is not known any more where the antenna looks: the motor is stopped, and set up again.
    pub(super) fn lose(&mut self, why: LostPosition, now: f64) -> Result<(), FirmataStepperError> {
        self.forget(why);
        self.rearrange(now)
    }

    /// Sets the motor up again, which stops it.
    pub(super) fn rearrange(&mut self, now: f64) -> Result<(), FirmataStepperError> {
        self.link.forget_queries();
        (self.aligned, self.side) = (false, Side::Unknown);
        self.phase = Phase::Arranging(Wait::new(now).every(self.config.ask_s()));
        self.arranging_since.get_or_insert(now);
        self.act(now)
    }

    /// The link was broken: the Arduino may have been reset without notice.
    pub(super) fn check(&mut self, now: f64) -> Result<(), FirmataStepperError> {
        match self.phase {
            Phase::Standing { .. } => {
                self.link.forget_queries();
                self.phase = Phase::Checking(Wait::new(now));
                Ok(())
            }
            Phase::Moving { leg, .. }
            | Phase::Homing(
                Stage::Seeking(leg) | Stage::Stopping(leg, _) | Stage::Leaving(leg, _),
            ) => self.halt(leg.stopped(&self.config, now)),
            Phase::Aligning(_) => self.rearrange(now),
            _ => Ok(()),
        }
    }

    /// Does what is due.
    pub(super) fn act(&mut self, now: f64) -> Result<(), FirmataStepperError> {
        let patience = self.config.answer_timeout_s;
        match &mut self.phase {
            Phase::Greeting(wait) => {
                if wait.is_due(now) {
                    if self.link.may_turn() {
                        self.link.order(StepperRequest::Stop)?;
                    }
                    self.link.send(Request::Firmware)?;
                }
                Ok(())
            }
            Phase::Arranging(wait) => {
                let due = wait.is_due(now);
                let count = wait.count;
                if due { self.arrange(count) } else { Ok(()) }
            }
            Phase::Checking(wait) => {
                if now >= wait.since + patience {
                    self.was_reset(now);
                } else if wait.is_due(now) {
                    self.link.order(StepperRequest::Report)?;
                }
                Ok(())
            }
            Phase::Confirming(_) => self.await_confirmation(now),
            Phase::Moving { leg, .. }
            | Phase::Aligning(leg)
            | Phase::Homing(
                Stage::Seeking(leg) | Stage::Stopping(leg, _) | Stage::Leaving(leg, _),
            ) => {
                let due = leg.due(now);
                let leg = *leg;
                self.urge(due, &leg, now)
            }
            Phase::Homing(Stage::Level { .. } | Stage::Looking { .. }) => self.look(now),
            Phase::Standing { watch_at, .. } if now >= *watch_at => {
                let unanswered = self.link.unanswered();
                let [seldom, soon] = WATCH_S;
                *watch_at = now + if unanswered > 0 { soon } else { seldom };
                if unanswered >= MOST_UNANSWERED {
                    self.link.forget_queries();
                    self.phase = Phase::Checking(Wait::new(now));
                    return Ok(());
                }
                Ok(self.link.order(StepperRequest::Report)?)
            }
            Phase::Standing { .. } => Ok(()),
        }
    }

    /// Looks after a move.
    fn urge(&mut self, due: Due, leg: &Leg, now: f64) -> Result<(), FirmataStepperError> {
        match due {
            Due::Nothing => return Ok(()),
            Due::TimedOut(seconds) => return self.time_out(leg, seconds, now),
            // A stop is sent until it is confirmed.
            _ if leg.to.is_none() => self.link.order(StepperRequest::Stop)?,
            // What does not answer may turn anywhere.
            _ if f64::from(self.link.silent()) * MONITOR_S >= MOST_SILENT * self.config.ask_s() => {
                return self.halt(leg.stopped(&self.config, now));
            }
            Due::Urge => self.send_pace()?,
            Due::RequestPosition => {}
        }
        Ok(self.link.order(StepperRequest::Report)?)
    }

    /// Gives a move up.
    pub(super) fn time_out(
        &mut self,
        leg: &Leg,
        seconds: f64,
        now: f64,
    ) -> Result<(), FirmataStepperError> {
        if leg.is_given_up {
            // The stop goes on with the greeting.
            self.forget(LostPosition::Silent);
            self.was_reset(now);
            return Ok(());
        }
        if let Phase::Aligning(_) = self.phase {
            return self.fail_coils(CoilFailure::Silent, now);
        }
        (self.wanted, self.tries) = (None, 0);
        self.halt(leg.given_up(&self.config, now))?;
        Err(FirmataStepperError::MoveTimeout { steps: leg.steps, seconds })
    }

    /// Configures the Arduino's motor, and queries its position, which is 0 then.
    fn arrange(&mut self, count: u32) -> Result<(), FirmataStepperError> {
        if count % QUERIES == 1 {
            if self.link.may_turn() {
                self.link.order(StepperRequest::Stop)?;
            }
            // Each Configure without it takes up memory for good.
            self.link.send(Request::Reset)?;
            let [in1, in2, in3, in4] = self.config.pins;
            self.link.order(StepperRequest::Configure(StepperInterface {
                wiring: Wiring::FourWire([in1, in3, in2, in4]),
                divisor_log2: HALF_STEPS,
                enable_pin: None,
                inverted: 0,
            }))?;
            if count > 1 {
                self.link.send(Request::Capabilities)?;
            }
        }
        Ok(self.link.order(StepperRequest::Report)?)
    }

    /// Takes the position that the motor has after it was configured.
    pub(super) fn arranged(&mut self, count: i64, now: f64) -> Result<(), FirmataStepperError> {
        if count != 0 {
            let Phase::Arranging(wait) = &mut self.phase else { return Ok(()) };
            // It is garbled, or the motor turns, or it was not configured.
            wait.doubts += 1;
            if wait.doubts > 1 {
                (wait.doubts, wait.count) = (0, 0);
            }
            return Ok(());
        }
        self.link.has_stopped();
        self.link.forget_queries();
        self.arranging_since = None;
        // Coils count from 0 with the Arduino. The rotor is pulled to the next place that belongs
        // to their first step, which is not four half steps away and so to be foreseen.
        let ahead = if self.is_held { (self.motor - self.base).rem_euclid(CYCLE) } else { 0 };
        self.forwards = ahead <= CYCLE / 2;
        self.base = self.motor - ahead + if self.forwards { 0 } else { CYCLE };
        self.stand(now);
        self.go_on(now)
    }

    /// Has the motor make its first steps, by which the coils show that they follow.
    pub(super) fn align(&mut self, now: f64) -> Result<(), FirmataStepperError> {
        self.send_pace()?;
        self.expose_coils()?;
        self.watch_switch()?;
        self.align_to(FIRST_STEPS, [self.base; 2], now)
    }

    /// Sends the motor `steps` steps from the Arduino's 0.
    pub(super) fn align_to(
        &mut self,
        steps: i64,
        range: [i64; 2],
        now: f64,
    ) -> Result<(), FirmataStepperError> {
        let to = self.base + if self.forwards { steps } else { -steps };
        let leg = self.ordered(to, range, now)?;
        self.phase = Phase::Aligning(leg);
        Ok(())
    }

    /// Sends how fast the motor turns.
    pub(super) fn send_pace(&mut self) -> Result<(), FirmataStepperError> {
        let decimal = |value| Decimal::truncated(value).unwrap_or_default();
        let speed = decimal(self.config.speed_half_steps_per_s);
        self.link.order(StepperRequest::Speed(speed))?;
        // A motor that was just configured has no ramp.
        if self.config.acceleration_half_steps_per_s2 > 0.0 {
            let acceleration = decimal(self.config.acceleration_half_steps_per_s2);
            self.link.order(StepperRequest::Acceleration(acceleration))?;
        }
        Ok(())
    }

    /// Has the Arduino report the level of the home switch.
    pub(super) fn watch_switch(&mut self) -> Result<(), FirmataStepperError> {
        if let Some(pin) = self.config.switch() {
            self.link.send(Request::PinMode { pin, mode: PinMode::PullUp })?;
            self.read_switch()?;
        }
        Ok(())
    }

    /// Has the Arduino report the level of the home switch once more.
    pub(super) fn read_switch(&mut self) -> Result<(), FirmataStepperError> {
        if let Some(pin) = self.config.switch() {
            self.link.send(Request::ReportDigital { port: pin / 8, on: true })?;
        }
        Ok(())
    }

    /// Returns the error that keeps the antenna from turning, if there is one.
    pub(super) fn hindrance(&self, now: f64) -> Result<(), FirmataStepperError> {
        let patience = self.config.answer_timeout_s;
        let overdue = self.arranging_since.is_some_and(|since| now >= since + patience);
        match self.phase {
            // A firmware that hangs may begin again and again.
            Phase::Greeting(_) | Phase::Arranging(_) if overdue && self.firmware.is_some() => {
                let firmware = self.firmware.clone().unwrap_or_default();
                let why = match self.has_steppers {
                    Some(false) => MissingStepper::NotInSketch,
                    Some(true) => MissingStepper::Silent,
                    None => MissingStepper::Hung,
                };
                Err(FirmataStepperError::NoStepper { firmware, why })
            }
            Phase::Greeting(wait) if now >= wait.since + patience => {
                let seconds = now - wait.since;
                let bytes = self.link.bytes();
                Err(FirmataStepperError::NoAnswer { seconds, bytes })
            }
            Phase::Homing(_) => Ok(()),
            _ => match (self.coil_failure, &self.home_failure, self.lost) {
                (Some(failure), ..) => Err(FirmataStepperError::Coils { failure }),
                (None, Some(failure), _) => Err(failure.error()),
                // With a switch it will be homed.
                (None, None, Some(why)) if self.config.switch().is_none() => {
                    Err(FirmataStepperError::PositionLost { why })
                }
                _ => Ok(()),
            },
        }
    }
}
