//! Real fleets: where they may fly, who flies where, and when.

mod airspace;
mod airspace_config;
mod assignment;
mod attendance;
mod deadlock;
mod endurance;
mod flight;
mod formation;
mod ground;
mod traffic;
mod traffic_config;
mod void;
mod way;

pub use airspace::Airspace;
pub use airspace_config::{AirspaceConfig, AirspaceError, KeepOut};
pub use assignment::assign;
pub use attendance::{Attendance, AttendanceConfig, Duty};
pub use endurance::{Endurance, EnduranceConfig};
pub use flight::{Order, OrderReason, Travel};
pub use formation::{Formation, Moved, MovedReason};
pub use traffic::Traffic;
pub use traffic_config::{TrafficConfig, TrafficError};
pub use void::Void;
