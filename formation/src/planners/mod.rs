//! Planners: where the drones of a formation listen next.

mod altitude;
mod arcs;
mod circle;
#[cfg(feature = "alloc")]
mod coverage;
#[cfg(feature = "alloc")]
mod emulate;
#[cfg(test)]
mod fake;
mod follow_estimate;
mod hold;
#[cfg(feature = "alloc")]
mod information;
mod orbit;
mod places;
mod settling;
mod surge_cast;
mod waypoints;

pub use altitude::AltitudeRule;
pub use arcs::{Arcs, ArcsConfig};
#[cfg(feature = "alloc")]
pub use coverage::{Coverage, CoverageConfig, CoverageError};
#[cfg(feature = "alloc")]
pub use emulate::Emulate;
pub use follow_estimate::{FollowConfig, FollowEstimate};
pub use hold::Hold;
#[cfg(feature = "alloc")]
pub use information::{
    Criterion, ExpectedReading, ExpectedReadings, Information, InformationConfig, Objective,
    RssBearingTurn, SteepestDescent, SteepestDescentConfig, TARGETS, TurnFisher, TurnFishers,
    TurnInformation,
};
pub use orbit::{Orbit, OrbitConfig};
pub use settling::SettlingRule;
pub use surge_cast::{SurgeCast, SurgeCastConfig};
pub use waypoints::Waypoints;
