//! The simulated world, met as its users meet it.
//!
//! Statistical tests state their size; each band is five standard errors wide, which a right
//! channel leaves once in 1.7 million seeds. The seeds are fixed, so a test passes or fails for
//! good.

mod body;
mod channel;
mod config;
mod devices;
mod failures;
mod own_source;
mod patterns;
mod rig;
mod statistics;
mod stepper;
mod streams;
mod terrain;
mod turn_goals;
