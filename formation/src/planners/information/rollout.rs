use alloc::vec::Vec;

use foxhunt_core::elementary;
use nalgebra::{Vector2, Vector3};

use super::{InformationConfig, Objective, TurnInformation, cells::Cell, worth::ExpectedPosterior};
use crate::shape::number;

/// χ²₂ at 95 %.
pub(super) const CHI_SQUARED_95: f64 = 5.991_464_547_107_979;

/// The ranges that the worth of a drone is tabled for: from 0.5 m on in steps of a twelfth.
const RANGES: u16 = 80;
const NEAREST_M: f64 = 0.5;
const STEP: f64 = 13.0 / 12.0;
/// ln `STEP`.
const LN_STEP: f64 = 0.080_042_707_673_536_36;

/// What is expected of the turns after the next one: from then on a regular formation follows the
/// estimate. (A rollout of a base policy; Bertsekas 2020, §2.)
///
/// The formation is as small as suits a target in its middle, and the estimate's own spread adds to
/// the distance at which it is received.
#[derive(Clone, Debug)]
pub(super) struct Rollout {
    config: InformationConfig,
    drones: f64,
    /// Half the trace of a drone's Fisher information, over the range.
    worth: Vec<f64>,
    /// The distance on the ground at which a drone measures a target best.
    best_m: f64,
    /// The variance at which the ellipse is as small as wanted.
    wanted: f64,
}

/// What a plan comes to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Course {
    /// Until the ellipse is small enough, in seconds.
    pub(super) to_ellipse_s: f64,
    /// What is learned within the horizon, in nats, where the rate of that is made best, and how
    /// long it takes.
    pub(super) nats: f64,
    pub(super) seconds: f64,
}

impl Rollout {
    pub(super) fn new<S: TurnInformation + ?Sized>(
        turn: &S,
        config: &InformationConfig,
        drones: usize,
    ) -> Self {
        let (mut worth, mut best) = (Vec::new(), (0.0, NEAREST_M));
        let mut range = NEAREST_M;
        for _ in 0..RANGES {
            let place = Vector3::new(range, 0.0, config.altitude.altitude(range));
            let half = 0.5 * turn.fisher(&Vector2::zeros(), &place).total().trace();
            if half > best.0 {
                best = (half, range);
            }
            worth.push(half);
            range *= STEP;
        }
        let wanted = config.ellipse_m * config.ellipse_m / CHI_SQUARED_95;
        Self { config: *config, drones: number(drones), worth, best_m: best.1, wanted }
    }

    /// The distance on the ground at which a drone measures a target best, in metres.
    pub(super) fn best_m(&self) -> f64 {
        self.best_m
    }

    /// Half the trace of a drone's information at a squared distance on the ground.
    fn worth(&self, range2: f64) -> f64 {
        let steps = elementary::ln(range2 * (1.0 / (NEAREST_M * NEAREST_M))) * (0.5 / LN_STEP);
        let last = self.worth.len() - 1;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "cut off at both ends"
        )]
        let index = (steps.max(0.0) as usize).min(last);
        let (here, next) = (self.worth[index], self.worth[(index + 1).min(last)]);
        let share = steps - number(index);
        if index == last {
            // Beyond the table information falls with the square of the range.
            here * libm::exp(-2.0 * share * LN_STEP)
        } else {
            here + (next - here) * share.max(0.0)
        }
    }

    /// What follows once the posterior has these variances, the larger first, and the drones that
    /// are farthest have to fly `distance` metres to the estimate.
    fn follow(&self, [mut large, mut small]: [f64; 2], distance: f64) -> Course {
        // What is not known to become small never does.
        if !(large.is_finite() && small.is_finite()) {
            return Course { to_ellipse_s: f64::INFINITY, nats: f64::NEG_INFINITY, seconds: 0.0 };
        }
        let mut course = Course::default();
        let mut travel = (distance - self.best_m).max(0.0);
        let mut turn = 1;
        while large > self.wanted {
            let range2 = self.best_m * self.best_m + large + small;
            let worth = self.drones * self.worth(range2);
            let grown = [1.0 + large * worth, 1.0 + small * worth];
            let moved = travel / self.config.speed_mps;
            // No logarithms but for the last turn.
            let enough = large <= self.wanted * grown[0];
            if enough || turn >= self.config.horizon {
                // It counts as much as it takes, so that small differences are felt; beyond the
                // horizon every turn is as good as this one would be.
                let gain = libm::log1p(large * worth);
                let share = libm::log(large / self.wanted) / gain.max(f64::MIN_POSITIVE);
                let seconds = moved + share * self.config.turn_s;
                course.to_ellipse_s += seconds;
                if turn < self.config.horizon {
                    course.seconds += seconds;
                    if self.config.objective == Objective::InformationRate {
                        course.nats += 0.5 * share * (gain + libm::log1p(small * worth));
                    }
                }
                return course;
            }
            let seconds = moved + self.config.turn_s;
            course.to_ellipse_s += seconds;
            course.seconds += seconds;
            if self.config.objective == Objective::InformationRate {
                course.nats += 0.5 * libm::log(grown[0] * grown[1]);
            }
            travel = libm::sqrt(large + small);
            large /= grown[0];
            small /= grown[1];
            turn += 1;
        }
        course
    }

    /// What follows a turn at `places` that leaves this of a belief of these cells, on average.
    pub(super) fn after(
        &self,
        posterior: &ExpectedPosterior,
        cells: &[Cell],
        places: &[Vector3<f64>],
    ) -> Course {
        let mut mean = Course { nats: posterior.nats, ..Course::default() };
        for (cell, axes) in cells.iter().zip(&posterior.axes) {
            let square = |place: &Vector3<f64>| (place.xy() - cell.mean).norm_squared();
            let farthest = libm::sqrt(places.iter().map(square).fold(0.0, f64::max));
            let course = self.follow(*axes, farthest);
            mean.to_ellipse_s += cell.weight * course.to_ellipse_s;
            mean.nats += cell.weight * course.nats;
            mean.seconds += cell.weight * course.seconds;
        }
        mean
    }

    /// How good a plan is that begins with so many seconds and goes on so; smaller is better, and
    /// what is no finite number is worst.
    pub(super) fn cost(&self, seconds: f64, course: &Course) -> f64 {
        let cost = match self.config.objective {
            Objective::TimeToEllipse => seconds + course.to_ellipse_s,
            Objective::InformationRate => -course.nats / (seconds + course.seconds),
        };
        if cost.is_finite() { cost } else { f64::INFINITY }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_the_information_and_beyond_it_as_well() {
        let config = InformationConfig::default();
        let turn = config.turn().expect("in range");
        let rollout = Rollout::new(&turn, &config, 3);
        for range in [3.0, 10.0, 40.0, 250.0, 280.0, 300.0, 400.0, 2000.0] {
            let place = Vector3::new(range, 0.0, config.altitude.altitude(range));
            let truth = 0.5 * turn.fisher(&Vector2::zeros(), &place).total().trace();
            let ratio = rollout.worth(range * range) / truth;
            assert!((ratio - 1.0).abs() < 0.02, "{ratio} at {range} m");
        }
    }

    #[test]
    fn what_is_not_finite_costs_most() {
        for objective in [Objective::TimeToEllipse, Objective::InformationRate] {
            let config = InformationConfig { objective, ..InformationConfig::default() };
            let turn = config.turn().expect("in range");
            let rollout = Rollout::new(&turn, &config, 3);
            for axes in [[f64::NAN, 1.0], [f64::INFINITY; 2], [4.0, f64::NAN]] {
                let cost = rollout.cost(45.0, &rollout.follow(axes, 10.0));
                assert!(cost.is_infinite() && cost > 0.0, "{axes:?}: {cost}");
            }
            for nats in [f64::NAN, f64::INFINITY] {
                let course = Course { nats, to_ellipse_s: nats, seconds: 1.0 };
                assert!(rollout.cost(45.0, &course) > f64::MAX);
            }
            let fine = rollout.cost(45.0, &rollout.follow([4.0, 1.0], 10.0));
            assert!(fine.is_finite());
        }
    }
}
