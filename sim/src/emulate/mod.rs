//! The devices of a world as the bytes that they speak, over any [`ByteStream`](foxhunt_wire::ByteStream).

mod cable;
mod emulator;
mod gnss;
mod receivers;
mod xbee;

pub use cable::{CableFaults, Cabled};
pub use emulator::Emulator;
pub use gnss::{EmulatedGnss, EmulatedGnssConfig, EmulatedGnssKind};
pub use receivers::{EmulatedKraken, EmulatedKrakenConfig, EmulatedRtlTcp, EmulatedRtlTcpConfig};
pub use xbee::{EmulatedXbee, EmulatedXbeeConfig, xbee_address};
