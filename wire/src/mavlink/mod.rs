//! MAVLink 2 as bytes: frames in and out of buffers, their signatures, the modes of ArduCopter and
//! PX4, and conversions of their units to ours. The messages' contents are the `mavlink` crate's.

mod codec;
mod mode;
mod signing;
mod units;

pub use codec::{Codec, Frame, FrameCounts};
pub use mavlink::{
    MavHeader, Message, MessageData, dialects::ardupilotmega as dialect, types::CharArray,
};
pub use mode::{Autopilot, FlightMode};
pub use signing::{Signing, SigningKey, SigningKeyError};
pub use units::{
    CommonFrame, degrees_of_e7, e7_of_degrees, heading_of_yaw, ned_of_enu, whole, yaw_of_heading,
};
