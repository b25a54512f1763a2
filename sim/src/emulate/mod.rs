//! The devices of a world as the bytes that they speak, over any
//! [`ByteStream`](foxhunt_wire::ByteStream).

mod ardrone;
mod autopilot;
mod cable;
mod emulator;
mod gnss;
mod receivers;
mod stepper;
mod xbee;

pub use ardrone::EmulatedArDrone;
pub use autopilot::{
    AutopilotConfig, AutopilotFaults, EmulatedAutopilot, FailsafeOrder, GpsStep, PilotOrder,
};
pub use cable::{CableFaults, Cabled, Port};
pub use emulator::Emulator;
pub use gnss::{EmulatedGnss, EmulatedGnssConfig, EmulatedGnssKind};
pub use receivers::{
    EmulatedDongle, EmulatedKraken, EmulatedKrakenConfig, EmulatedRtlTcp, EmulatedRtlTcpConfig,
    InterfererConfig, PlayedPulse,
};
pub use stepper::{EmulatedStepper, EmulatedStepperConfig, EmulatedSwitch};
pub use xbee::{EmulatedXbee, EmulatedXbeeConfig, xbee_address};
