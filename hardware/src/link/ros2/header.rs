use serde::{Deserialize, Serialize};

use crate::link::{
    LinkError, UnixTime,
    ros::{FRAME, RosHeader},
};

/// `std_msgs/msg/Header`.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Header {
    sec: i32,
    nanosec: u32,
    frame_id: String,
}

impl RosHeader for Header {
    fn at(moment: UnixTime) -> Result<Self, LinkError> {
        let UnixTime { sec, nanosec } = moment;
        let told = i32::try_from(sec);
        let sec =
            told.map_err(|_| LinkError::Value { field: "stamp.sec", value: sec.to_string() })?;
        Ok(Self { sec, nanosec, frame_id: FRAME.to_owned() })
    }

    fn moment(&self) -> UnixTime {
        UnixTime { sec: i64::from(self.sec), nanosec: self.nanosec }
    }
}
