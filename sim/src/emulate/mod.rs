//! The devices of a world as the bytes that they speak, over any [`ByteStream`](foxhunt_wire::ByteStream).

mod emulator;

pub use emulator::Emulator;
