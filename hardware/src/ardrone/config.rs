use std::io;

use foxhunt_core::parameter::{FieldError, finite, in_range, positive, require};
use serde::{Deserialize, Serialize};

use crate::PosesLost;

/// Settings for the flight of an AR.Drone, and its place at the beginning.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ArDroneConfig {
    /// East of the drone in metres when the driver starts.
    pub east_m: f64,
    /// North of the drone in metres when the driver starts.
    pub north_m: f64,
    /// Direction of its nose when it is switched on, in degrees counter-clockwise from East: it
    /// counts its own yaw from there.
    pub heading_deg_ccw_from_east: f64,
    /// Uncertainty of that place, σ in metres.
    pub start_sigma_m: f64,
    /// Error of its own odometry, as a share of the way.
    pub drift_share: f64,
    /// Speed of its flight, in metres per second.
    pub speed_mps: f64,
    /// Speed over ground with the most tilt that is ordered, in metres per second.
    pub full_tilt_mps: f64,
    /// The fastest climb that is ordered, in metres per second (`control:control_vz_max`).
    pub climb_mps: f64,
    /// The fastest turn that is ordered, in degrees per second (`control:control_yaw`).
    pub yaw_rate_deg_s: f64,
    /// The highest goal, in metres.
    pub max_up_m: f64,
    /// The lowest.
    pub min_up_m: f64,
    /// The farthest goal over ground from the place of the start, in metres.
    pub fence_radius_m: f64,
    /// Orders in a second. It hovers by itself without them.
    pub rate_hz: f64,
    /// Time in seconds without navdata after which the link is lost.
    pub link_timeout_s: f64,
}

impl Default for ArDroneConfig {
    /// At the origin, its nose to the East, known to 0.3 m, off by a tenth of the way; 1 m/s, with
    /// at most the tilt of 4 m/s, 0.7 m/s up, turns of 100 °/s; 0.5 to 6 m up and 40 m away; 20
    /// orders a second; the link lost after 2 s.
    fn default() -> Self {
        Self {
            east_m: 0.0,
            north_m: 0.0,
            heading_deg_ccw_from_east: 0.0,
            start_sigma_m: 0.3,
            drift_share: 0.1,
            speed_mps: 1.0,
            full_tilt_mps: 4.0,
            climb_mps: 0.7,
            yaw_rate_deg_s: 100.0,
            max_up_m: 6.0,
            min_up_m: 0.5,
            fence_radius_m: 40.0,
            rate_hz: 20.0,
            link_timeout_s: 2.0,
        }
    }
}

/// Error of an AR.Drone: why it does not obey, or was sent no order.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ArDroneError {
    /// A port failed.
    #[error("the link: {0}")]
    Link(#[from] io::Error),
    /// It sends nothing.
    #[error("no navdata for {silent_s:.1} s; the limit is {limit_s} s")]
    Silent {
        /// Since when, in seconds; infinite where there never were any.
        silent_s: f64,
        /// The configured limit.
        limit_s: f64,
    },
    /// It does not take our orders now.
    #[error("it takes no orders from us: {why}")]
    NotCommanded {
        /// Reason why it takes no orders.
        why: String,
    },
    /// A goal is out of the limits.
    #[error("{what} of {value} is not within {least} to {most}")]
    Limit {
        /// Name of the number.
        what: &'static str,
        /// Value of the number.
        value: f64,
        /// The limit below.
        least: f64,
        /// The limit above.
        most: f64,
    },
    /// The motion capture has stopped, and the drone goes on by its own odometry.
    #[error("motion capture: {0}")]
    MotionCapture(#[from] PosesLost),
    /// A number of the configuration is out of its range.
    #[error(transparent)]
    Config(#[from] FieldError),
}

impl ArDroneConfig {
    /// Refuses what cannot be flown with.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names the field, with its value.
    pub fn check(&self) -> Result<(), FieldError> {
        for (field, value) in [
            ("east_m", self.east_m),
            ("north_m", self.north_m),
            ("heading_deg_ccw_from_east", self.heading_deg_ccw_from_east),
        ] {
            finite(field, value)?;
        }
        for (field, value) in [
            ("start_sigma_m", self.start_sigma_m),
            ("drift_share", self.drift_share),
            ("speed_mps", self.speed_mps),
            ("full_tilt_mps", self.full_tilt_mps),
            ("climb_mps", self.climb_mps),
            ("yaw_rate_deg_s", self.yaw_rate_deg_s),
            ("max_up_m", self.max_up_m),
            ("fence_radius_m", self.fence_radius_m),
            ("link_timeout_s", self.link_timeout_s),
        ] {
            positive(field, value)?;
        }
        let least = self.min_up_m;
        require(least < self.max_up_m, "min_up_m", least, "a number below max_up_m")?;
        in_range("rate_hz", self.rate_hz, 5.0..=100.0, "in 5 … 100")?;
        Ok(())
    }

    /// Refuses a number of a goal.
    pub(super) fn limit(
        what: &'static str,
        value: f64,
        least: f64,
        most: f64,
    ) -> Result<(), ArDroneError> {
        if (least..=most).contains(&value) {
            return Ok(());
        }
        Err(ArDroneError::Limit { what, value, least, most })
    }
}
