//! The shadowing grid against direct integration, its own model, and recorded flights.

mod aerpaw;
mod behaviour;
mod calibration;
mod oracle;
mod refusals;
mod world;
