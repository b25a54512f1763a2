use std::fmt;

use foxhunt_core::parameter::{ParameterError, positive};
use serde::{Deserialize, Serialize};

/// The pilot's rules: when a flight begins, and how it ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FlightRules {
    /// Height of the drones' climb at take-off, in metres above where each stands.
    pub takeoff_up_m: f64,
    /// Ending when all is found.
    pub at_end: Ending,
    /// Ending when the pilot breaks off, or something goes wrong.
    pub on_abort: Ending,
    /// Aircraft that are not ready after this long end the flight on the ground.
    pub ready_timeout_s: f64,
    /// Aircraft that are not up after this long end the flight.
    pub climb_timeout_s: f64,
    /// Aircraft that are not down after this long are not waited for.
    pub leaving_timeout_s: f64,
    /// A hunt that no aircraft takes part in for this long ends, unless the pilot flies one of
    /// them, who may give it back; at once where all are down.
    pub deserted_timeout_s: f64,
    /// Silence of orders after which a drone of a hunt on several computers leaves as when the
    /// pilot breaks off, in seconds. Until then it flies to its last goal and holds there.
    pub orders_timeout_s: f64,
}

/// Action of aircraft that are still in the air when a flight ends.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Ending {
    /// They come back and land by their autopilots' own rules.
    #[default]
    Return,
    /// They land where they are.
    Land,
    /// They stay where they are, for the pilot to take.
    Hold,
}

impl fmt::Display for Ending {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Return => "they return and land",
            Self::Land => "they land where they are",
            Self::Hold => "they stay where they are",
        })
    }
}

impl Default for FlightRules {
    /// 4 m as in the reference, return in either case, 180 s to get ready (a GNSS receiver that
    /// starts cold), 60 s to climb, 300 s to come back, 30 s without any aircraft, 60 s
    /// without orders.
    fn default() -> Self {
        Self {
            takeoff_up_m: 4.0,
            at_end: Ending::Return,
            on_abort: Ending::Return,
            ready_timeout_s: 180.0,
            climb_timeout_s: 60.0,
            leaving_timeout_s: 300.0,
            deserted_timeout_s: 30.0,
            orders_timeout_s: 60.0,
        }
    }
}

impl FlightRules {
    /// Refuses rules that are out of their range.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the field that is no positive number.
    pub fn check(&self) -> Result<(), ParameterError> {
        positive("takeoff_up_m", self.takeoff_up_m)?;
        positive("ready_timeout_s", self.ready_timeout_s)?;
        positive("climb_timeout_s", self.climb_timeout_s)?;
        positive("leaving_timeout_s", self.leaving_timeout_s)?;
        positive("deserted_timeout_s", self.deserted_timeout_s)?;
        positive("orders_timeout_s", self.orders_timeout_s)?;
        Ok(())
    }
}
