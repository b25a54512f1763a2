//! The shadowing grid against direct integration, its own model, and recorded flights.
#![cfg(feature = "alloc")]

mod aerpaw;
mod aerpaw_flights;
mod behaviour;
mod calibration;
mod oracle;
mod refusals;
mod world;
