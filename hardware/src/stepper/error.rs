use std::{fmt, io};

/// Error of the stepper: why the antenna does not turn.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FirmataStepperError {
    /// The link to the Arduino.
    #[error("the link to the stepper: {0}")]
    Link(#[from] io::Error),
    /// No firmware answers.
    #[error(
        "no Firmata answers for {seconds:.1} s: {}",
        if *bytes == 0 {
            "is it the right port, at 57600 baud?".to_owned()
        } else {
            format!(
                "{bytes} bytes came at another rate, or from another device; the sketch of \
                 ConfigurableFirmata begins at 115200 baud"
            )
        }
    )]
    NoAnswer {
        /// Time for which it was queried.
        seconds: f64,
        /// Number of bytes that came.
        bytes: u64,
    },
    /// There is Firmata, and it knows no steppers.
    #[error("the firmware {firmware:?} does not answer messages of a stepper: {why}")]
    NoStepper {
        /// Name that the firmware reports.
        firmware: String,
        /// Reason, as far as it is known.
        why: MissingStepper,
    },
    /// The coils do not follow.
    #[error("the pins of the coils {failure}")]
    Coils {
        /// Behaviour of the pins instead.
        failure: CoilFailure,
    },
    /// Nobody knows where the antenna looks.
    #[error(
        "nobody knows where the antenna looks, since {why}: home it, or turn it by hand to where \
         it begins and declare that"
    )]
    PositionLost {
        /// Since when.
        why: LostPosition,
    },
    /// A move did not end.
    #[error("a move of {steps} steps did not end within {seconds:.1} s")]
    MoveTimeout {
        /// Length of the move.
        steps: u64,
        /// Time for which its end was awaited.
        seconds: f64,
    },
    /// An order to no angle.
    #[error(
        "the ordered antenna angle is {angle} rad; it must be finite and within a million turns"
    )]
    Angle {
        /// The order in radians.
        angle: f64,
    },
    /// The move is longer than the Arduino can count.
    #[error("a move of {steps} steps is more than the 2²⁷ that the stepper counts at once")]
    TooFar {
        /// Length of the move.
        steps: u64,
    },
    /// The cable is too short.
    #[error("{turns:.2} turns are more than the {most} that the cable has to either side")]
    Cable {
        /// The order in turns.
        turns: f64,
        /// Turns that the cable allows to either side.
        most: f64,
    },
    /// It is to be homed and has no switch.
    #[error("there is no home switch in the configuration")]
    NoSwitch,
    /// It was turned and the switch did not close, or it did not open again.
    #[error("the home switch at pin {pin} did not {expected} within {turns} turns")]
    NoHome {
        /// Configured pin of the switch.
        pin: u8,
        /// Action that the switch did not do.
        expected: &'static str,
        /// Turns that the antenna made.
        turns: f64,
    },
    /// It turns, or is being set up.
    #[error("the antenna does not stand still yet")]
    Busy,
}

/// Reason why nobody knows the antenna's direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum LostPosition {
    /// It has not been homed.
    NotHomed,
    /// The Arduino was reset, or its cable was pulled.
    Reset,
    /// The Arduino fell silent while it turned.
    Silent,
    /// The reported position is off the ordered move: an order was garbled.
    Astray,
    /// The device's count was set to 0, which was not ordered.
    Zeroed,
    /// A move ended sooner than the motor turns.
    TooFast,
    /// The coils do not have the levels of the reported position.
    Coils,
}

/// Known reasons why no stepper answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum MissingStepper {
    /// The firmware lists no pin that a stepper could have.
    NotInSketch,
    /// The firmware fell silent when the stepper was configured.
    Hung,
    /// The firmware lists pins for steppers.
    Silent,
}

impl fmt::Display for MissingStepper {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotInSketch => "AccelStepper is not in its sketch",
            Self::Hung => "it hangs when the stepper is configured, for want of memory",
            Self::Silent => "is the configured pin one that it leaves alone?",
        })
    }
}

/// Behaviour of the coils' pins instead of following.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum CoilFailure {
    /// The pins' levels were not reported.
    Silent,
    /// They did not have the levels of the motor's first step.
    Wrong,
}

impl fmt::Display for CoilFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Silent => "did not report the motor's first step",
            Self::Wrong => "did not have the levels of the motor's first step",
        })
    }
}

impl fmt::Display for LostPosition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotHomed => "it has not been homed",
            Self::Reset => "the Arduino was reset",
            Self::Silent => "the Arduino fell silent while it turned",
            Self::Astray => "the motor was reported where it was not sent",
            Self::Zeroed => "the motor's count was set to 0 without an order",
            Self::TooFast => "a move ended sooner than the motor turns",
            Self::Coils => "the coils do not have the levels of the reported position",
        })
    }
}

impl HomeFailure {
    pub(super) fn error(&self) -> FirmataStepperError {
        let Self { pin, expected, turns } = *self;
        FirmataStepperError::NoHome { pin, expected, turns }
    }
}

/// Reason why the antenna was not homed.
#[derive(Clone, Copy, Debug)]
pub(super) struct HomeFailure {
    pub pin: u8,
    pub expected: &'static str,
    pub turns: f64,
}
