use std::io;

use foxhunt_core::parameter::FieldError;
use foxhunt_wire::geodesy::GeodesyError;

/// Error of an autopilot: why it does not obey, or was sent no order.
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
    /// The autopilot does not know its place well enough.
    #[error("no good position: {why}")]
    Position {
        /// Reason why it is not good enough.
        why: String,
    },
    /// The last report of the autopilot is too old.
    #[error("{}; the limit is {limit_s} s", aged(what, *age_s))]
    Stale {
        /// The message.
        what: &'static str,
        /// Age of the message in seconds; infinite if it never came.
        age_s: f64,
        /// The configured limit.
        limit_s: f64,
    },
    /// It does not take our orders now.
    #[error("it takes no orders from us: {why}")]
    NotCommanded {
        /// Reason why it takes no orders.
        why: String,
    },
    /// It has not taken a picture.
    #[error("no picture was taken: {why}")]
    Picture {
        /// Outcome of the order.
        why: String,
    },
    /// The goal is too high or too low.
    #[error("an Up of {up_m} m is not within the limits of {min_up_m} to {max_up_m} m")]
    UpLimit {
        /// Up of the goal.
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
        /// East of the goal, in metres.
        east_m: f64,
        /// North of the goal, in metres.
        north_m: f64,
        /// Distance of the goal from the launch place.
        distance_m: f64,
        /// The configured limit.
        fence_radius_m: f64,
    },
    /// The goal, or the way to it, is outside the fence.
    #[error("the {what} ({east_m}, {north_m}) m is outside the fence of {corners} corners")]
    Fence {
        /// The part outside: the goal, or the way to it.
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
        /// East of the goal, in metres.
        east_m: f64,
        /// North of the goal, in metres.
        north_m: f64,
        /// Up of the goal, in metres.
        up_m: f64,
    },
    /// Too fast a turn, or a rate that is not a number.
    #[error("a turn at {rate_deg_s} °/s; the limit is {limit_deg_s} °/s")]
    SpinRate {
        /// Requested rate.
        rate_deg_s: f64,
        /// The configured limit.
        limit_deg_s: f64,
    },
    /// No direction.
    #[error("a heading of {heading} rad; it must be finite")]
    Heading {
        /// Requested heading.
        heading: f64,
    },
    /// A number of the configuration is out of its range.
    #[error(transparent)]
    Config(#[from] FieldError),
    /// The origin is no place.
    #[error("origin: {0}")]
    Origin(#[from] GeodesyError),
}

/// Returns the length of a silence in words, or that nothing came yet.
fn lasting(silent_s: f64) -> String {
    if silent_s.is_finite() { format!(" for {silent_s:.1} s") } else { " yet".to_owned() }
}

/// Returns the age of the last message in words, or that none came yet.
fn aged(what: &str, age_s: f64) -> String {
    if age_s.is_finite() {
        format!("the {what} is {age_s:.1} s old")
    } else {
        format!("no {what} came yet")
    }
}
