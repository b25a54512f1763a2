//! Where a formation of drones listens: shapes, planners, and the phases of a search.
//!
//! | planner | goes | finishes |
//! |-|-|-|
//! | [`FollowEstimate`] | a shape about the estimate (Pritzl 2018, §5.2) | when the estimate has settled |
//! | [`Waypoints`] | a shape over one given place after the other | after the last |
//! | [`Orbit`] | around the estimate | when the estimate has settled, after a round |
//! | [`Arcs`] | on a spiral towards the estimate, then around it | the same |
//! | [`SurgeCast`] | along the bearings while the level rises, across them when it falls | the same |
//! | [`Information`] (feature `alloc`) | where the ellipse is expected to become small soonest | when it is |
//! | [`SteepestDescent`] (feature `alloc`) | each drone down the gradient of the posterior bound | when its ellipse is small enough |
//! | [`Hold`] | nowhere | after a number of turns |
//!
//! Shapes are [`Polygon`], [`Line`], [`Offsets`], each of them [`Scaled`], or a closure through
//! [`shape_fn`]. With the feature `alloc`: `Coverage` lays out the places of a sweep over a polygon,
//! and `Emulate` has few drones fly a formation of many.
//!
//! A planner of one's own is a `foxhunt_core::FormationPlanner`, or a closure through
//! `foxhunt_core::planner_fn`.

#![no_std]

#[cfg(feature = "alloc")]
extern crate alloc;
#[cfg(feature = "fleet")]
extern crate std;

mod altitude;
mod arcs;
mod attendance;
#[cfg(feature = "alloc")]
mod coverage;
#[cfg(feature = "alloc")]
mod emulate;
#[cfg(test)]
mod fake;
#[cfg(feature = "fleet")]
mod fleet;
mod follow_estimate;
mod hold;
#[cfg(feature = "alloc")]
mod information;
mod orbit;
mod parameter;
mod phases;
mod places;
mod settling;
mod shape;
#[cfg(any(feature = "alloc", feature = "fleet"))]
mod spiral;
mod stop;
mod surge_cast;
#[cfg(feature = "alloc")]
mod travel;
mod waypoints;

pub use altitude::AltitudeRule;
pub use arcs::{Arcs, ArcsConfig};
pub use attendance::{Attendance, AttendanceConfig, Duty};
#[cfg(feature = "alloc")]
pub use coverage::{Coverage, CoverageConfig, CoverageError};
#[cfg(feature = "alloc")]
pub use emulate::Emulate;
#[cfg(feature = "fleet")]
pub use fleet::*;
pub use follow_estimate::{FollowConfig, FollowEstimate};
pub use hold::Hold;
#[cfg(feature = "alloc")]
pub use information::{
    Criterion, ExpectedReading, Information, InformationConfig, Objective, RssBearingTurn,
    SteepestDescent, SteepestDescentConfig, TurnFisher, TurnInformation,
};
pub use orbit::{Orbit, OrbitConfig};
pub use parameter::ParameterError;
pub use phases::{Phase, PhaseError, Phases, Signal};
pub use settling::SettlingRule;
pub use shape::{Line, Offsets, Polygon, Scaled, Shape, ShapeFn, shape_fn};
pub use stop::{Progress, Stop, StopRules, StopWatch};
pub use surge_cast::{SurgeCast, SurgeCastConfig};
pub use waypoints::Waypoints;
