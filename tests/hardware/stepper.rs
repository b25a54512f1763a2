//! The stepper's driver against an emulated Firmata Arduino.

mod faults;
mod homing;
mod rig;
mod turning;
mod whole_turn;
