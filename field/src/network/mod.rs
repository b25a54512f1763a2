//! A hunt on several computers: one on every drone, and one that fuses, over any link.
//!
//! A [`DroneNode`] turns its antenna, makes receptions of its sweeps, and flies where it is sent; a
//! [`FlownNode`] does so with a real aircraft, by its pilot's rules. A [`FusionNode`] runs the
//! [`Hunt`](foxhunt_hunt::hunt::Hunt). Both repeat their messages, so that whatever is lost, late
//! or doubled on the way, and whichever of them is restarted, nothing is counted twice and nothing
//! that was delivered is lost.
//!
//! # Why this is not `drive`
//!
//! [`drive`](foxhunt_hunt::hunt::drive) calls the devices of each drone and takes their answers
//! within one step. Here the devices are on other computers: a pose comes when it comes, an order
//! is a state that is repeated until it is followed, and a sweep never leaves its drone, which
//! sends the reception made of it. So a [`FusionNode`] calls the same methods of the same hunt
//! (`located`, `advance`, `poll_command`, `reception`) as messages come and go, and a [`DroneNode`]
//! calls the devices. What is known of a lost or doubled message has no place in the traits of
//! devices.

mod drone;
mod flown;
mod fusion;
mod remote;

pub use drone::DroneNode;
pub use flown::FlownNode;
pub use fusion::{FusionNode, Past};

use std::collections::VecDeque;

use foxhunt_core::{
    Pose,
    parameter::{FieldError, ParameterError, as_value, positive, require},
};
use foxhunt_hardware::link::{ClockOffset, LinkError, Order, Stage, Taken, UnixTime};
use foxhunt_hunt::hunt::HuntError;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use serde::{Deserialize, Serialize};

/// Settings of a [`DroneNode`]: how often messages to the fusing node are sent and repeated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DroneNodeConfig {
    /// Interval at which the drone's pose and status are sent, in seconds.
    pub report_every_s: f64,
    /// Interval at which a delivery is sent again until it is known to be logged, in seconds.
    pub repeat_every_s: f64,
    /// Time after which an order that a device did not follow is tried again, in seconds.
    pub retry_after_s: f64,
    /// Greatest uncertainty of a drone's clock offset, in seconds, with which it takes part; beyond
    /// that its receptions are refused.
    pub clock_uncertainty_s: f64,
    /// Maximum number of kept deliveries that are not known to be logged; the oldest are given up.
    pub most_kept: usize,
}

impl Default for DroneNodeConfig {
    /// Five reports a second, a delivery and an order again after a second, clocks within half a
    /// second, 1000 deliveries kept.
    fn default() -> Self {
        Self {
            report_every_s: 0.2,
            repeat_every_s: 1.0,
            retry_after_s: 1.0,
            clock_uncertainty_s: 0.5,
            most_kept: 1000,
        }
    }
}

impl DroneNodeConfig {
    /// Refuses settings that are out of their range.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the field.
    pub fn check(&self) -> Result<(), ParameterError> {
        positive("report_every_s", self.report_every_s)?;
        positive("repeat_every_s", self.repeat_every_s)?;
        positive("retry_after_s", self.retry_after_s)?;
        positive("clock_uncertainty_s", self.clock_uncertainty_s)?;
        require(self.most_kept > 0, "most_kept", as_value(self.most_kept), "at least 1")?;
        Ok(())
    }
}

/// Settings of a [`FusionNode`]: how often messages to the drones are repeated,
/// and how their reports are judged.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FusionNodeConfig {
    /// Orders are sent again this often, in seconds.
    pub order_every_s: f64,
    /// The view of the hunt is sent this often, in seconds.
    pub show_every_s: f64,
    /// Tolerance of a corrected clock, in seconds: a reception from farther in the future is
    /// refused.
    pub clock_tolerance_s: f64,
    /// Time without a report after which a drone is silent, and not waited for at the end, in
    /// seconds.
    pub silent_after_s: f64,
    /// Time that a hunt that goes on from its log waits for its drones to show up, in seconds.
    pub assemble_s: f64,
    /// Number of places kept of each drone's path, for the view.
    pub path_places: usize,
}

impl Default for FusionNodeConfig {
    /// Five orders a second, a view each second, clocks within a second, drones that are silent for
    /// 10 s not waited for, 30 s to assemble, 1000 places of each path.
    fn default() -> Self {
        Self {
            order_every_s: 0.2,
            show_every_s: 1.0,
            clock_tolerance_s: 1.0,
            silent_after_s: 10.0,
            assemble_s: 30.0,
            path_places: 1000,
        }
    }
}

impl FusionNodeConfig {
    /// Refuses settings that are out of their range.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the field.
    pub fn check(&self) -> Result<(), ParameterError> {
        positive("order_every_s", self.order_every_s)?;
        positive("show_every_s", self.show_every_s)?;
        positive("clock_tolerance_s", self.clock_tolerance_s)?;
        positive("silent_after_s", self.silent_after_s)?;
        positive("assemble_s", self.assemble_s)?;
        Ok(())
    }
}

/// Reason why a node cannot begin or go on.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NetworkError {
    /// A field of the configuration is out of its range.
    #[error(transparent)]
    Config(#[from] ParameterError),
    /// A rule of the flight is out of its range.
    #[error(transparent)]
    Rule(#[from] FieldError),
    /// No drone was given.
    #[error("a hunt needs at least one drone")]
    NoDrone,
    /// The reading of a clock cannot be represented as a time.
    #[error("{time} s since the clock began is not a valid time")]
    Time {
        /// Reading of the clock, in seconds.
        time: f64,
    },
    /// The link failed; the node goes on when it is called again.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The hunt itself cannot go on.
    #[error(transparent)]
    Hunt(#[from] HuntError),
}

/// A drone, as far as the fusing node knows it.
#[derive(Debug, Default)]
struct Remote {
    /// Current order of the drone.
    order: Order,
    /// True if the order was sent since it changed.
    sent: bool,
    /// The number of the order that it follows.
    follows: u64,
    /// Last pose, with its time by the drone's own clock.
    place: Option<(UnixTime, Pose)>,
    /// Time of its last report.
    reported_at: Option<f64>,
    /// Delay of its last place, in seconds.
    late_s: f64,
    stage: Stage,
    /// Offset of its clock, by the drone's own account.
    clock: Option<ClockOffset>,
    /// The stamp of its last status, as long as it was not returned.
    unanswered: Option<UnixTime>,
    /// Offset of the drone's clock as it was logged last.
    logged_clock: Option<ClockOffset>,
    failure: String,
    path: VecDeque<(UnixTime, Pose)>,
    /// Deliveries that were handled and may not be in the log yet.
    unlogged: Vec<Taken>,
    delivered: u64,
    doubled: u64,
}

/// Independent numbers that are uniform in [0, 1), for
/// [`Impaired`](foxhunt_hardware::link::Impaired) links; the same for the same seed.
pub fn uniform_draws(seed: u64) -> impl FnMut() -> f64 + use<> {
    let mut generator = Xoshiro256PlusPlus::seed_from_u64(seed);
    move || generator.random()
}
