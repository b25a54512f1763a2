//! Types of ROS 2 that a bag has, and their definitions, each with the types that it holds.

pub(super) const GEO_JSON: &str = "foxglove_msgs/msg/GeoJSON";
pub(super) const LOG: &str = "rcl_interfaces/msg/Log";
pub(super) const NAV_SAT_FIX: &str = "sensor_msgs/msg/NavSatFix";
pub(super) const PATH: &str = "nav_msgs/msg/Path";
pub(super) const POSE_STAMPED: &str = "geometry_msgs/msg/PoseStamped";
pub(super) const POSE_WITH_COVARIANCE_STAMPED: &str = "geometry_msgs/msg/PoseWithCovarianceStamped";
pub(super) const TF_MESSAGE: &str = "tf2_msgs/msg/TFMessage";

/// Types with their fields; a type stands after the types that it holds.
const FIELDS: [(&str, &str); 17] = [
    ("builtin_interfaces/msg/Time", "int32 sec\nuint32 nanosec\n"),
    ("std_msgs/msg/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
    ("geometry_msgs/msg/Point", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/msg/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/msg/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"),
    (
        "geometry_msgs/msg/Pose",
        "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
    ),
    (POSE_STAMPED, "std_msgs/Header header\ngeometry_msgs/Pose pose\n"),
    ("geometry_msgs/msg/PoseWithCovariance", "geometry_msgs/Pose pose\nfloat64[36] covariance\n"),
    (
        POSE_WITH_COVARIANCE_STAMPED,
        "std_msgs/Header header\ngeometry_msgs/PoseWithCovariance pose\n",
    ),
    (PATH, "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses\n"),
    (
        "geometry_msgs/msg/Transform",
        "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
    ),
    (
        "geometry_msgs/msg/TransformStamped",
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
    ),
    (TF_MESSAGE, "geometry_msgs/TransformStamped[] transforms\n"),
    ("sensor_msgs/msg/NavSatStatus", "int8 status\nuint16 service\n"),
    (
        NAV_SAT_FIX,
        "std_msgs/Header header\nsensor_msgs/NavSatStatus status\nfloat64 latitude\n\
         float64 longitude\nfloat64 altitude\nfloat64[9] position_covariance\n\
         uint8 position_covariance_type\n",
    ),
    (
        LOG,
        "builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\nstring file\n\
         string function\nuint32 line\n",
    ),
    (GEO_JSON, "string geojson\n"),
];

/// The definition of a type as MCAP wants it (`ros2msg`): its fields, then each type that it holds
/// behind a line of `=`.
pub(super) fn definition(kind: &str) -> String {
    let fields = |kind: &str| {
        FIELDS.iter().find(|(name, _)| *name == kind).map_or("", |(_, fields)| *fields)
    };
    let mut text = fields(kind).to_owned();
    let mut held: Vec<String> = Vec::new();
    let mut open = vec![kind.to_owned()];
    while let Some(kind) = open.pop() {
        for field in fields(&kind).lines() {
            let of = field.split([' ', '[']).next().unwrap_or_default();
            let of = of.replace('/', "/msg/");
            if of.contains('/') && !held.contains(&of) {
                open.push(of.clone());
                held.push(of);
            }
        }
    }
    for kind in held {
        text.push_str(&"=".repeat(80));
        text.push_str(&format!("\nMSG: {}\n{}", kind.replace("/msg/", "/"), fields(&kind)));
    }
    text
}
