//! The stepper as a rotator: its orders from outside, the replies of its Arduino, and its
//! examination.

use foxhunt_core::{Clock, Rotator, parameter::FieldError};
use foxhunt_wire::{
    ByteStream,
    firmata::{PinMode, Reply},
};

use super::{
    BeyondCable, CoilFailure, FirmataConfig, FirmataStepper, FirmataStepperError, Levels, Link,
    LostPosition, MissingStepper, Next, Phase, Side, Stage, Wait,
};
use crate::Finding;

impl<S: ByteStream, C: Clock> FirmataStepper<S, C> {
    /// The stepper at the other end of `stream`. It is set up by the first calls of its methods.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names the first field that it cannot have.
    pub fn new(config: FirmataConfig, stream: S, clock: C) -> Result<Self, FieldError> {
        config.check()?;
        let gearing = config.gearing();
        let now = clock.now();
        let lost = config.switch().map(|_| LostPosition::NotHomed);
        let link = Link::new(stream, config.device);
        let mut stepper = Self {
            config,
            gearing,
            link,
            clock,
            phase: Phase::Greeting(Wait::new(now)),
            base: 0,
            motor: 0,
            side: Side::Unknown,
            lost,
            home_failure: None,
            wanted: None,
            firmware: None,
            switch_closed: None,
            levels: Levels::default(),
            aligned: false,
            is_held: false,
            forwards: true,
            misaligned: 0,
            coil_failure: None,
            tries: 0,
            arranging_since: None,
            has_steppers: None,
            booting: false,
            broken: false,
        };
        stepper.motor = stepper.home();
        Ok(stepper)
    }

    /// Returns the configuration.
    #[must_use]
    pub fn config(&self) -> &FirmataConfig {
        &self.config
    }

    /// Returns the firmware's own name with the version, once it has reported them.
    #[must_use]
    pub fn firmware(&self) -> Option<&str> {
        self.firmware.as_deref()
    }

    /// Declares that the antenna looks where [`Homing`](super::Homing) has it, now: somebody has
    /// turned it there by hand. An order that it has not followed yet is forgotten.
    ///
    /// # Errors
    ///
    /// [`FirmataStepperError::Busy`] while it turns; any error of the link.
    pub fn zero(&mut self) -> Result<(), FirmataStepperError> {
        let now = self.clock.now();
        let home = self.home();
        match self.phase {
            Phase::Standing { .. } | Phase::Greeting(_) | Phase::Arranging(_) => {}
            _ => return Err(FirmataStepperError::Busy),
        }
        // The Arduino goes on counting from where it does.
        self.base += home - self.motor;
        (self.motor, self.side) = (home, Side::Unknown);
        let was_lost = self.lost.is_some() || self.coil_failure.is_some();
        (self.lost, self.home_failure, self.wanted) = (None, None, None);
        self.forgive();
        if was_lost && let Phase::Standing { .. } = self.phase {
            self.is_held = false;
            self.rearrange(now)?;
        }
        self.advance()
    }

    /// Gives the coils another chance.
    pub(super) fn forgive(&mut self) {
        (self.coil_failure, self.misaligned, self.tries) = (None, 0, 0);
    }

    /// Unwinds the cable: turns the antenna to the same direction within half a turn of 0.
    ///
    /// # Errors
    ///
    /// As for [`turn_to`](Rotator::turn_to).
    pub fn unwind(&mut self) -> Result<(), FirmataStepperError> {
        let angle = self.angle(self.wanted.unwrap_or_else(|| self.antenna()));
        self.turn_to(foxhunt_core::angle::wrap(angle))
    }

    /// Takes what has come, and does what is due.
    pub(super) fn advance(&mut self) -> Result<(), FirmataStepperError> {
        let outcome = self.served();
        if matches!(outcome, Err(FirmataStepperError::Link(_))) {
            self.broken = true;
        }
        outcome
    }

    fn served(&mut self) -> Result<(), FirmataStepperError> {
        let now = self.clock.now();
        let replies = self.link.receive()?;
        let was_broken = std::mem::take(&mut self.broken);
        if self.link.was_reopened() {
            self.was_reset(now);
        } else if was_broken {
            self.check(now)?;
        }
        for reply in replies {
            self.take_reply(&reply, now)?;
        }
        self.act(now)
    }

    fn take_reply(&mut self, reply: &Reply, now: f64) -> Result<(), FirmataStepperError> {
        // Nothing here requests the version: an Arduino that sends it, and its firmware next, has
        // just begun.
        let booted = std::mem::replace(&mut self.booting, matches!(reply, Reply::Version { .. }));
        match reply {
            Reply::Firmware { major, minor, name } => {
                if booted {
                    self.link.has_stopped();
                    self.was_reset(now);
                }
                if let Phase::Greeting(_) = self.phase {
                    self.firmware = Some(format!("{name} {major}.{minor}"));
                    self.phase = Phase::Arranging(Wait::new(now).every(self.config.ask_s()));
                    self.arranging_since.get_or_insert(now);
                }
            }
            Reply::Capabilities(pins) => {
                let stepper = PinMode::Stepper.code();
                let mut modes = pins.iter().flatten().map(|can| can.mode);
                self.has_steppers = Some(modes.any(|mode| mode == stepper));
            }
            Reply::Digital { port, levels } => {
                if let Some(of) = self.levels.get_mut(usize::from(*port)) {
                    *of = Some(*levels);
                }
                self.confirm_levels(now)?;
                return self.switched(*port, *levels, now);
            }
            Reply::Position { device, position } if *device == self.config.device => {
                self.link.was_answered();
                return self.located(*position, false, now);
            }
            Reply::Done { device, position } if *device == self.config.device => {
                return self.located(*position, true, now);
            }
            _ => {}
        }
        Ok(())
    }

    /// Takes the motor's reported position.
    fn located(&mut self, count: i32, done: bool, now: f64) -> Result<(), FirmataStepperError> {
        let count = i64::from(count);
        let at = self.base + count;
        let rests = self.rests();
        let (leg, seen) = match &mut self.phase {
            Phase::Arranging(_) if !done => return self.arranged(count, now),
            Phase::Confirming(_) if !done => return self.confirm_position(at, now),
            Phase::Checking(_) | Phase::Standing { .. } if !done => {
                // One report may be garbled.
                let checked = matches!(self.phase, Phase::Checking(_));
                return if at != rests || checked {
                    self.confirm(rests, Next::Stand(self.side), now)
                } else {
                    Ok(())
                };
            }
            Phase::Aligning(leg)
            | Phase::Moving { leg, .. }
            | Phase::Homing(
                Stage::Seeking(leg) | Stage::Stopping(leg, _) | Stage::Leaving(leg, _),
            ) => {
                let seen = leg.see(at, done, &self.config, now);
                (*leg, seen)
            }
            _ => return Ok(()),
        };
        self.seen(seen, &leg, at, now)
    }

    /// Returns the steps at which the Arduino counts that the motor stands. Before its first step
    /// the rotor is not where the coils would pull it.
    fn rests(&self) -> i64 {
        if self.aligned { self.motor } else { self.base }
    }

    /// Returns the antenna's direction, in steps.
    pub(super) fn antenna(&self) -> i64 {
        if self.side == Side::Above { self.motor + self.play() } else { self.motor }
    }

    /// The angle of a step, from the nose.
    pub(super) fn angle(&self, steps: i64) -> f64 {
        self.gearing.angle(if self.config.clockwise { -steps } else { steps })
    }

    /// The step next to an angle from the nose.
    fn steps(&self, angle: f64) -> Option<i64> {
        self.gearing.steps(if self.config.clockwise { -angle } else { angle })
    }

    /// Returns the antenna's direction at home, in steps.
    pub(super) fn home(&self) -> i64 {
        self.steps(self.config.home_angle()).unwrap_or(0)
    }
}

impl<S: ByteStream, C: Clock> Rotator for FirmataStepper<S, C> {
    type Error = FirmataStepperError;

    /// Takes an order, to be followed once the stepper is set up and homed.
    ///
    /// # Errors
    ///
    /// [`FirmataStepperError::Angle`] and [`FirmataStepperError::Cable`] for an order that cannot
    /// be followed; the older one stays then. Whatever keeps the antenna from turning.
    fn turn_to(&mut self, angle: f64) -> Result<(), FirmataStepperError> {
        let turns = angle / std::f64::consts::TAU;
        let most = self.config.cable_turns;
        // What is rounding at the limit is not beyond it.
        let angle = match self.config.beyond_cable {
            _ if turns.abs() <= most + 1e-9 => angle,
            BeyondCable::Unwind if turns.is_finite() => {
                angle - turns.round() * std::f64::consts::TAU
            }
            BeyondCable::Refuse if turns.is_finite() => {
                return Err(FirmataStepperError::Cable { turns, most });
            }
            _ => angle,
        };
        let target = self.steps(angle).ok_or(FirmataStepperError::Angle { angle })?;
        self.advance()?;
        let now = self.clock.now();
        self.hindrance(now)?;
        self.reachable(target)?;
        (self.wanted, self.tries) = (Some(target), 0);
        let outcome = match self.phase {
            // An open query may have been garbled into an order.
            Phase::Standing { .. } if self.link.unanswered() > 0 => {
                self.confirm(self.rests(), Next::Stand(self.side), now)
            }
            Phase::Standing { .. } => self.go_on(now),
            Phase::Moving { .. } => self.turn_aside(target, now),
            _ => Ok(()),
        };
        self.broken |= outcome.is_err();
        outcome
    }

    fn poll(&mut self) -> Result<Option<f64>, FirmataStepperError> {
        self.advance()?;
        let now = self.clock.now();
        self.hindrance(now)?;
        let stands = match self.phase {
            // A sum of steps of time may fall short by its rounding.
            Phase::Standing { settled, .. } => self.wanted.is_none() && now >= settled - 1e-9,
            _ => false,
        };
        Ok(stands.then(|| self.angle(self.antenna())))
    }
}

/// Steps by which the motor is turned to see that it turns: 5.6° of a 28BYJ-48, one turn of its
/// rotor.
const SHOWN_STEPS: i32 = 64;
/// The longest that anything is waited for, in seconds: to be homed, at slow speed.
const PATIENCE_S: f64 = 120.0;
/// The most pauses, should the clock stand still.
const MOST_PAUSES: u32 = 1_000_000;

impl<S: ByteStream, C: Clock> FirmataStepper<S, C> {
    /// Looks at the stepper, turns it a little forth and back, and returns what was found. `pause`
    /// is called while it waits.
    pub fn examine(&mut self, pause: &mut dyn FnMut()) -> Vec<Finding> {
        let mut findings = Vec::new();
        let ready = self.stands(pause);
        if let Some(firmware) = &self.firmware {
            findings.push(Finding::good("firmware", firmware));
        }
        if let Err(error) = ready {
            let remedy = remedy(&error);
            findings.push(Finding::bad("stepper", error, remedy));
        } else {
            findings.push(self.shown(pause));
            findings.push(self.place());
        }
        if let Some(closed) = self.switch_closed {
            let text = if closed { "closed" } else { "open" };
            findings.push(Finding::good("home switch", text));
        }
        let rejected = self.link.rejected();
        if rejected > 0 {
            let text = format!("{rejected} messages were unreadable");
            let remedy = "use a shorter USB cable, away from the motor's wires, and 57600 baud";
            findings.push(Finding::bad("link", text, remedy));
        }
        findings
    }

    /// Waits until it stands, whether it is known where or not.
    fn stands(&mut self, pause: &mut dyn FnMut()) -> Result<(), FirmataStepperError> {
        let begin = self.clock.now();
        for _ in 0..MOST_PAUSES {
            let served = self.advance();
            let now = self.clock.now();
            if let Phase::Standing { settled, .. } = self.phase
                && now >= settled
                && served.is_ok()
            {
                break;
            }
            let waited = now - begin;
            match served.and_then(|()| self.hindrance(now)) {
                // A cable may be put back, and an Arduino begin.
                Err(error) if waited >= self.config.answer_timeout_s => return Err(error),
                _ if waited >= PATIENCE_S => return Err(FirmataStepperError::Busy),
                _ => pause(),
            }
        }
        Ok(())
    }

    /// Turns the motor forth and back.
    fn shown(&mut self, pause: &mut dyn FnMut()) -> Finding {
        let before = self.motor;
        let mut to = |stepper: &mut Self, to: i64| {
            if !stepper.aligned {
                stepper.align(stepper.clock.now())?;
                stepper.stands(pause)?;
            }
            stepper.set_off(to, None, Side::Unknown, stepper.clock.now())?;
            stepper.stands(pause)?;
            Ok::<_, FirmataStepperError>(stepper.motor)
        };
        let outcome = to(self, before + i64::from(SHOWN_STEPS))
            .and_then(|there| Ok((there, to(self, before)?)));
        match outcome {
            Ok((there, back)) => {
                let degrees = 360.0 / self.gearing.per_turn() * f64::from(SHOWN_STEPS);
                Finding::good(
                    "motor",
                    format!(
                        "stood at {before} half steps, went to {there} and back to {back}: the \
                         antenna should have turned visibly by {degrees:.1}°"
                    ),
                )
            }
            Err(error) => {
                let remedy = remedy(&error);
                Finding::bad("motor", error, remedy)
            }
        }
    }

    /// Returns the finding about the antenna's direction.
    fn place(&self) -> Finding {
        let home = self.config.home_angle().to_degrees();
        match self.hindrance(self.clock.now()) {
            Ok(()) => {
                let degrees = self.angle(self.antenna()).to_degrees();
                Finding::good("position", format!("{degrees:.1}° counter-clockwise from the nose"))
            }
            Err(error) => {
                let by_hand = format!("turn the antenna by hand to {home:.1}° and start again");
                let remedy = if self.config.switch().is_some() { remedy(&error) } else { &by_hand };
                Finding::bad("position", error, remedy)
            }
        }
    }
}

/// Returns the remedy for an error.
fn remedy(error: &FirmataStepperError) -> &'static str {
    match error {
        FirmataStepperError::Link(_) => {
            "plug the Arduino in, check the port's name, and that you may use it (group dialout)"
        }
        FirmataStepperError::NoAnswer { bytes: 1.., .. } => {
            "set Firmata.begin(57600) in the sketch, or write 115200 after the port's name"
        }
        FirmataStepperError::NoAnswer { .. } => {
            "check that it is the Arduino's port, and flash hardware/firmware"
        }
        FirmataStepperError::NoStepper { why: MissingStepper::NotInSketch, .. } => {
            "flash hardware/firmware, or take the comment off ENABLE_ACCELSTEPPER in the sketch of \
             ConfigurableFirmata"
        }
        FirmataStepperError::NoStepper { why: MissingStepper::Hung, .. } => {
            "flash hardware/firmware, or leave ENABLE_DIGITAL and ENABLE_ACCELSTEPPER alone in the \
             sketch of ConfigurableFirmata: a Nano has no room for more"
        }
        FirmataStepperError::NoStepper { .. } => {
            "flash hardware/firmware, or ConfigurableFirmata with AccelStepper"
        }
        FirmataStepperError::Coils { failure: CoilFailure::Silent } => {
            "flash the present hardware/firmware, or leave ENABLE_DIGITAL on in the sketch of \
             ConfigurableFirmata"
        }
        FirmataStepperError::Coils { .. } => {
            "flash the present hardware/firmware, and see that nothing else uses the motor's pins"
        }

        FirmataStepperError::NoHome { .. } => {
            "check the switch, its pin, and that the antenna closes it once a turn"
        }
        FirmataStepperError::MoveTimeout { .. } => "check the USB cable and the speed",
        _ => "wait until the antenna stands, and start again",
    }
}
