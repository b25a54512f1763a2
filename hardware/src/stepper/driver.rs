//! The stepper as a rotator: its orders from outside, and the replies of its Arduino.

use foxhunt_core::{Clock, Rotator, parameter::FieldError};
use foxhunt_wire::{
    ByteStream,
    firmata::{PinMode, Reply},
};

use super::{
    BeyondCable, FirmataConfig, FirmataStepper, FirmataStepperError, Levels, Link, LostPosition,
    Next, Phase, Side, Stage, Wait,
};

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
