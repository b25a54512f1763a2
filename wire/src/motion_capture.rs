//! Poses of rigid bodies as lines of JSON, from a bridge to a motion-capture system.
//!
//! ```
//! use foxhunt_wire::motion_capture::CapturedPose;
//!
//! let line = br#"{"time_s": 12.5, "body": "drone-1", "position_m": [1.0, 2.0, 0.8],
//!     "quaternion_wxyz": [0.0, 0.0, 0.0, 1.0]}"#;
//! let pose = CapturedPose::parse(line)?.pose();
//! assert_eq!(pose.position.y, 2.0);
//! // Half a turn about the axis up: the nose points to the West.
//! assert!((pose.heading.abs() - std::f64::consts::PI).abs() < 1e-12);
//! # Ok::<(), foxhunt_wire::motion_capture::CapturedPoseError>(())
//! ```

use foxhunt_core::Pose;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// Largest deviation of a quaternion's norm from one.
const NORM_TOLERANCE: f64 = 0.01;

/// Pose of one rigid body at one time. Unknown fields of a line are ignored.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CapturedPose {
    /// Time of the measurement by the system's own clock, in seconds.
    pub time_s: f64,
    /// Name of the rigid body.
    pub body: String,
    /// East, North and Up in metres.
    pub position_m: [f64; 3],
    /// Rotation of the body's axes forward, left and up into East, North and Up: w, x, y and z.
    pub quaternion_wxyz: [f64; 4],
}

/// Error of a line that is not a pose.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CapturedPoseError {
    /// The line is not JSON, or has not all fields.
    #[error("not a pose in JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// A number is not finite or too large.
    #[error("{field} is {value}; it must be at most {MOST:e} in size")]
    Size {
        /// Name of the field.
        field: &'static str,
        /// Value of the number.
        value: f64,
    },
    /// The quaternion is not a rotation.
    #[error("quaternion_wxyz has the norm {norm:.3}; that of a rotation is 1")]
    Norm {
        /// Norm of the quaternion.
        norm: f64,
    },
}

/// Largest absolute value of a time or of a coordinate.
const MOST: f64 = 1e12;

impl CapturedPose {
    /// A pose of `body`.
    #[must_use]
    pub fn new(time_s: f64, body: impl Into<String>, pose: &Pose) -> Self {
        let rotation = pose.rotation();
        let [x, y, z] = rotation.imag().into();
        Self {
            time_s,
            body: body.into(),
            position_m: pose.position.into(),
            quaternion_wxyz: [rotation.scalar(), x, y, z],
        }
    }

    /// Reads a line.
    ///
    /// # Errors
    ///
    /// [`CapturedPoseError`] names the missing field, or the field with its value.
    pub fn parse(line: &[u8]) -> Result<Self, CapturedPoseError> {
        let pose: Self = serde_json::from_slice(line)?;
        let times = [("time_s", pose.time_s)].into_iter();
        let places = pose.position_m.map(|value| ("position_m", value)).into_iter();
        // JSON has no infinity, but 1e999 is read as one.
        if let Some((field, value)) =
            times.chain(places).find(|(_, value)| !(-MOST..=MOST).contains(value))
        {
            return Err(CapturedPoseError::Size { field, value });
        }
        let norm = pose.quaternion().norm();
        if !(1.0 - NORM_TOLERANCE..=1.0 + NORM_TOLERANCE).contains(&norm) {
            return Err(CapturedPoseError::Norm { norm });
        }
        Ok(pose)
    }

    /// The line, with its end.
    ///
    /// # Errors
    ///
    /// [`CapturedPoseError::Json`]; a number that is not finite is written as null.
    pub fn line(&self) -> Result<String, CapturedPoseError> {
        Ok(serde_json::to_string(self)? + "\n")
    }

    /// Place, heading, pitch and roll, without a velocity.
    #[must_use]
    pub fn pose(&self) -> Pose {
        let position = Vector3::from(self.position_m);
        Pose { position, ..Pose::default() }
            .with_rotation(&UnitQuaternion::new_normalize(self.quaternion()))
    }

    fn quaternion(&self) -> Quaternion<f64> {
        let [w, x, y, z] = self.quaternion_wxyz;
        Quaternion::new(w, x, y, z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    const LINE: &str =
        r#"{"time_s":1,"body":"a","position_m":[1,2,3],"quaternion_wxyz":[1,0,0,0]}"#;

    #[test]
    fn a_pose_comes_back_from_its_line() {
        let pose = Pose {
            position: Vector3::new(3.0, -2.0, 1.5),
            heading: 2.5,
            pitch: 0.2,
            roll: -0.3,
            velocity: None,
        };
        let sent = CapturedPose::new(7.25, "a \"b\"", &pose);
        let line = sent.line().expect("finite numbers");
        assert!(line.ends_with("}\n"));
        let read = CapturedPose::parse(line.as_bytes()).expect("its own line");
        assert_eq!(read, sent);
        let back = read.pose();
        assert!((back.position - pose.position).norm() < 1e-12);
        for (is, was) in [(back.heading, 2.5), (back.pitch, 0.2), (back.roll, -0.3)] {
            assert_abs_diff_eq!(is, was, epsilon = 1e-12);
        }
    }

    #[test]
    fn a_bad_line_is_refused_by_the_name_of_its_field() {
        CapturedPose::parse(LINE.as_bytes()).expect("a pose");
        for (from, to, named) in [
            ("\"body\":\"a\",", "", "missing field `body`"),
            ("[1,2,3]", "[1,2]", "invalid length 2"),
            ("[1,2,3]", "[1,2e12,3]", "position_m is 2000000000000;"),
            ("\"time_s\":1", "\"time_s\":-1e13", "time_s is -10000000000000;"),
            ("[1,0,0,0]", "[1,0,0,0.5]", "quaternion_wxyz has the norm 1.118"),
            ("[1,0,0,0]", "[0,0,0,0]", "quaternion_wxyz has the norm 0.000"),
            ("{", "", "not a pose in JSON"),
        ] {
            let line = LINE.replacen(from, to, 1);
            let error = CapturedPose::parse(line.as_bytes()).expect_err(&line).to_string();
            assert!(error.contains(named), "{error}");
        }
    }
}
