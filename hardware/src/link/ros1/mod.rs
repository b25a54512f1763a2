//! The link over ROS 1: the reference system's middleware.

mod drone;
mod fusion;
mod header;
mod node;
mod types;

pub use drone::Ros1Drone;
pub use fusion::Ros1Fusion;
pub use node::Ros1Config;

use header::Header;
use node::Node;
