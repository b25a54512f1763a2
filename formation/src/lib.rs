//! Formations of drones that listen: shapes, planners, and the phases of a search.
//!
//! | planner | goes | finishes |
//! |-|-|-|
//! | [`FollowEstimate`] | a shape about the estimate (Pritzl 2018, §5.2) | once it has settled |
//! | [`Waypoints`] | a shape over one given place after the other | after the last |
//! | [`Orbit`] | around the estimate | once it has settled, after a round |
//! | [`Arcs`] | on a spiral towards the estimate, then around it | the same |
//! | [`SurgeCast`] | along the bearings while the level rises, else across | the same |
//! | `Information` | where the ellipse is expected to be small soonest | when it is small |
//! | `SteepestDescent` | each drone down the gradient of the posterior bound | when it is small |
//! | `Detection` | where a missed target is received soonest, then as another | as the other |
//! | [`Hold`] | nowhere | after a number of turns |
//!
//! `Information`, `SteepestDescent` and `Detection` need the feature `alloc`, as do `Coverage`,
//! which lays out the places of a sweep over a polygon, and `Emulate`, which has few drones fly a
//! formation of many. Shapes are [`Polygon`], [`Line`], [`Offsets`], each of them [`Scaled`], or
//! a closure through [`shape_fn`].
//!
//! [`Phases`] are what a search goes through, [`StopRules`] end it whatever its planner. With the
//! feature `fleet`, `Traffic` flies the goals of any planner with real drones: within an
//! `Airspace`, apart from each other, as long as their `Endurance` lasts; `Attendance` follows who
//! takes part.
//!
//! Your own planner is a [`FormationPlanner`](foxhunt_core::FormationPlanner), or a closure
//! through [`planner_fn`](foxhunt_core::planner_fn).

#![no_std]

#[cfg(feature = "alloc")]
extern crate alloc;
#[cfg(feature = "fleet")]
extern crate std;

#[cfg(feature = "fleet")]
mod fleet;
mod planners;
mod search;
mod shape;

#[cfg(feature = "fleet")]
pub use fleet::*;
pub use planners::*;
pub use search::{
    Phase, PhaseError, Phases, Progress, Signal, Stop, StopRules, StopWatch, Transition,
};
pub use shape::{Line, Offsets, Polygon, Scaled, Shape, ShapeFn, shape_fn};
