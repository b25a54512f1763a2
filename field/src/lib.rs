//! Hunts in the field: real devices flown by the pilot's rules, and hunts on several computers.
//!
//! [`fly`] flies one hunt from one computer; [`network`] spreads it over a computer on each drone
//! and one that fuses, by the same pilot's rules.

pub mod fly;
pub mod network;
