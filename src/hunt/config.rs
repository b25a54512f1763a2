use serde::{Deserialize, Serialize};

use super::HuntError;

/// What a [`Hunt`](super::Hunt) is told besides its parts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HuntConfig {
    /// σ of each coordinate of a beacon's place before anything was heard.
    pub prior_sigma_m: f64,
    /// What it is about, East and North; the centroid of the drones where absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prior_centre_m: Option<[f64; 2]>,
    /// A drone has arrived when it is this near its goal.
    pub arrival_tolerance_m: f64,
    /// Drones that have not arrived after this long are not waited for.
    pub move_timeout_s: f64,
    /// A drone whose turn has not come after this long, for each beacon that the turn asks, is
    /// not waited for.
    pub turn_timeout_s: f64,
    /// Every turn asks all beacons that are not done yet, and each is believed to be somewhere
    /// from the start. The drones go where the planner wants them for one beacon after the other.
    /// Otherwise a beacon is asked and believed in only while it is searched for.
    pub shared_turns: bool,
    /// σ of a drone's own East, North and Up, in metres, as its GNSS has it; taken for known where
    /// absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub receiver_sigma_m: Option<f64>,
    /// A formation position at which nothing was heard is measured this often before the beacon
    /// is given up.
    pub attempts: u32,
}

impl Default for HuntConfig {
    /// Prior σ 50 m about the drones, as far as a small drone's beacon is looked for; arrival within 0.3 m, 120 s for a move, 90 s for a turn
    /// (52.8 s at most: 128 positions of 0.4 s, the first of 2 s), a turn for each beacon as in
    /// the reference, drones that know where they are, 3 attempts.
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
        }
    }
}

impl HuntConfig {
    pub(super) fn check(&self) -> Result<(), HuntError> {
        let fields = [
            ("prior_sigma_m", self.prior_sigma_m),
            ("arrival_tolerance_m", self.arrival_tolerance_m),
            ("move_timeout_s", self.move_timeout_s),
            ("turn_timeout_s", self.turn_timeout_s),
            ("attempts", f64::from(self.attempts)),
            ("receiver_sigma_m", self.receiver_sigma_m.unwrap_or(1.0)),
        ];
        let centre = self.prior_centre_m.unwrap_or_default();
        if let Some(&value) = centre.iter().find(|value| !value.is_finite()) {
            return Err(HuntError::Config { field: "prior_centre_m", value });
        }
        match fields.into_iter().find(|(_, value)| !(*value > 0.0 && value.is_finite())) {
            Some((field, value)) => Err(HuntError::Config { field, value }),
            None => Ok(()),
        }
    }
}
