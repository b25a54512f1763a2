//! Gaussian filters of states whose size is known at run time only.
//!
//! Functions without type parameters are `#[inline]`, so that a program that has no such state does
//! not compile them.

mod belief;
mod dense;
mod image;
mod joint;
mod kalman;
mod part;

pub use joint::JointMotion;
pub use kalman::{DynamicCkf, DynamicEkf, DynamicInnovation, DynamicKalman, DynamicUkf};
pub use part::Part;
