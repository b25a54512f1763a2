use alloc::vec::Vec;
use core::fmt;

use foxhunt_core::{
    Belief, Decision, FormationPlanner, Outcome, PlanError, Reception, Stage, Station, Waypoint,
    parameter::{ParameterError, at_least_one, not_negative, positive},
};
use nalgebra::{Matrix2, Vector2, Vector3};

use super::{
    Cells, Power, RssBearingTurn, TurnInformation,
    planner::{flyable, semi_major},
    search::{apart, low_over},
    worth::ExpectedPosterior,
};
use crate::planners::AltitudeRule;

/// Number of places that stand for the belief.
const PLACES: usize = 64;

/// Number of times that a step is halved before the drones stay where they are.
const HALVINGS: u8 = 8;

/// Configuration of [`SteepestDescent`]. Lengths are metres, angles degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct SteepestDescentConfig {
    /// The path-loss exponent.
    pub exponent: f64,
    /// σ of a turn's level in dB.
    pub level_sigma_db: f64,
    /// σ of a turn's bearing in degrees; something like 1000 for an antenna without a direction.
    pub bearing_sigma_deg: f64,
    /// Rule for the altitude.
    pub altitude: AltitudeRule,
    /// The longest step of a drone.
    pub step_m: f64,
    /// No two goals are nearer to each other than this.
    pub separation_m: f64,
    /// The search ends when the semi-major axis of the 95 % ellipse is below this …
    pub ellipse_m: f64,
    /// … or after this many formation positions.
    pub most_positions: u32,
}

impl Default for SteepestDescentConfig {
    /// The open field's exponent 2.765, 4 dB and 30° (Pritzl 2018, §6.1 and §7.1), the altitudes
    /// of [`AltitudeRule`], steps of at most 30 m, 3 m between drones; the search ends at 1.6 m or
    /// after 30 positions.
    fn default() -> Self {
        Self {
            exponent: 2.765,
            level_sigma_db: 4.0,
            bearing_sigma_deg: 30.0,
            altitude: AltitudeRule::default(),
            step_m: 30.0,
            separation_m: 3.0,
            ellipse_m: 1.6,
            most_positions: 30,
        }
    }
}

impl SteepestDescentConfig {
    fn turn(&self) -> Result<RssBearingTurn, ParameterError> {
        self.altitude.check()?;
        positive("step_m", self.step_m)?;
        not_negative("separation_m", self.separation_m)?;
        positive("ellipse_m", self.ellipse_m)?;
        at_least_one("most_positions", self.most_positions)?;
        positive("bearing_sigma_deg", self.bearing_sigma_deg)?;
        let (bearing_sigma, limit) =
            (self.bearing_sigma_deg.to_radians(), self.altitude.elevation_limit);
        RssBearingTurn::new(self.exponent, self.level_sigma_db, bearing_sigma, limit)
    }
}

/// Each drone flies down the gradient of the posterior bound: the log-determinant of the inverse
/// of prior and Fisher information, averaged over the belief, with the next turn in it (Uciński
/// 2004; Martínez & Bullo 2006 move sensors so). It looks one turn ahead, weighs no time and
/// stays in the nearest optimum: a baseline for [`Information`](super::Information).
///
/// It ends with [`Outcome::EllipseReached`], with [`Outcome::LittleToLearn`] where no step makes
/// the bound smaller and another turn from here teaches next to nothing, or with
/// [`Outcome::MoveLimit`].
///
/// Compare the two with this in mind: it takes the transmitter's power for known, so a level counts
/// for more than it does with [`Information`](super::Information), and, by default
/// flies 3 to 4 m up and not 2 to 4 m, and stops after 30 positions and not 60.
#[derive(Clone, Debug)]
pub struct SteepestDescent<S = RssBearingTurn> {
    config: SteepestDescentConfig,
    turn: S,
    measured: u32,
    /// The step taken, in metres, and what its turn is expected to teach, in nats.
    last: Option<(f64, f64)>,
    ended: Option<Outcome>,
}

impl SteepestDescent {
    /// A planner for level and bearing on the figures of the configuration.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the first field that is out of its range.
    pub fn new(config: SteepestDescentConfig) -> Result<Self, ParameterError> {
        let turn = config.turn()?;
        Self::with_turn(config, turn)
    }
}

impl<S: TurnInformation> SteepestDescent<S> {
    /// A planner for any kind of turn; exponent and σs of the configuration make no difference
    /// then.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the first field that is out of its range.
    pub fn with_turn(config: SteepestDescentConfig, turn: S) -> Result<Self, ParameterError> {
        config.turn()?;
        Ok(Self { config, turn, measured: 0, last: None, ended: None })
    }

    /// Returns the steepest step, with its length and its expected information.
    fn step(&self, belief: &dyn Belief, stations: &[Station]) -> Result<Step, PlanError> {
        let cells = Cells::of(belief, |_| PLACES)?;
        let Some(factor) = cells.moments.covariance.cholesky() else {
            return Err(PlanError::NoPlace);
        };
        let prior = factor.solve(&Matrix2::identity());
        let power = Power::of(&self.turn, &cells, &[], 0.0);
        let mut posterior = ExpectedPosterior::default();
        let mut worth = |places: &[Vector3<f64>]| {
            posterior.by_fisher(&self.turn, &cells, &power, &prior, places);
            posterior.nats
        };
        let from: Vec<Vector3<f64>> = stations.iter().map(|s| s.pose.position).collect();
        let raise = |place: &Vector2<f64>| low_over(&self.config.altitude, &cells.moments, place);
        // Central differences, a hundredth of the step wide.
        let width = 0.01 * self.config.step_m;
        let mut slopes = Vec::with_capacity(from.len());
        for drone in 0..from.len() {
            let mut slope = Vector2::zeros();
            for axis in 0..2 {
                let mut moved = from.clone();
                moved[drone][axis] += width;
                let ahead = worth(&moved);
                moved[drone][axis] -= 2.0 * width;
                slope[axis] = ahead - worth(&moved);
            }
            slopes.push(slope.try_normalize(f64::MIN_POSITIVE).unwrap_or_default());
        }
        let stay = worth(&from);
        let mut length_m = self.config.step_m;
        for _ in 0..HALVINGS {
            let ways = from.iter().zip(&slopes);
            let places: Vec<_> =
                ways.map(|(place, slope)| raise(&(place.xy() + slope * length_m))).collect();
            let nats = worth(&places);
            if nats > stay && apart(&places, self.config.separation_m) {
                return Ok(Step { places, length_m, nats });
            }
            length_m *= 0.5;
        }
        Ok(Step { places: from, length_m: 0.0, nats: stay })
    }
}

/// A step of all drones.
struct Step {
    places: Vec<Vector3<f64>>,
    length_m: f64,
    nats: f64,
}

/// Less than this in a turn, without a step, is not worth another one.
const LITTLE_NATS: f64 = 0.02;

impl<S: TurnInformation> FormationPlanner for SteepestDescent<S> {
    fn begin(&mut self, stations: &mut [Station]) -> Result<(), PlanError> {
        flyable(stations)?;
        for station in stations {
            *station = Station::holding(station.pose);
        }
        (self.measured, self.last, self.ended) = (0, None, None);
        Ok(())
    }

    fn plan(
        &mut self,
        belief: &dyn Belief,
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        flyable(stations)?;
        let ellipse_m = semi_major(&belief.position())?;
        let positions = self.measured.saturating_add(1);
        // A belief that is a point has no gradient, and is found all the same.
        let step = if ellipse_m <= self.config.ellipse_m {
            Err(Outcome::EllipseReached)
        } else if positions >= self.config.most_positions {
            Err(Outcome::MoveLimit)
        } else {
            let step = self.step(belief, stations)?;
            let stuck = step.length_m <= 0.0 && step.nats < LITTLE_NATS;
            if stuck { Err(Outcome::LittleToLearn) } else { Ok(step) }
        };
        (self.measured, self.ended) = (positions, step.as_ref().err().copied());
        let step = match step {
            Ok(step) => step,
            Err(outcome) => {
                for station in stations {
                    station.goal = Waypoint { position: station.pose.position };
                }
                return Ok(Decision::Finish(outcome));
            }
        };
        self.last = Some((step.length_m, step.nats));
        for (station, position) in stations.iter_mut().zip(step.places) {
            station.goal = Waypoint { position };
        }
        let near = ellipse_m <= 2.0 * self.config.ellipse_m;
        let stage = if near { Stage::Finishing } else { Stage::Searching };
        Ok(Decision::Listen(stage))
    }

    fn observe(&mut self, reception: &Reception) {
        self.turn.learn(reception);
    }

    fn explain(&self, to: &mut dyn fmt::Write) -> fmt::Result {
        match (self.ended, self.last) {
            (Some(outcome), _) => write!(to, "{outcome} after {} positions", self.measured),
            (None, Some((length_m, nats))) => {
                write!(to, "step of {length_m:.1} m down the bound: {nats:.2} nats")
            }
            (None, None) => to.write_str("listen here, nothing is believed yet"),
        }
    }
}
