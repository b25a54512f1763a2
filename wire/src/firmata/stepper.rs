//! Requests of a stepper: its wiring, its moves, and the decimal numbers of its pace.

use super::{FirmataError, REPORT, STEPPER, at_most, decode_i32, encode_i32};

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

/// One more than the largest significand.
const LIMIT: f64 = 8_388_608.0;

/// The exponent is sent with this added.
const BIAS: i8 = 11;

/// The largest exponent that has room in 4 bits.
const LARGEST: i32 = 4;

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

/// Wiring of a stepper to its device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StepperInterface {
    /// Pins of the stepper.
    pub wiring: Wiring,
    /// A step is 1/2ⁿ of a whole one: 0 for whole steps, 1 for half steps.
    pub divisor_log2: u8,
    /// The pin that switches it on.
    pub enable_pin: Option<u8>,
    /// Inverted pins: bits 0 to 3 are the pins of the wiring in their order, bit 4 is the enable
    /// pin. The real firmware reads this even if it was not sent, so it is always sent.
    pub inverted: u8,
}

/// The pins of a stepper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wiring {
    /// A driver that counts pulses.
    Driver {
        /// A pulse is a step.
        step_pin: u8,
        /// Pin whose level is the direction.
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
    fn encode(&self, into: &mut Vec<u8>) -> Result<(), FirmataError> {
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

    fn decode(bytes: &[u8]) -> Option<Self> {
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

/// A number as the stepper messages carry it: a decimal significand of 23 bits, and an exponent of
/// 10 from −11 to 4.
///
/// Numbers are truncated to fit, as the protocol demands and other hosts do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Decimal {
    negative: bool,
    significand: u32,
    exponent: i8,
}

impl Decimal {
    /// The largest number: `8_388_607 · 10⁴`.
    pub const MAX: Self = Self { negative: false, significand: 8_388_607, exponent: 4 };

    /// Returns the number of at most as many digits as fit whose magnitude is next below that of
    /// `value`; `None` if `value` is not finite or more than [`MAX`](Self::MAX). Magnitudes below
    /// 10⁻¹¹ become 0.
    ///
    /// The digits equal firmata-io's. A significand of exactly 2²³, which that library sends as
    /// 0, loses a digit here, and exponents that it wraps are kept in their range.
    #[must_use]
    #[expect(
        clippy::cast_possible_truncation,
        reason = "whole numbers below 2²³, and log10 of f64"
    )]
    #[expect(clippy::cast_sign_loss, reason = "a magnitude")]
    pub fn truncated(value: f64) -> Option<Self> {
        if !value.is_finite() || value.abs() > Self::MAX.to_f64() {
            return None;
        }
        let mut digits = value.abs();
        if digits < 1e-11 {
            return Some(Self::default());
        }
        let mut exponent = libm::log10(digits).floor() as i32;
        digits /= 10_f64.powi(exponent);
        while digits.fract() != 0.0 && digits < LIMIT || exponent > LARGEST {
            exponent -= 1;
            digits *= 10.0;
        }
        while digits >= LIMIT || exponent < -i32::from(BIAS) {
            exponent += 1;
            digits /= 10.0;
        }
        Some(Self { negative: value < 0.0, significand: digits as u32, exponent: exponent as i8 })
    }

    /// Converts it to `f64`.
    #[must_use]
    pub fn to_f64(self) -> f64 {
        let magnitude = f64::from(self.significand);
        // Division by an exact power is rounded once; multiplication by 10⁻ⁿ would be twice.
        let power = 10_f64.powi(i32::from(self.exponent).abs());
        let magnitude = if self.exponent < 0 { magnitude / power } else { magnitude * power };
        if self.negative { -magnitude } else { magnitude }
    }

    fn encode(self) -> [u8; 4] {
        let [low, middle, high] = [0, 7, 14].map(|bit| seven(self.significand >> bit));
        let exponent = u8::try_from(self.exponent + BIAS).unwrap_or(0);
        let sign = u8::from(self.negative) << 6;
        [low, middle, high, seven(self.significand >> 21) | exponent << 2 | sign]
    }

    /// The number of four bytes as they are sent.
    #[must_use]
    pub fn decode([low, middle, high, last]: [u8; 4]) -> Self {
        let significand = u32::from(low)
            | u32::from(middle) << 7
            | u32::from(high) << 14
            | u32::from(last & 0x03) << 21;
        let exponent = (last >> 2 & 0x0F).cast_signed() - BIAS;
        Self { negative: last & 0x40 != 0, significand, exponent }
    }
}

fn seven(bits: u32) -> u8 {
    u8::try_from(bits & 0x7F).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_ends_of_the_range_are_kept() {
        let made = |value| Decimal::truncated(value).map(Decimal::to_f64);
        assert_eq!(made(0.0), Some(0.0));
        assert_eq!(Decimal::default().encode()[..3], [0, 0, 0]);
        assert_eq!(made(8_388_608.0), Some(8_388_600.0), "2²³ loses a digit, not its meaning");
        assert_eq!(made(1e6), Some(1e6));
        assert_eq!(made(8.388_607e10), Some(8.388_607e10));
        assert_eq!(made(-1.234_567_89e-8), Some(-1.234e-8));
        assert_eq!(made(1e-12), Some(0.0));
        assert_eq!([made(f64::NAN), made(f64::INFINITY), made(8.4e10)], [None; 3]);
    }

    proptest! {
        #[test]
        fn numbers_are_truncated_by_less_than_a_digit(value in -1e5..1e5f64) {
            let made = Decimal::truncated(value).expect("in range");
            let step = (value.abs() / 838_860.0).max(1e-11);
            // The division that shifts the digits rounds.
            let rounding = value.abs() * 1e-15;
            prop_assert!(made.to_f64().abs() <= value.abs() + rounding);
            prop_assert!((made.to_f64() - value).abs() <= step, "{value} made {made:?}");
            prop_assert_eq!(Decimal::decode(made.encode()), made);
        }

        #[test]
        fn any_four_bytes_are_a_number(bytes in prop::array::uniform4(0u8..0x80)) {
            prop_assert_eq!(Decimal::decode(bytes).encode(), bytes);
        }
    }
}
