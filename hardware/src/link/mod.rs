//! Links between the computers of a hunt: every drone's, and the one that fuses.
//!
//! Messages are repeated until they are answered, so a link may lose, delay and double
//! them, and either side may be restarted: an order carries all that is to be done, a report names
//! what it is about, and what has been taken in before makes no difference.

#[cfg(feature = "signed")]
mod carried;
mod clock;
mod ends;
#[cfg(feature = "signed")]
mod key;
mod memory;
mod messages;
#[cfg(feature = "mqtt")]
mod mqtt;
#[cfg(any(feature = "ros1", feature = "ros2"))]
mod ros;

#[cfg(feature = "signed")]
pub use carried::{CarriedDrone, CarriedFusion};
pub use clock::{ClockFilter, ClockOffset, Echo, UnixTime};
pub use ends::{DroneLink, FusionLink, LinkError, Refusal};
#[cfg(feature = "signed")]
pub use key::{KeyError, TeamKey};
pub use memory::{
    Carrier, Impaired, Impairment, MemoryCarrier, MemoryDrone, MemoryFusion, memory_carriers,
    memory_network,
};
pub use messages::{
    BeaconView, Delivery, DroneView, Health, Leave, Order, Report, Stage, Status, Taken, Turn, View,
};
#[cfg(feature = "mqtt")]
pub use mqtt::{MqttCarrier, MqttConfig};
#[cfg(feature = "mqtt")]
pub(crate) use mqtt::{client, options};
#[cfg(feature = "ros1")]
pub use ros::{Ros1Config, Ros1Drone, Ros1Fusion};
#[cfg(feature = "ros2")]
pub use ros::{Ros2Config, Ros2Drone, Ros2Fusion};
