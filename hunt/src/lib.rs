//! The hunt: what joins sweeps, estimators, planners and drones, its log, and what stands in files.
//!
//! [`hunt`] imports nothing of the other modules: it works with any implementors of the traits of
//! `foxhunt-core`. Above it lie [`config`], which makes parts of what stands in files and on
//! command lines, many of them in packages below; the [`registry`] of all that has a name; the
//! [`log`]; and [`scenario`]s. [`document`] reads and writes files. [`locate`] is a package of its
//! own: the estimators that take all receptions at once.

pub mod calibration;
pub mod config;
pub mod document;
pub mod hunt;
pub mod log;
pub mod registry;
pub mod scenario;

pub use foxhunt_locate as locate;
