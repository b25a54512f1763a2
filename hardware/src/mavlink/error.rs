use std::io;

use foxhunt_core::parameter::FieldError;
use foxhunt_wire::geodesy::GeodesyError;

/// Why an autopilot does not obey, or was sent no order.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MavlinkError {
    /// The port failed.
    #[error("the link: {0}")]
    Link(#[from] io::Error),
    /// Nothing of an autopilot.
    #[error("nothing of an autopilot came{}; the limit is {limit_s} s", lasting(*silent_s))]
    Silent {
        /// Length of the silence in seconds; infinite if nothing ever came.
        silent_s: f64,
        /// The configured limit.
        limit_s: f64,
    },
    /// It does not know well enough where it is.
    #[error("no good position: {why}")]
    Position {
        /// What is not good enough.
        why: String,
    },
    /// Its last report is too old.
    #[error("{}; the limit is {limit_s} s", aged(what, *age_s))]
    Stale {
        /// The message.
        what: &'static str,
        /// Its age in seconds; infinite where there was none.
        age_s: f64,
        /// The configured limit.
        limit_s: f64,
    },
    /// It does not take our orders now.
    #[error("it takes no orders from us: {why}")]
    NotCommanded {
        /// What is in the way.
        why: String,
    },
    /// It has not taken a picture.
    #[error("no picture was taken: {why}")]
    Picture {
        /// What became of the order.
        why: String,
    },
    /// The goal is too high or too low.
    #[error("an Up of {up_m} m is not within the limits of {min_up_m} to {max_up_m} m")]
    UpLimit {
        /// Of the goal.
        up_m: f64,
        /// The configured limit below.
        min_up_m: f64,
        /// The configured limit above.
        max_up_m: f64,
    },
    /// The goal is too far from the launch place.
    #[error(
        "the goal ({east_m}, {north_m}) m is {distance_m:.1} m from the launch place; \
         fence_radius_m is {fence_radius_m}"
    )]
    Radius {
        /// Its East.
        east_m: f64,
        /// Its North.
        north_m: f64,
        /// How far it is.
        distance_m: f64,
        /// The configured limit.
        fence_radius_m: f64,
    },
    /// The goal, or the way to it, is outside the fence.
    #[error("the {what} ({east_m}, {north_m}) m is outside the fence of {corners} corners")]
    Fence {
        /// Whether it is the goal or the way to it.
        what: &'static str,
        /// East of the goal.
        east_m: f64,
        /// North of the goal.
        north_m: f64,
        /// Corners of the fence.
        corners: usize,
    },
    /// The goal is beyond the autopilot's own fence.
    #[error("the autopilot's own fence: {why}")]
    OwnFence {
        /// The border, and where the goal is.
        why: String,
    },
    /// The goal is no place.
    #[error("the goal ({east_m}, {north_m}, {up_m}) m is not finite")]
    Goal {
        /// Its East.
        east_m: f64,
        /// Its North.
        north_m: f64,
        /// Its Up.
        up_m: f64,
    },
    /// Too fast a turn, or none.
    #[error("a turn at {rate_deg_s} °/s; the limit is {limit_deg_s} °/s")]
    SpinRate {
        /// What was requested.
        rate_deg_s: f64,
        /// The configured limit.
        limit_deg_s: f64,
    },
    /// No direction.
    #[error("a heading of {heading} rad; it must be finite")]
    Heading {
        /// What was requested.
        heading: f64,
    },
    /// A number of the configuration is out of its range.
    #[error(transparent)]
    Config(#[from] FieldError),
    /// The origin is no place.
    #[error("origin: {0}")]
    Origin(#[from] GeodesyError),
}

/// For how long nothing came, where there ever was anything.
fn lasting(silent_s: f64) -> String {
    if silent_s.is_finite() { format!(" for {silent_s:.1} s") } else { " yet".to_owned() }
}

/// How old the last message is, where there ever was one.
fn aged(what: &str, age_s: f64) -> String {
    if age_s.is_finite() {
        format!("the {what} is {age_s:.1} s old")
    } else {
        format!("no {what} came yet")
    }
}
