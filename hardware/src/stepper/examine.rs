use foxhunt_core::Clock;
use foxhunt_wire::ByteStream;

use super::{CoilFailure, FirmataStepper, FirmataStepperError, MissingStepper, Phase, Side};
use crate::Finding;

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
