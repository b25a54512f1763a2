//! Links between the computers of a hunt: every drone's, and the one that fuses.
//!
//! Messages are repeated until they are answered, so a link may lose, delay and double
//! them, and either side may be restarted: an order carries all that is to be done, a report names
//! what it is about, and what has been taken in before makes no difference.

#[cfg(feature = "signed")]
mod carried;
mod carrier;
mod clock;
mod drone_link;
#[cfg(feature = "signed")]
mod envelope;
mod error;
mod fusion_link;
mod impaired;
#[cfg(feature = "signed")]
mod key;
mod memory;
#[cfg(feature = "mqtt")]
mod mqtt;
mod order;
mod refusal;
mod report;
#[cfg(any(feature = "ros1", feature = "ros2"))]
mod ros;
#[cfg(feature = "ros1")]
mod ros1;
#[cfg(feature = "ros2")]
mod ros2;
mod status;
mod unix_time;
mod view;

#[cfg(feature = "signed")]
pub use carried::{CarriedDrone, CarriedFusion};
pub use carrier::{Carrier, MemoryCarrier, memory_carriers};
pub use clock::{ClockFilter, ClockOffset, Echo};
pub use drone_link::DroneLink;
pub use error::LinkError;
pub use fusion_link::FusionLink;
pub use impaired::{Impaired, Impairment};
#[cfg(feature = "signed")]
pub use key::{KeyError, TeamKey};
pub use memory::{MemoryDrone, MemoryFusion, memory_network};
#[cfg(feature = "mqtt")]
pub use mqtt::{MqttCarrier, MqttConfig};
pub use order::{Leave, Order, Taken, Turn};
pub use refusal::Refusal;
pub use report::{Delivery, Report};
#[cfg(feature = "ros1")]
pub use ros1::{Ros1Config, Ros1Drone, Ros1Fusion};
#[cfg(feature = "ros2")]
pub use ros2::{Ros2Config, Ros2Drone, Ros2Fusion};
pub use status::{Stage, Status};
pub use unix_time::UnixTime;
pub use view::{BeaconView, DroneView, Health, View};
