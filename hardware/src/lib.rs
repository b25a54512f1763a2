//! Drivers that implement the device traits of `foxhunt_core`, one feature each.
//!
//! There are none yet. What a driver has to implement is `Radio`, `Rotator` and `Vehicle`, or a
//! whole `PatternSource`; the simulated devices of `foxhunt-sim` show how each behaves.

#![no_std]
