use core::f64::consts::FRAC_PI_6;

use foxhunt_core::parameter::{
    ParameterError, at_least_one, finite, in_range, not_negative, positive,
};

use super::RssBearingTurn;
use crate::planners::AltitudeRule;

/// Measure of a turn's worth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Criterion {
    /// [`Fisher`](Self::Fisher) where the belief is nearly Gaussian, else
    /// [`Entropy`](Self::Entropy).
    #[default]
    Automatic,
    /// The expected log-determinant of the posterior covariance by Fisher information, over places
    /// of the belief (Bayesian D-optimality; Chaloner & Verdinelli 1995).
    Fisher,
    /// The mutual information of reading and place, by pairwise distances of what would be read
    /// from the places of the belief (Kolchinsky & Tracey 2017).
    Entropy,
}

/// Quantity that the planner optimises.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum Objective {
    /// The expected time until the ellipse is as small as wanted.
    #[default]
    TimeToEllipse,
    /// The information gained per second over the horizon.
    InformationRate,
}

/// Configuration of [`Information`](super::Information). Lengths are metres, angles degrees, times
/// seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct InformationConfig {
    /// The path-loss exponent.
    pub exponent: f64,
    /// σ of a turn's level in dB.
    pub level_sigma_db: f64,
    /// σ of a turn's bearing in degrees; something like 1000 for an antenna without a direction.
    pub bearing_sigma_deg: f64,
    /// σ in dB of what is known beforehand of the level at a given range: of the transmitter's
    /// power, which all drones share. It is found along with the place; 0 where it is known.
    pub power_sigma_db: f64,
    /// Rule for the altitude.
    pub altitude: AltitudeRule,
    /// Speed of a drone over ground, in metres per second.
    pub speed_mps: f64,
    /// Speed of climbing and sinking, in metres per second.
    pub climb_mps: f64,
    /// Duration of a turn of the antenna.
    pub turn_s: f64,
    /// No two goals are nearer to each other than this.
    pub separation_m: f64,
    /// Number of turns that the planner looks ahead, the next one included.
    pub horizon: u32,
    /// Quantity to optimise.
    pub objective: Objective,
    /// Measure of a turn's worth.
    pub criterion: Criterion,
    /// Number of places that stand for the belief; half as many where their pairs are compared
    /// ([`Criterion::Entropy`]).
    pub places: u32,
    /// Another plan has to save this many seconds over turning again to be worth a move.
    pub least_saving_s: f64,
    /// The search ends when the semi-major axis of the 95 % ellipse is below this …
    pub ellipse_m: f64,
    /// … or the next turn is expected to teach less than this, in nats per second …
    pub least_nats_per_s: f64,
    /// … or after this many formation positions.
    pub most_positions: u32,
    /// σ of what is believed of a target before anything was received, about the drones or
    /// `prior_centre_m`; 0 where nothing is believed, and the drones listen where they are first.
    pub prior_sigma_m: f64,
    /// Centre of that belief, East and North; the centroid of the drones where absent.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub prior_centre_m: Option<[f64; 2]>,
}

impl Default for InformationConfig {
    /// The open field's exponent 2.765, 4 dB and 30° (Pritzl 2018, §6.1 and §7.1), a power in
    /// doubt by 5 dB, 2 to 4 m up and 30° at most, 2 m/s over ground and 1 m/s up, turns of 45 s,
    /// 3 m between drones; a horizon of 8 turns, 64 places; the search ends at 1.6 m, below 0.001
    /// nats per second or after 60 positions; nothing is believed beforehand.
    fn default() -> Self {
        Self {
            exponent: 2.765,
            level_sigma_db: 4.0,
            bearing_sigma_deg: 30.0,
            power_sigma_db: 5.0,
            altitude: AltitudeRule { elevation_limit: FRAC_PI_6, least_m: 2.0, most_m: 4.0 },
            speed_mps: 2.0,
            climb_mps: 1.0,
            turn_s: 45.0,
            separation_m: 3.0,
            horizon: 8,
            objective: Objective::default(),
            criterion: Criterion::default(),
            places: 64,
            least_saving_s: 1.0,
            ellipse_m: 1.6,
            least_nats_per_s: 0.001,
            most_positions: 60,
            prior_sigma_m: 0.0,
            prior_centre_m: None,
        }
    }
}

impl InformationConfig {
    /// The turn of these figures.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names what is out of its range.
    pub fn turn(&self) -> Result<RssBearingTurn, ParameterError> {
        self.check()?;
        let (bearing_sigma, limit) =
            (self.bearing_sigma_deg.to_radians(), self.altitude.elevation_limit);
        RssBearingTurn::new(self.exponent, self.level_sigma_db, bearing_sigma, limit)
    }

    /// Checks that every field is in its range.
    pub(super) fn check(&self) -> Result<(), ParameterError> {
        self.altitude.check()?;
        positive("exponent", self.exponent)?;
        positive("level_sigma_db", self.level_sigma_db)?;
        positive("bearing_sigma_deg", self.bearing_sigma_deg)?;
        not_negative("power_sigma_db", self.power_sigma_db)?;
        positive("speed_mps", self.speed_mps)?;
        positive("climb_mps", self.climb_mps)?;
        positive("turn_s", self.turn_s)?;
        not_negative("separation_m", self.separation_m)?;
        in_range("horizon", f64::from(self.horizon), 1.0..=10.0, "from 1 to 10")?;
        in_range("places", f64::from(self.places), 8.0..=256.0, "from 8 to 256")?;
        not_negative("least_saving_s", self.least_saving_s)?;
        positive("ellipse_m", self.ellipse_m)?;
        not_negative("least_nats_per_s", self.least_nats_per_s)?;
        at_least_one("most_positions", self.most_positions)?;
        not_negative("prior_sigma_m", self.prior_sigma_m)?;
        let [east, north] = self.prior_centre_m.unwrap_or_default();
        finite("prior_centre_m", east)?;
        finite("prior_centre_m", north)?;
        Ok(())
    }
}
