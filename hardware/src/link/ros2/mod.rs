//! The link over ROS 2, by DDS.

mod drone;
mod fusion;
mod header;
mod node;

pub use drone::Ros2Drone;
pub use fusion::Ros2Fusion;
pub use node::Ros2Config;

use header::Header;
use node::{Kept, Opened};
