//! Firmata with the stepper messages of ConfigurableFirmata's AccelStepper: how an Arduino turns
//! the antenna. Sources: the [protocol](https://github.com/firmata/protocol) 2.6 and its
//! `accelStepperFirmata.md`.
//!
//! A host sends [`Request`]s and a device [`Reply`]s; [`Decoder`] reads either from a stream of
//! bytes.

mod decimal;
mod decoder;
mod error;
mod interface;
mod message;
mod reply;
mod request;
mod seven_bit;
mod stepper;

pub use decimal::Decimal;
pub use decoder::Decoder;
pub use error::FirmataError;
pub use interface::{StepperInterface, Wiring};
pub use message::Message;
pub use reply::{PinCapability, Reply};
pub use request::{PinMode, Request};
pub use stepper::StepperRequest;
