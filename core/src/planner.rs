use core::fmt;

use crate::{BeaconId, Belief, Pose, Reception, Waypoint};

/// One drone's place in the formation: where it is and where it shall go.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Station {
    /// The drone's present pose.
    pub pose: Pose,
    /// The place that it flies to.
    pub goal: Waypoint,
}

impl Station {
    /// A drone that stays where it is.
    #[must_use]
    pub fn holding(pose: Pose) -> Self {
        Self { pose, goal: Waypoint { position: pose.position } }
    }
}

/// One of a planner's targets: a beacon, and the belief about its place.
#[derive(Clone, Copy)]
pub struct Target<'a> {
    /// The beacon's identifier.
    pub beacon: BeaconId,
    /// The belief about its place.
    pub belief: &'a dyn Belief,
}

impl fmt::Debug for Target<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let position = self.belief.position();
        f.debug_struct("Target").field("beacon", &self.beacon).field("position", &position).finish()
    }
}

/// Decides where each drone listens next, and when the target is found.
///
/// There is a station for each drone that takes part at that moment: their number and order may
/// differ from one call to the next, as drones drop out and come back. The assignment of drones to
/// goals is not the planner's concern: goals are places for the formation, whose caller may
/// exchange them.
///
/// # Laws
///
/// Checked by `laws::formation_planner`, feature `laws`: goals are finite; on an error no goal
/// is changed; one to eight drones may come and go between calls; without a target there is
/// [`PlanError::NoPlace`]; every decision is explained.
pub trait FormationPlanner {
    /// Starts on a new target: sets the goals from where the drones are now. Unless overridden,
    /// everyone listens where it is.
    ///
    /// # Errors
    ///
    /// On any error no goal is changed.
    fn begin(&mut self, stations: &mut [Station]) -> Result<(), PlanError> {
        for station in stations {
            *station = Station::holding(station.pose);
        }
        Ok(())
    }

    /// Starts on a target that was received while another one was searched for, so that a belief
    /// exists already. Unless overridden, the belief makes no difference.
    ///
    /// # Errors
    ///
    /// On any error no goal is changed.
    fn resume(&mut self, belief: &dyn Belief, stations: &mut [Station]) -> Result<(), PlanError> {
        let _ = belief;
        self.begin(stations)
    }

    /// Sets the goal of every station from the belief about the target, after each drone had
    /// its turn at the goals set before.
    ///
    /// # Errors
    ///
    /// On any error no goal is changed.
    fn plan(
        &mut self,
        belief: &dyn Belief,
        stations: &mut [Station],
    ) -> Result<Decision, PlanError>;

    /// Sets the goals from the beliefs about all unfinished targets that every turn listens for. A
    /// hunt calls this method. The first target is the target of [`begin`](Self::begin) or
    /// [`resume`](Self::resume), and [`Decision::Finish`] is about the first target. Unless
    /// overridden, the others make no difference.
    ///
    /// # Errors
    ///
    /// [`PlanError::NoPlace`] where there is no target; on any error no goal is changed.
    fn plan_together(
        &mut self,
        targets: &[Target<'_>],
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        let target = targets.first().ok_or(PlanError::NoPlace)?;
        self.plan(target.belief, stations)
    }

    /// Returns true if the plan goes on where nothing was received: after the last attempt at a
    /// place, the next plan is made with the belief as it was. False unless overridden, because a
    /// planner that follows an estimate takes one that did not move for one that has settled.
    fn goes_on_without_signal(&self) -> bool {
        false
    }

    /// Takes note of a reception that an estimator has just fused, for planners that go by
    /// receptions and their places. It may be of any beacon of the turn; the reception names it.
    /// Unless overridden, it makes no difference.
    fn observe(&mut self, reception: &Reception) {
        let _ = reception;
    }

    /// Writes in a few words why the last decision was taken, for the log. Unless overridden,
    /// nothing.
    ///
    /// # Errors
    ///
    /// The errors of `to`.
    fn explain(&self, to: &mut dyn fmt::Write) -> fmt::Result {
        let _ = to;
        Ok(())
    }
}

/// A planner's decision: listen at the goals, or finish the search.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Decision {
    /// Go to the goals and listen there.
    Listen(Stage),
    /// The search for this target is over; the drones go to the goals all the same.
    Finish(Outcome),
}

/// Progress of a search.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Stage {
    /// The target's place is still moving in the belief.
    #[default]
    Searching,
    /// The target is found; a few more turns make its place more certain.
    Finishing,
}

/// Result of a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Outcome {
    /// The planner's rule was met.
    Converged,
    /// The planner's rule was met, and the ellipse that holds the target with 95 % is larger than
    /// was asked for.
    Settled,
    /// The planner's cap on moves was reached first.
    MoveLimit,
    /// The path that was planned beforehand is flown.
    PathDone,
    /// Nothing was received of the target, however often it was listened for.
    #[cfg_attr(feature = "serde", serde(alias = "nothing_heard"))]
    NoSignal,
    /// The target was received, and then no longer; the estimate is of the signals received.
    SignalLost,
    /// The ellipse that holds it with 95 % is as small as required.
    EllipseReached,
    /// Another turn would teach less than is worth its time.
    LittleToLearn,
    /// The time or the batteries for the search are used up.
    BudgetSpent,
    /// No drone is left that could listen.
    NoDrones,
    /// There was no plan any more, or no permitted way home; the log holds the reason.
    NoPlan,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Converged => "converged",
            Self::Settled => "settled, ellipse too large",
            Self::MoveLimit => "move limit reached",
            Self::PathDone => "path flown",
            Self::NoSignal => "no signal",
            Self::SignalLost => "signal lost",
            Self::EllipseReached => "ellipse small enough",
            Self::LittleToLearn => "little more to learn",
            Self::BudgetSpent => "budget spent",
            Self::NoDrones => "no drone left",
            Self::NoPlan => "no plan",
        })
    }
}

/// Reason that there is no plan.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// The formation needs more drones.
    #[error("the formation needs {needed} drones and has {have}")]
    TooFew {
        /// Number of drones that the formation needs.
        needed: usize,
        /// Number of drones that it has.
        have: usize,
    },
    /// There is no place to go to.
    #[error("there is no place to go to")]
    NoPlace,
    /// The belief, or a place to go to, holds NaN or infinity.
    #[error("the place ({east}, {north}) m is not finite")]
    NotFinite {
        /// East of the place, in metres.
        east: f64,
        /// North of the place, in metres.
        north: f64,
    },
}

/// A planner made of a closure.
///
/// ```
/// use foxhunt_core::{Belief, Decision, Stage, Station, planner_fn};
/// let follow = planner_fn(|belief: &dyn Belief, stations: &mut [Station]| {
///     for station in stations {
///         station.goal.position.x = belief.position().mean.x;
///     }
///     Ok(Decision::Listen(Stage::Searching))
/// });
/// # let _ = follow;
/// ```
pub fn planner_fn<F>(plan: F) -> PlannerFn<F>
where
    F: FnMut(&dyn Belief, &mut [Station]) -> Result<Decision, PlanError>,
{
    PlannerFn(plan)
}

/// The planner that [`planner_fn`] makes.
#[derive(Clone, Copy, Debug)]
pub struct PlannerFn<F>(F);

impl<F> FormationPlanner for PlannerFn<F>
where
    F: FnMut(&dyn Belief, &mut [Station]) -> Result<Decision, PlanError>,
{
    fn plan(
        &mut self,
        belief: &dyn Belief,
        stations: &mut [Station],
    ) -> Result<Decision, PlanError> {
        (self.0)(belief, stations)
    }
}
