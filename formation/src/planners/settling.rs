use core::{f64::consts::TAU, fmt};

use foxhunt_core::{
    Decision, Estimate, Outcome, Stage, Station,
    parameter::{ParameterError, at_least_one, positive, require},
};
use nalgebra::Vector2;

use crate::shape::number;

/// Rule that ends a search that circles its estimate: the estimate has settled, and the drones have
/// then been all around it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(default, deny_unknown_fields))]
pub struct SettlingRule {
    /// The estimate has settled when one formation position moves it by less than this many metres
    /// …
    pub settled_m: f64,
    /// … and at least this many formation positions changed the belief.
    pub least_positions: u32,
    /// Number of rounds that follow then; in one round the drones together pass every direction
    /// from the estimate once.
    pub laps: u32,
    /// The search ends with [`Outcome::MoveLimit`] after this many formation positions.
    pub most_positions: u32,
}

impl Default for SettlingRule {
    /// As in the reference (Pritzl 2018, §5.2): settled below 1 m after 3 positions, then one
    /// round; at most 60 positions.
    fn default() -> Self {
        Self { settled_m: 1.0, least_positions: 3, laps: 1, most_positions: 60 }
    }
}

impl SettlingRule {
    /// Checks that the rule makes sense.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the first field that is out of its range.
    pub fn check(&self) -> Result<(), ParameterError> {
        positive("settled_m", self.settled_m)?;
        at_least_one("most_positions", self.most_positions)?;
        Ok(())
    }
}

/// The drones are on their circle within this factor.
const NEAR: f64 = 1.5;

/// Returns true if drones at this mean distance to the estimate are on a circle about it, in
/// metres.
pub(crate) fn at_radius(mean_distance: f64, radius: f64) -> bool {
    mean_distance <= NEAR * radius
}

/// Returns the drones' mean distance from a place over ground, in metres.
pub(crate) fn mean_distance(place: &Vector2<f64>, stations: &[Station]) -> f64 {
    let sum: f64 = stations.iter().map(|s| (s.pose.position.xy() - place).norm()).sum();
    sum / number(stations.len().max(1))
}

/// A step around the estimate: finite and not 0, of either sense.
pub(crate) fn turning(name: &'static str, step_rad: f64) -> Result<f64, ParameterError> {
    require(step_rad.is_finite() && step_rad.abs() > 0.0, name, step_rad, "finite and not 0")
}

/// State of a search under a [`SettlingRule`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Settling {
    last: Option<Estimate<2>>,
    shift: Option<f64>,
    measured: u32,
    informative: u32,
    turned: f64,
    stage: Stage,
}

impl Settling {
    /// Takes the estimate after one more formation position of `count` drones, who turn by `step`
    /// radians from one to the next. The estimate can settle, and a step of the round be done, only
    /// where they are `near`.
    ///
    /// A position after which the belief is what it was, to the bit, taught nothing: it counts
    /// towards the cap alone.
    pub(crate) fn take(
        &mut self,
        rule: &SettlingRule,
        estimate: Estimate<2>,
        step: f64,
        count: usize,
        near: bool,
    ) -> Decision {
        self.measured = self.measured.saturating_add(1);
        let silent = self.last == Some(estimate);
        self.shift = self.last.map(|last| (estimate.mean - last.mean).norm());
        self.last = Some(estimate);
        if !silent {
            self.informative = self.informative.saturating_add(1);
            let settled = self.shift.is_some_and(|shift| shift < rule.settled_m);
            match self.stage {
                Stage::Finishing if near => {
                    self.turned += step.abs();
                    // Steps that divide the circle must not miss its end by rounding.
                    let round = f64::from(rule.laps) * TAU / number(count.max(1)) - 1e-9;
                    if self.turned >= round {
                        return Decision::Finish(Outcome::Converged);
                    }
                }
                Stage::Searching if near && settled && self.informative >= rule.least_positions => {
                    if rule.laps == 0 {
                        return Decision::Finish(Outcome::Converged);
                    }
                    self.stage = Stage::Finishing;
                }
                Stage::Finishing | Stage::Searching => {}
            }
        }
        if self.measured >= rule.most_positions {
            Decision::Finish(Outcome::MoveLimit)
        } else {
            Decision::Listen(self.stage)
        }
    }
}

impl fmt::Display for Settling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.shift {
            Some(shift) => write!(f, "the estimate moved {shift:.2} m")?,
            None => f.write_str("the first estimate")?,
        }
        write!(f, ", position {}", self.measured)?;
        match self.stage {
            Stage::Searching => Ok(()),
            Stage::Finishing => write!(f, ", {:.0}° of the round done", self.turned.to_degrees()),
        }
    }
}

#[cfg(test)]
mod tests {
    use core::f64::consts::FRAC_PI_6;

    use super::*;

    fn at(east: f64, sigma: f64) -> Estimate<2> {
        Estimate::isotropic(Vector2::new(east, 0.0), sigma)
    }

    #[test]
    fn three_drones_pass_every_direction_in_four_steps() {
        let rule = SettlingRule::default();
        let mut settling = Settling::default();
        let mut take = |estimate, near| settling.take(&rule, estimate, FRAC_PI_6, 3, near);
        assert_eq!(take(at(0.0, 5.0), true), Decision::Listen(Stage::Searching));
        assert_eq!(take(at(0.1, 4.0), true), Decision::Listen(Stage::Searching));
        assert_eq!(take(at(0.2, 3.0), false), Decision::Listen(Stage::Searching));
        assert_eq!(take(at(2.0, 2.5), true), Decision::Listen(Stage::Searching));
        assert_eq!(take(at(2.1, 2.0), true), Decision::Listen(Stage::Finishing));
        for sigma in [1.9, 1.8, 1.7] {
            assert_eq!(take(at(2.1, sigma), true), Decision::Listen(Stage::Finishing));
        }
        assert_eq!(take(at(2.1, 1.6), true), Decision::Finish(Outcome::Converged));
    }

    #[test]
    fn a_round_is_done_near_the_estimate_only() {
        let rule = SettlingRule::default();
        let mut settling = Settling::default();
        let mut take = |sigma, near| settling.take(&rule, at(0.0, sigma), FRAC_PI_6, 6, near);
        take(5.0, true);
        take(4.0, true);
        assert_eq!(take(3.0, true), Decision::Listen(Stage::Finishing));
        for sigma in [2.9, 2.8, 2.7] {
            assert_eq!(take(sigma, false), Decision::Listen(Stage::Finishing));
        }
        assert_eq!(take(2.6, true), Decision::Listen(Stage::Finishing));
        assert_eq!(take(2.5, true), Decision::Finish(Outcome::Converged));
    }

    #[test]
    fn silence_is_no_success_and_has_an_end() {
        let rule = SettlingRule { most_positions: 9, ..SettlingRule::default() };
        let mut settling = Settling::default();
        let mut take = || settling.take(&rule, at(1.0, 2.0), FRAC_PI_6, 1, true);
        for _ in 1..9 {
            assert_eq!(take(), Decision::Listen(Stage::Searching));
        }
        assert_eq!(take(), Decision::Finish(Outcome::MoveLimit));
    }

    #[test]
    fn what_makes_no_rule_is_named() {
        let rule = SettlingRule::default();
        assert_eq!(rule.check(), Ok(()));
        let bad = SettlingRule { settled_m: 0.0, ..rule };
        assert_eq!(bad.check().map_err(|error| error.name), Err("settled_m"));
        let bad = SettlingRule { most_positions: 0, ..rule };
        assert_eq!(bad.check().map_err(|error| error.name), Err("most_positions"));
    }
}
