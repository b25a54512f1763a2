//! Where a formation of drones listens: shapes, planners, and the phases of a search.
//!
//! | planner | goes | finishes |
//! |-|-|-|
//! | [`FollowEstimate`] | a regular polygon about the estimate (Pritzl 2018, §5.2) | when the estimate has settled |
//! | [`Waypoints`] | a regular polygon over one given place after the other | after the last |
//! | [`Hold`] | nowhere | after a number of turns |
//!
//! A planner of one's own is a `foxhunt_core::FormationPlanner`, or a closure through
//! `foxhunt_core::planner_fn`.

#![no_std]

#[cfg(feature = "fleet")]
extern crate std;

mod attendance;
#[cfg(feature = "fleet")]
mod fleet;
mod follow_estimate;
mod hold;
mod phases;
mod polygon;
mod stop;
mod waypoints;

pub use attendance::{Attendance, AttendanceConfig, Duty};
#[cfg(feature = "fleet")]
pub use fleet::*;
pub use follow_estimate::{FollowConfig, FollowConfigError, FollowEstimate};
pub use hold::Hold;
pub use phases::{Phase, PhaseError, Phases, Signal};
pub use polygon::Polygon;
pub use stop::{Progress, Stop, StopRules, StopWatch};
pub use waypoints::Waypoints;
