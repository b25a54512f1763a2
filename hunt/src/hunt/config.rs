use foxhunt_core::parameter::{FieldError, at_least_one, finite, positive};
use foxhunt_formation::{AirspaceConfig, AttendanceConfig, EnduranceConfig, StopRules, Void};
use foxhunt_sensors::TurnGoalConfig;
use serde::{Deserialize, Serialize};

/// Settings of a [`Hunt`](super::Hunt) besides its parts.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HuntConfig {
    /// σ of each coordinate of a beacon's place before the first reception.
    pub prior_sigma_m: f64,
    /// Centre of the prior, East and North; the centroid of the drones where absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prior_centre_m: Option<[f64; 2]>,
    /// A drone has arrived when it is this near its goal, and strays no farther from its way, which
    /// ends as far from the last one's end.
    pub arrival_tolerance_m: f64,
    /// Drones that have not arrived after this long are not waited for.
    pub move_timeout_s: f64,
    /// A drone whose turn has not come after this long, for each beacon of the turn, is not
    /// waited for.
    pub turn_timeout_s: f64,
    /// Every turn measures all beacons that are not done yet, each has a belief from the start,
    /// and the planner sees them all. Otherwise a beacon is measured and estimated only while it
    /// is searched for.
    pub shared_turns: bool,
    /// σ of a drone's own East, North and Up, in metres, for drones that do not report it; taken
    /// for known where absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub receiver_sigma_m: Option<f64>,
    /// A formation position at which nothing was received is measured this often before the beacon
    /// is given up.
    pub attempts: u32,
    /// Least distance between two drones over ground, in metres.
    pub separation_m: f64,
    /// Distance that a drone flies on after an order to stop or to turn, in metres.
    pub stopping_m: f64,
    /// Airspace in which they may fly.
    pub airspace: AirspaceConfig,
    /// Void about the beacon that they keep out of; as near as the planner likes where absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub void: Option<Void>,
    /// Endurance in the air; unlimited where absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub endurance: Option<EnduranceConfig>,
    /// True if they fly home and land when all beacons are done; they do in any case when their
    /// endurance requires it.
    pub return_home: bool,
    /// Rules by which a drone counts as one that takes part no more.
    pub attendance: AttendanceConfig,
    /// Rules that end a search besides its planner's decision.
    pub stop: StopRules,
}

impl Default for HuntConfig {
    /// Prior σ 50 m about the drones, as far as a small drone's beacon is looked for; arrival
    /// within 0.3 m, 120 s for a move, 90 s for a turn (52.8 s at most: 128 positions of 0.4 s, the
    /// first of 2 s), a turn for each beacon as in the reference, drones that know where they are,
    /// 3 attempts; 2 m between drones, which stop within 1 m, no fence, no void, no end of the
    /// batteries, no way home, the [`AttendanceConfig`]'s own, no rule to stop but the planner's.
    fn default() -> Self {
        Self {
            prior_sigma_m: 50.0,
            prior_centre_m: None,
            arrival_tolerance_m: 0.3,
            move_timeout_s: 120.0,
            turn_timeout_s: 90.0,
            shared_turns: false,
            receiver_sigma_m: None,
            attempts: 3,
            separation_m: 2.0,
            stopping_m: 1.0,
            airspace: AirspaceConfig::default(),
            void: None,
            endurance: None,
            return_home: false,
            attendance: AttendanceConfig::default(),
            stop: StopRules::default(),
        }
    }
}

impl HuntConfig {
    /// Returns the semi-major axis of the 95 % ellipse that a search asks for, in metres: from
    /// [`stop`](Self::stop), or else the prior's σ. A search that its planner ends on a larger one
    /// has [`Settled`](foxhunt_core::Outcome::Settled), and not converged.
    #[must_use]
    pub fn asked_ellipse_m(&self) -> f64 {
        self.stop.ellipse_95_m.unwrap_or(self.prior_sigma_m)
    }

    /// Checks that turns may go on for a goal: their longest must end before they are given up.
    ///
    /// # Errors
    ///
    /// [`FieldError`] names what cannot be.
    pub fn check_turns(&self, turns: &TurnGoalConfig) -> Result<(), FieldError> {
        turns.check()?;
        if turns.longest_s < self.turn_timeout_s {
            return Ok(());
        }
        let below = "below hunt.turn_timeout_s, after which a turn is given up";
        Err(FieldError::new("longest_s", turns.longest_s, below))
    }

    pub(super) fn check(&self) -> Result<(), FieldError> {
        for coordinate in self.prior_centre_m.unwrap_or_default() {
            finite("prior_centre_m", coordinate)?;
        }
        for (name, value) in [
            ("prior_sigma_m", self.prior_sigma_m),
            ("arrival_tolerance_m", self.arrival_tolerance_m),
            ("move_timeout_s", self.move_timeout_s),
            ("turn_timeout_s", self.turn_timeout_s),
            ("receiver_sigma_m", self.receiver_sigma_m.unwrap_or(1.0)),
            ("attendance.misses", f64::from(self.attendance.misses)),
            ("attendance.lost_after_s", self.attendance.lost_after_s),
            ("attendance.still_after_s", self.attendance.still_after_s),
            ("attendance.still_m", self.attendance.still_m),
            ("attendance.tried_again_after_s", self.attendance.tried_again_after_s),
        ] {
            positive(name, value)?;
        }
        at_least_one("attempts", self.attempts)?;
        self.stop.check().map_err(|error| error.within("stop"))
    }
}
