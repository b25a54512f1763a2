use alloc::vec::Vec;
use core::fmt;

use foxhunt_core::{
    BeaconId, Belief, Decision, Estimate, FormationPlanner, Outcome, PlanError, Reception, Stage,
    Station, Target, Waypoint, parameter::ParameterError,
};
use nalgebra::Vector2;

use super::{
    InformationConfig, LevelRecord, RssBearingTurn, TurnInformation,
    search::{Form, Plan, Search, exchanged, farthest},
};
use crate::planners::centroid;

/// The information-driven planner: listens where the ellipse of what is believed is expected to
/// become small soonest.
///
/// For each formation out of many (turning again where everyone is, polygons, lines, arcs and
/// scattered places, at the mean, beside it, on the way to it and at the modes of the belief) it
/// computes what the turn there is expected to leave of the belief ([`Criterion`]), and from
/// that, with travel and turns in seconds, how long it takes until the ellipse is small enough when
/// a regular formation follows the estimate after it ([`Objective`]). The best ones are refined
/// drone by drone.
///
/// With several targets the times of all are summed, so targets with wide ellipses count most; a
/// target whose ellipse is small enough counts nothing.
///
/// It ends with [`Outcome::EllipseReached`], [`Outcome::LittleToLearn`] or
/// [`Outcome::MoveLimit`].
///
/// [`Criterion`]: super::Criterion
/// [`Objective`]: super::Objective
#[derive(Clone, Debug)]
pub struct Information<S = RssBearingTurn> {
    config: InformationConfig,
    turn: S,
    levels: LevelRecord,
    measured: u32,
    account: Account,
}

/// A target: which beacon it is, where that is known, and what is believed of it.
type TargetBelief<'a> = (Option<BeaconId>, &'a dyn Belief);

/// Account of the last decision.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Account {
    None,
    Listen { moved_m: f64, form: Form, refined: bool, best: Worth, again: Worth },
    Finish { outcome: Outcome, ellipse_m: f64, best: Option<Worth>, positions: u32 },
}

/// Expected information of a plan's turn, and the time for it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Worth {
    nats: f64,
    seconds: f64,
}

impl fmt::Display for Worth {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.2} nats in {:.0} s", self.nats, self.seconds)
    }
}

impl From<&Plan> for Worth {
    fn from(plan: &Plan) -> Self {
        Self { nats: plan.nats, seconds: plan.seconds }
    }
}

impl Information {
    /// A planner for level and bearing on the figures of the configuration.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the first field that is out of its range.
    pub fn new(config: InformationConfig) -> Result<Self, ParameterError> {
        let turn = config.turn()?;
        Self::with_turn(config, turn)
    }
}

impl<S: TurnInformation> Information<S> {
    /// A planner for any kind of turn; exponent and σs of the configuration make no difference
    /// then.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the first field that is out of its range.
    pub fn with_turn(config: InformationConfig, turn: S) -> Result<Self, ParameterError> {
        config.check()?;
        Ok(Self {
            config,
            turn,
            levels: LevelRecord::default(),
            measured: 0,
            account: Account::None,
        })
    }

    /// Sets the goals by the best plan, and keeps why.
    fn go(
        &mut self,
        beliefs: &[TargetBelief<'_>],
        stations: &mut [Station],
    ) -> Result<Worth, PlanError> {
        let turn = &self.turn;
        let config = &self.config;
        let mut search = Search::new(turn, config, &self.levels, beliefs, stations)?;
        let (best, again) = search.best();
        let from: Vec<_> = stations.iter().map(|station| station.pose.position).collect();
        let goals = exchanged(&from, &best.candidate.places);
        if let Some(goal) = goals.iter().find(|goal| !goal.iter().all(|c| c.is_finite())) {
            return Err(PlanError::NotFinite { east: goal.x, north: goal.y });
        }
        self.account = Account::Listen {
            moved_m: farthest(&from, &goals).over_ground_m,
            form: best.candidate.form,
            refined: best.refined,
            best: Worth::from(&best),
            again: Worth::from(&again),
        };
        for (station, position) in stations.iter_mut().zip(goals) {
            station.goal = Waypoint { position };
        }
        Ok(Worth::from(&best))
    }

    fn decide(
        &mut self,
        beliefs: &[TargetBelief<'_>],
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        let before = self.levels.clone();
        let targets: Vec<_> =
            beliefs.iter().map(|(beacon, belief)| (*beacon, belief.position().mean)).collect();
        self.levels.search(&targets);
        let decision = self.choose(beliefs, stations);
        if decision.is_err() {
            self.levels = before;
        }
        decision
    }

    fn choose(
        &mut self,
        beliefs: &[TargetBelief<'_>],
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        flyable(stations)?;
        let first = beliefs.first().ok_or(PlanError::NoPlace)?.1.position();
        let ellipse_m = semi_major(&first)?;
        let positions = self.measured.saturating_add(1);
        let finish = |planner: &mut Self, outcome, best, stations: &mut [Station]| {
            planner.measured = positions;
            planner.account = Account::Finish { outcome, ellipse_m, best, positions };
            for station in stations {
                station.goal = Waypoint { position: station.pose.position };
            }
            Ok(Decision::Finish(outcome))
        };
        if ellipse_m <= self.config.ellipse_m {
            return finish(self, Outcome::EllipseReached, None, stations);
        }
        if positions >= self.config.most_positions {
            return finish(self, Outcome::MoveLimit, None, stations);
        }
        let wide: Vec<TargetBelief<'_>> = core::iter::once(Ok(beliefs[0]))
            .chain(beliefs[1..].iter().filter_map(|belief| {
                match semi_major(&belief.1.position()) {
                    Ok(axis) if axis <= self.config.ellipse_m => None,
                    Ok(_) => Some(Ok(*belief)),
                    Err(error) => Some(Err(error)),
                }
            }))
            .collect::<Result<_, _>>()?;
        let best = self.go(&wide, stations)?;
        if best.nats < self.config.least_nats_per_s * best.seconds {
            return finish(self, Outcome::LittleToLearn, Some(best), stations);
        }
        self.measured = positions;
        let near = ellipse_m <= 2.0 * self.config.ellipse_m;
        Ok(Decision::Listen(if near { Stage::Finishing } else { Stage::Searching }))
    }
}

impl<S: TurnInformation> FormationPlanner for Information<S> {
    fn begin(&mut self, stations: &mut [Station]) -> Result<(), PlanError> {
        flyable(stations)?;
        if self.config.prior_sigma_m > 0.0 {
            let middle = centroid(stations)?;
            let centre = self.config.prior_centre_m.map_or(middle, Vector2::from);
            let prior = Estimate::isotropic(centre, self.config.prior_sigma_m);
            self.go(&[(None, &prior)], stations)?;
        } else {
            for station in stations {
                *station = Station::holding(station.pose);
            }
            self.account = Account::None;
        }
        self.levels.begin();
        self.measured = 0;
        Ok(())
    }

    fn resume(&mut self, belief: &dyn Belief, stations: &mut [Station]) -> Result<(), PlanError> {
        flyable(stations)?;
        let beacon = self.levels.resumed(&belief.position().mean);
        self.go(&[(beacon, belief)], stations)?;
        self.levels.resume(beacon);
        self.measured = 0;
        Ok(())
    }

    fn plan(
        &mut self,
        belief: &dyn Belief,
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        self.decide(&[(self.levels.first(), belief)], stations)
    }

    fn plan_together(
        &mut self,
        targets: &[Target<'_>],
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        let beliefs: Vec<TargetBelief<'_>> =
            targets.iter().map(|target| (Some(target.beacon), target.belief)).collect();
        self.decide(&beliefs, stations)
    }

    /// Learns from any beacon: each one's power is known from its own levels, and how sure bearings
    /// are from all of them.
    fn observe(&mut self, reception: &Reception) {
        self.turn.learn(reception);
        self.levels.add(reception);
    }

    fn explain(&self, to: &mut dyn fmt::Write) -> fmt::Result {
        match self.account {
            Account::None => write!(to, "listen here, nothing is believed yet"),
            Account::Listen { form: Form::Stay, best, .. } => write!(to, "turn again: {best}"),
            Account::Listen { moved_m, form, refined, best, again } => {
                let refined = if refined { ", refined" } else { "" };
                write!(to, "move {moved_m:.0} m, {form}{refined}: {best}; turning again {again}")
            }
            Account::Finish { outcome, ellipse_m, best, positions } => {
                write!(to, "{outcome}: ellipse {ellipse_m:.2} m after {positions} positions")?;
                match best {
                    Some(best) => write!(to, ", another turn {best}"),
                    None => Ok(()),
                }
            }
        }
    }
}

/// Checks that there is a drone and that every drone's place is finite.
pub(super) fn flyable(stations: &[Station]) -> Result<(), PlanError> {
    if stations.is_empty() {
        return Err(PlanError::TooFew { needed: 1, have: 0 });
    }
    match stations.iter().map(|s| s.pose.position).find(|p| !p.iter().all(|c| c.is_finite())) {
        Some(place) => Err(PlanError::NotFinite { east: place.x, north: place.y }),
        None => Ok(()),
    }
}

/// The semi-major axis of the 95 % ellipse; 0 for a belief that is a point.
pub(super) fn semi_major(position: &Estimate<2>) -> Result<f64, PlanError> {
    let numbers = position.mean.iter().chain(position.covariance.iter());
    if !numbers.copied().all(f64::is_finite) {
        return Err(PlanError::NotFinite { east: position.mean.x, north: position.mean.y });
    }
    let [large, _] = super::worth::axes(&position.covariance);
    Ok(libm::sqrt(super::rollout::CHI_SQUARED_95 * large.max(0.0)))
}
