//! Links between the computers of a hunt: every drone's, and the one that fuses.
//!
//! Messages are repeated until they are answered, so a link may lose, delay and double
//! them, and either side may be restarted: an order carries all that is to be done, a report names
//! what it is about, and what has been taken in before makes no difference.

mod drone_link;
mod error;
mod fusion_link;
mod impaired;
mod memory;
mod order;
mod report;
#[cfg(any(feature = "ros1", feature = "ros2"))]
mod ros;
#[cfg(feature = "ros1")]
mod ros1;
#[cfg(feature = "ros2")]
mod ros2;
mod unix_time;
mod view;

pub use drone_link::DroneLink;
pub use error::LinkError;
pub use fusion_link::FusionLink;
pub use impaired::{Impaired, Impairment};
pub use memory::{MemoryDrone, MemoryFusion, memory_network};
pub use order::{Order, Taken, Turn};
pub use report::{Delivery, Report};
#[cfg(feature = "ros1")]
pub use ros1::{Ros1Config, Ros1Drone, Ros1Fusion};
#[cfg(feature = "ros2")]
pub use ros2::{Ros2Config, Ros2Drone, Ros2Fusion};
pub use unix_time::UnixTime;
pub use view::{BeaconView, DroneView, Health, View};
