//! Names, definitions and MD5 sums of messages in ROS 1, by which nodes make sure that they mean
//! the same.

use roslibrust::{MessageDescriptor, RosMessageType};

use super::Header;
use crate::link::ros;

/// Begins the definition of a message within another.
macro_rules! nested {
    ($name:literal, $fields:expr) => {
        concat!(
            "================================================================================\n",
            "MSG: ",
            $name,
            "\n",
            $fields
        )
    };
}

macro_rules! header {
    () => {
        nested!("std_msgs/Header", "uint32 seq\ntime stamp\nstring frame_id\n")
    };
}

macro_rules! point {
    () => {
        nested!("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n")
    };
}

macro_rules! pose {
    () => {
        concat!(
            nested!(
                "geometry_msgs/Pose",
                "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"
            ),
            point!(),
            nested!("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n")
        )
    };
}

macro_rules! described {
    ($message:ident, $($rest:tt)+) => {
        described!(@ ros::$message<Header>, $($rest)+);
    };
    (@ $message:ty, $name:literal, $md5:literal, $definition:expr) => {
        impl RosMessageType for $message {
            const DESCRIPTION: MessageDescriptor =
                MessageDescriptor::new::<Self>($name, $md5, $definition, "", &[0; 32]);
        }
    };
}

described!(
    PoseStamped,
    "geometry_msgs/PoseStamped",
    "d3812c3cbc69362b77dc0b19b345f8f5",
    concat!("std_msgs/Header header\ngeometry_msgs/Pose pose\n", header!(), pose!())
);
described!(
    PoseWithCovarianceStamped,
    "geometry_msgs/PoseWithCovarianceStamped",
    "953b798c0f514ff060a53a3498ce6246",
    concat!(
        "std_msgs/Header header\ngeometry_msgs/PoseWithCovariance pose\n",
        header!(),
        nested!(
            "geometry_msgs/PoseWithCovariance",
            "geometry_msgs/Pose pose\nfloat64[36] covariance\n"
        ),
        pose!()
    )
);
described!(
    Path,
    "nav_msgs/Path",
    "6227e2b7e9cce15051f669a5e197bbf7",
    concat!(
        "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses\n",
        header!(),
        nested!("geometry_msgs/PoseStamped", "std_msgs/Header header\ngeometry_msgs/Pose pose\n"),
        pose!()
    )
);
described!(
    DiagnosticArray,
    "diagnostic_msgs/DiagnosticArray",
    "60810da900de1dd6ddd437c3503511da",
    concat!(
        "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status\n",
        header!(),
        nested!(
            "diagnostic_msgs/DiagnosticStatus",
            "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\nbyte level\nstring name\n\
             string message\nstring hardware_id\ndiagnostic_msgs/KeyValue[] values\n"
        ),
        nested!("diagnostic_msgs/KeyValue", "string key\nstring value\n")
    )
);
described!(
    Reception,
    "foxhunt_msgs/Reception",
    "07c7ec36ffa9e010c4013b2ba67a5817",
    concat!(include_str!("../../../ros/foxhunt_msgs/msg/Reception.msg"), header!(), point!())
);
described!(
    Order,
    "foxhunt_msgs/Order",
    "a0842a274dbd6a8543679569d3f83e66",
    concat!(include_str!("../../../ros/foxhunt_msgs/msg/Order.msg"), header!(), point!())
);
described!(
    Status,
    "foxhunt_msgs/Status",
    "b6caffdaadc2e3e499c2c706c2485423",
    concat!(include_str!("../../../ros/foxhunt_msgs/msg/Status.msg"), header!())
);
described!(@ ros::Text, "std_msgs/String", "992ce8a1687cec8c8bd883ec73ca41d1", "string data\n");

#[cfg(test)]
mod tests {
    use roslibrust::md5sum::from_message_definition;

    use super::*;

    fn check<M: RosMessageType>() {
        let MessageDescriptor { ros_type_name, definition, md5sum, .. } = M::DESCRIPTION;
        let reckoned = from_message_definition(ros_type_name, definition);
        assert_eq!(reckoned.expect("a definition"), md5sum, "{ros_type_name}");
    }

    #[test]
    fn sums_are_those_of_the_definitions() {
        check::<ros::PoseStamped<Header>>();
        check::<ros::PoseWithCovarianceStamped<Header>>();
        check::<ros::Path<Header>>();
        check::<ros::DiagnosticArray<Header>>();
        check::<ros::Reception<Header>>();
        check::<ros::Order<Header>>();
        check::<ros::Status<Header>>();
        check::<ros::Text>();
    }
}
