use super::{FirmataError, error::at_most};

/// Wiring of a stepper to its device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StepperInterface {
    /// Its pins.
    pub wiring: Wiring,
    /// A step is 1/2ⁿ of a whole one: 0 for whole steps, 1 for half steps.
    pub divisor_log2: u8,
    /// The pin that switches it on.
    pub enable_pin: Option<u8>,
    /// Inverted pins: bits 0 to 3 are the pins of the wiring in their order, bit 4 is the enable
    /// pin. The real firmware reads this even where it was not sent, so it is always sent.
    pub inverted: u8,
}

/// The pins of a stepper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wiring {
    /// A driver that counts pulses.
    Driver {
        /// A pulse is a step.
        step_pin: u8,
        /// Its level is the direction.
        direction_pin: u8,
    },
    /// Two wires.
    TwoWire([u8; 2]),
    /// Three wires.
    ThreeWire([u8; 3]),
    /// Four wires. The half steps energise the pins in the order 1, 1+3, 3, 3+2, 2, 2+4, 4, 4+1:
    /// the inputs of a ULN2003 stand here as IN1, IN3, IN2, IN4.
    FourWire([u8; 4]),
}

impl StepperInterface {
    pub(super) fn encode(&self, into: &mut Vec<u8>) -> Result<(), FirmataError> {
        let (wires, pins): (u8, &[u8]) = match &self.wiring {
            Wiring::Driver { step_pin, direction_pin } => (1, &[*step_pin, *direction_pin]),
            Wiring::TwoWire(pins) => (2, pins),
            Wiring::ThreeWire(pins) => (3, pins),
            Wiring::FourWire(pins) => (4, pins),
        };
        let divisor = at_most("divisor_log2", self.divisor_log2, 7)?;
        into.push(wires << 4 | divisor << 1 | u8::from(self.enable_pin.is_some()));
        for pin in pins.iter().chain(&self.enable_pin) {
            into.push(at_most("pin", *pin, 0x7F)?);
        }
        into.push(at_most("inverted", self.inverted, 0x1F)?);
        Ok(())
    }

    pub(super) fn decode(bytes: &[u8]) -> Option<Self> {
        let (interface, rest) = bytes.split_first()?;
        let (wiring, rest) = match interface >> 4 {
            1 => {
                let ([step_pin, direction_pin], rest) = rest.split_first_chunk()?;
                (Wiring::Driver { step_pin: *step_pin, direction_pin: *direction_pin }, rest)
            }
            2 => rest.split_first_chunk().map(|(pins, rest)| (Wiring::TwoWire(*pins), rest))?,
            3 => rest.split_first_chunk().map(|(pins, rest)| (Wiring::ThreeWire(*pins), rest))?,
            4 => rest.split_first_chunk().map(|(pins, rest)| (Wiring::FourWire(*pins), rest))?,
            _ => return None,
        };
        let (enable_pin, rest) = if interface & 1 == 1 {
            rest.split_first().map(|(pin, rest)| (Some(*pin), rest))?
        } else {
            (None, rest)
        };
        let inverted = match rest {
            [] => 0,
            [inverted @ 0..=0x1F] => *inverted,
            _ => return None,
        };
        Some(Self { wiring, divisor_log2: interface >> 1 & 7, enable_pin, inverted })
    }
}
