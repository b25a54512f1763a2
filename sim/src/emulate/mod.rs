//! The devices of a world as the bytes that they speak, over any [`ByteStream`](foxhunt_wire::ByteStream).

mod emulator;
mod stepper;

pub use emulator::Emulator;
pub use stepper::{EmulatedStepper, EmulatedStepperConfig, EmulatedSwitch};
