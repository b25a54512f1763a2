//! facade
pub use foxhunt_core as core;
