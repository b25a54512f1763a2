//! The stepper's driver against an emulated Firmata Arduino.

mod damaged;
mod faults;
mod homing;
mod one_byte;
mod rig;
mod turning;
mod whole_turn;
