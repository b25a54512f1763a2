use serde::{Deserialize, Serialize};

use crate::link::{
    LinkError, UnixTime,
    ros::{FRAME, RosHeader, seconds},
};

/// `std_msgs/Header`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Header {
    /// Stays 0.
    seq: u32,
    sec: u32,
    nanosec: u32,
    frame_id: String,
}

impl RosHeader for Header {
    fn at(moment: UnixTime) -> Result<Self, LinkError> {
        let sec = seconds("stamp.secs", moment)?;
        Ok(Self { seq: 0, sec, nanosec: moment.nanosec, frame_id: FRAME.to_owned() })
    }

    fn moment(&self) -> UnixTime {
        UnixTime { sec: i64::from(self.sec), nanosec: self.nanosec }
    }
}
