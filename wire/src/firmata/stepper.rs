use super::{
    Decimal, FirmataError, StepperInterface,
    error::at_most,
    message::{REPORT, STEPPER},
    seven_bit::{decode_i32, encode_i32},
};

/// A host's message to a stepper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepperRequest {
    /// Sets it up, standing at 0. To be sent before anything else.
    Configure(StepperInterface),
    /// Makes its present position 0.
    Zero,
    /// Moves by a number of steps from its present position.
    Step(i32),
    /// Moves to a position in steps. The real firmware loses the bits above 2²⁸.
    To(i32),
    /// Switches the current on or off.
    Enable(bool),
    /// Stops; answered by the message that a move is complete.
    Stop,
    /// Requests its position.
    Report,
    /// Sets its acceleration, in steps/s²; 0 is at once.
    Acceleration(Decimal),
    /// Sets its speed, in steps/s. The real firmware starts at 1.
    Speed(Decimal),
}

/// The largest number of a stepper.
const LAST_DEVICE: u8 = 9;

const CONFIGURE: u8 = 0x00;
const ZERO: u8 = 0x01;
const STEP: u8 = 0x02;
const TO: u8 = 0x03;
const ENABLE: u8 = 0x04;
const STOP: u8 = 0x05;
const ACCELERATION: u8 = 0x08;
const SPEED: u8 = 0x09;

impl StepperRequest {
    /// The payload of its message.
    pub(super) fn payload(&self, device: u8) -> Result<Vec<u8>, FirmataError> {
        let device = at_most("device", device, LAST_DEVICE)?;
        let mut payload = vec![STEPPER, self.command(), device];
        match self {
            Self::Configure(interface) => interface.encode(&mut payload)?,
            Self::Step(steps) => payload.extend(encode_i32("steps", *steps)?),
            Self::To(position) => payload.extend(encode_i32("position", *position)?),
            Self::Enable(on) => payload.push((*on).into()),
            Self::Acceleration(decimal) | Self::Speed(decimal) => payload.extend(decimal.encode()),
            Self::Zero | Self::Stop | Self::Report => {}
        }
        Ok(payload)
    }

    fn command(&self) -> u8 {
        match self {
            Self::Configure(_) => CONFIGURE,
            Self::Zero => ZERO,
            Self::Step(_) => STEP,
            Self::To(_) => TO,
            Self::Enable(_) => ENABLE,
            Self::Stop => STOP,
            Self::Report => REPORT,
            Self::Acceleration(_) => ACCELERATION,
            Self::Speed(_) => SPEED,
        }
    }

    /// The stepper and its request, from the bytes that follow 62.
    pub(super) fn decode(bytes: &[u8]) -> Option<(u8, Self)> {
        let (&[command, device], rest) = bytes.split_first_chunk()?;
        if device > LAST_DEVICE {
            return None;
        }
        let whole = || decode_i32(rest.try_into().ok()?);
        let decimal = || Some(Decimal::decode(rest.try_into().ok()?));
        let request = match (command, rest) {
            (CONFIGURE, rest) => Self::Configure(StepperInterface::decode(rest)?),
            (ZERO, []) => Self::Zero,
            (STEP, _) => Self::Step(whole()?),
            (TO, _) => Self::To(whole()?),
            (ENABLE, [on]) => Self::Enable(*on != 0),
            (STOP, []) => Self::Stop,
            (REPORT, []) => Self::Report,
            (ACCELERATION, _) => Self::Acceleration(decimal()?),
            (SPEED, _) => Self::Speed(decimal()?),
            _ => return None,
        };
        Some((device, request))
    }
}
