use serde::{Deserialize, Serialize};

use crate::link::{
    LinkError, UnixTime,
    ros::{FRAME, RosHeader},
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
        let UnixTime { sec, nanosec } = moment;
        let told = u32::try_from(sec);
        let sec =
            told.map_err(|_| LinkError::Value { field: "stamp.secs", value: sec.to_string() })?;
        Ok(Self { seq: 0, sec, nanosec, frame_id: FRAME.to_owned() })
    }

    fn moment(&self) -> UnixTime {
        UnixTime { sec: i64::from(self.sec), nanosec: self.nanosec }
    }
}
