use alloc::boxed::Box;

use foxhunt_core::{
    elementary::{ln, sqrt},
    vectorised::{self, Kernel},
};
use nalgebra::{Vector2, Vector3};

use super::{
    CellBlock, Column, InformationConfig, Objective, TARGETS, TurnInformation, dot,
    worth::{ExpectedPosterior, Left},
};
use crate::shape::number;

/// χ²₂ at 95 %.
pub(super) const CHI_SQUARED_95: f64 = 5.991_464_547_107_979;

/// The squared ranges that the worth of the drones is tabled for: from a power of two on, eight for
/// each doubling, so that the first bits of a number are its place in the table.
const RANGES: usize = 512;
const NEAREST_M2: f64 = 0.25;
const FARTHEST_M2: f64 = 4e18;
/// Number of bits of a number that follow those.
const REST: u32 = 49;

/// Expectation of the turns after the next one: from then on a regular formation follows the
/// estimate. (A rollout of a base policy; Bertsekas 2020, §2.)
///
/// The formation is as small as suits a target in its middle, and the estimate's own spread adds to
/// the distance at which it is received.
#[derive(Clone, Debug)]
pub(super) struct Rollout {
    config: InformationConfig,
    /// Half the trace of the Fisher information of all drones at a range, and what it changes until
    /// the next one.
    worth: Box<[[f64; 2]; RANGES]>,
    /// The distance on the ground at which a drone measures a target best.
    best_m: f64,
    /// The variance at which the ellipse is as small as wanted.
    wanted: f64,
}

/// Expected course of a plan.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Course {
    /// Until the ellipse is small enough, in seconds.
    pub to_ellipse_s: f64,
    /// Information within the horizon, in nats, where its rate is the objective, and its duration.
    pub nats: f64,
    pub seconds: f64,
}

/// Courses for many cells.
struct Courses {
    to_ellipse_s: Column,
    nats: Column,
    seconds: Column,
}

/// ln(1 + x), for tiny x as well.
#[inline(always)]
fn ln_1p(x: f64) -> f64 {
    let sum = 1.0 + x;
    ln(sum) + (x - (sum - 1.0)) / sum
}

/// The squared range of a place in the table.
fn squared_range(index: usize) -> f64 {
    f64::from_bits(NEAREST_M2.to_bits() + ((index as u64) << REST))
}

/// The mean of what follows over the cells.
struct After<'a, const RATE: bool> {
    rollout: &'a Rollout,
    left: &'a [Left],
    cells: &'a [CellBlock],
}

impl<const RATE: bool> Kernel for After<'_, RATE> {
    type Output = Course;

    #[inline(always)]
    fn run(self) -> Course {
        let mut mean = Course::default();
        for (left, cells) in self.left.iter().zip(self.cells) {
            let courses = self.rollout.follow::<RATE>(left);
            mean.to_ellipse_s += dot(&courses.to_ellipse_s, &cells.weight);
            if RATE {
                mean.nats += dot(&courses.nats, &cells.weight);
                mean.seconds += dot(&courses.seconds, &cells.weight);
            }
        }
        mean
    }
}

impl Rollout {
    pub(super) fn new<S: TurnInformation + ?Sized>(
        turn: &S,
        config: &InformationConfig,
        drones: usize,
    ) -> Self {
        let mut worth = Box::new([[0.0; 2]; RANGES]);
        let mut best = (0.0, 0.0);
        for index in (0..RANGES).rev() {
            let range = libm::sqrt(squared_range(index));
            let place = Vector3::new(range, 0.0, config.altitude.altitude(range));
            let half = 0.5 * turn.fisher(&Vector2::zeros(), &place).total().trace();
            if half > best.0 {
                best = (half, range);
            }
            let here = half * number(drones);
            let next = worth.get(index + 1).map_or(here, |next: &[f64; 2]| next[0]);
            worth[index] = [here, next - here];
        }
        let wanted = config.ellipse_m * config.ellipse_m / CHI_SQUARED_95;
        Self { config: *config, worth, best_m: best.1, wanted }
    }

    /// The distance on the ground at which a drone measures a target best, in metres.
    pub(super) fn best_m(&self) -> f64 {
        self.best_m
    }

    /// Half the trace of the information of all drones about a target in the middle of a formation,
    /// with these variances of where it is.
    #[inline(always)]
    fn worths(&self, large: &Column, small: &Column) -> Column {
        let nearest2 = self.best_m * self.best_m;
        let mut places = [0_u64; TARGETS];
        let mut shares = [0.0; TARGETS];
        for i in 0..TARGETS {
            let range2 = nearest2 + large[i] + small[i];
            let bits = range2.clamp(NEAREST_M2, FARTHEST_M2).to_bits();
            places[i] = (bits - NEAREST_M2.to_bits()) >> REST;
            let share = ((bits & ((1 << REST) - 1)) << (52 - REST)) | 1.0_f64.to_bits();
            shares[i] = f64::from_bits(share) - 1.0;
        }
        let mut heres = [0.0; TARGETS];
        let mut changes = [0.0; TARGETS];
        for i in 0..TARGETS {
            #[expect(clippy::cast_possible_truncation, reason = "the table has as many places")]
            let [here, change] = self.worth[places[i] as usize % RANGES];
            heres[i] = here;
            changes[i] = change;
        }
        for i in 0..TARGETS {
            heres[i] += changes[i] * shares[i];
        }
        heres
    }

    /// Returns the courses from posteriors with these variances, the larger first, and these
    /// distances of the farthest drones from the target; with nats and seconds only where `RATE`.
    #[inline(always)]
    fn follow<const RATE: bool>(&self, left: &Left) -> Courses {
        let turn_s = self.config.turn_s;
        let horizon = self.config.horizon;
        let pace = 1.0 / self.config.speed_mps;
        let [mut large, mut small] = left.axes;
        let mut travel = left.farthest2;
        travel.iter_mut().for_each(|way| *way = (sqrt(*way) - self.best_m).max(0.0));
        let mut seconds = [0.0; TARGETS];
        let mut grown = [1.0; TARGETS];
        // Targets that need no more turns stay as they are: 0 in this column.
        let mut on = [1_u64; TARGETS];
        for _ in 1..horizon {
            let worths = self.worths(&large, &small);
            let mut any = 0;
            for i in 0..TARGETS {
                let worth = worths[i];
                let by_large = 1.0 + large[i] * worth;
                let by_small = 1.0 + small[i] * worth;
                let both = by_large * by_small;
                let inverse = 1.0 / both;
                let way = sqrt(large[i] + small[i]);
                let moved = travel[i] * pace + turn_s;
                // No logarithms but for the last turn.
                let more = large[i] > self.wanted * by_large;
                let choose = |then: f64, other: f64| if more { then } else { other };
                seconds[i] += choose(moved, 0.0);
                grown[i] *= choose(both, 1.0);
                travel[i] = choose(way, travel[i]);
                large[i] *= choose(by_small * inverse, 1.0);
                small[i] *= choose(by_large * inverse, 1.0);
                on[i] = u64::from(more);
                any |= on[i];
            }
            if any == 0 {
                break;
            }
        }
        let mut courses =
            Courses { to_ellipse_s: [0.0; TARGETS], nats: [0.0; TARGETS], seconds: [0.0; TARGETS] };
        let worths = self.worths(&large, &small);
        let mut gains = [0.0; TARGETS];
        let mut shares = [0.0; TARGETS];
        for i in 0..TARGETS {
            gains[i] = ln_1p(large[i] * worths[i]);
        }
        for i in 0..TARGETS {
            shares[i] = ln(large[i] / self.wanted);
        }
        for i in 0..TARGETS {
            // It counts as much as it takes, so that small differences are felt; beyond the
            // horizon every turn is as good as this one would be.
            let share = shares[i] / gains[i].max(f64::MIN_POSITIVE);
            let last = travel[i] * pace + share * turn_s;
            let last = if large[i] > self.wanted { last } else { 0.0 };
            // What is not known to become small never does.
            let known = (left.axes[0][i] < f64::INFINITY) & (left.axes[1][i] < f64::INFINITY);
            courses.to_ellipse_s[i] = if known { seconds[i] + last } else { f64::INFINITY };
            if RATE {
                let counted = (large[i] > self.wanted) & (on[i] == 0);
                courses.seconds[i] = seconds[i] + if counted { last } else { 0.0 };
                let more = 0.5 * share * (gains[i] + ln_1p(small[i] * worths[i]));
                let nats = 0.5 * ln(grown[i]) + if counted { more } else { 0.0 };
                courses.nats[i] = if known { nats } else { f64::NEG_INFINITY };
            }
        }
        courses
    }

    /// Returns the mean course after a turn that leaves this posterior of a belief of these cells.
    pub(super) fn after(&self, posterior: &ExpectedPosterior, cells: &[CellBlock]) -> Course {
        let rollout = self;
        let left = &posterior.left[..];
        let mut mean = match self.config.objective {
            Objective::TimeToEllipse => vectorised::run(After::<false> { rollout, left, cells }),
            Objective::InformationRate => vectorised::run(After::<true> { rollout, left, cells }),
        };
        mean.nats += posterior.nats;
        mean
    }

    /// Returns the cost of a plan that begins with `seconds` and goes on with `course`; smaller is
    /// better, and a cost that is not finite is worst.
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
    use approx::abs_diff_eq;

    fn rollout(config: &InformationConfig, drones: usize) -> Rollout {
        Rollout::new(&config.turn().expect("in range"), config, drones)
    }

    fn left(axes: [f64; 2], distance: f64) -> Left {
        Left { axes: axes.map(|axis| [axis; TARGETS]), farthest2: [distance * distance; TARGETS] }
    }

    /// Returns the course of one target, turn by turn.
    fn one(rollout: &Rollout, [mut large, mut small]: [f64; 2], distance: f64) -> Course {
        let config = &rollout.config;
        let mut course = Course::default();
        let mut travel = (distance - rollout.best_m).max(0.0);
        let mut turn = 1;
        while large > rollout.wanted {
            let worth = rollout.worths(&[large; TARGETS], &[small; TARGETS])[0];
            let grown = [1.0 + large * worth, 1.0 + small * worth];
            let moved = travel / config.speed_mps;
            if large <= rollout.wanted * grown[0] || turn >= config.horizon {
                let gain = libm::log1p(large * worth);
                let share = libm::log(large / rollout.wanted) / gain;
                let seconds = moved + share * config.turn_s;
                course.to_ellipse_s += seconds;
                if turn < config.horizon {
                    course.seconds += seconds;
                    course.nats += 0.5 * share * (gain + libm::log1p(small * worth));
                }
                return course;
            }
            course.to_ellipse_s += moved + config.turn_s;
            course.seconds += moved + config.turn_s;
            course.nats += 0.5 * libm::log(grown[0] * grown[1]);
            travel = libm::sqrt(large + small);
            large /= grown[0];
            small /= grown[1];
            turn += 1;
        }
        course
    }

    #[test]
    fn many_targets_are_followed_as_one() {
        for (horizon, drones) in [(1, 3), (2, 1), (3, 8), (8, 3), (10, 1)] {
            let config = InformationConfig { horizon, ..InformationConfig::default() };
            let rollout = rollout(&config, drones);
            for step in 0..400 {
                let large = 0.1 * libm::exp(0.03 * f64::from(step));
                let small = large / (1.0 + f64::from(step % 7));
                let distance = f64::from(step % 11) * 9.0;
                let truth = one(&rollout, [large, small], distance);
                let all = rollout.follow::<true>(&left([large, small], distance));
                for (name, a, b) in [
                    ("time", all.to_ellipse_s[5], truth.to_ellipse_s),
                    ("nats", all.nats[5], truth.nats),
                    ("seconds", all.seconds[5], truth.seconds),
                ] {
                    assert!((a - b).abs() <= 1e-10 * b.abs(), "{name} of {large}: {a}, not {b}");
                }
            }
        }
    }

    #[test]
    fn the_table_is_the_information() {
        let config = InformationConfig::default();
        let turn = config.turn().expect("in range");
        let rollout = rollout(&config, 3);
        for range in [3.5, 10.0, 40.0, 250.0, 280.0, 300.0, 400.0, 2000.0, 1e6] {
            let place = Vector3::new(range, 0.0, config.altitude.altitude(range));
            let truth = 1.5 * turn.fisher(&Vector2::zeros(), &place).total().trace();
            let rest2 = range * range - rollout.best_m * rollout.best_m;
            let ratio = rollout.worths(&[rest2; TARGETS], &[0.0; TARGETS])[0] / truth;
            assert!(abs_diff_eq!(ratio, 1.0, epsilon = 0.005), "{ratio} at {range} m");
        }
    }

    #[test]
    fn what_is_not_finite_costs_most() {
        for objective in [Objective::TimeToEllipse, Objective::InformationRate] {
            let config = InformationConfig { objective, ..InformationConfig::default() };
            let rollout = rollout(&config, 3);
            let cost = |axes| {
                let courses = rollout.follow::<true>(&left(axes, 10.0));
                let nats = courses.nats[0];
                let seconds = courses.seconds[0];
                let to_ellipse_s = courses.to_ellipse_s[0];
                rollout.cost(45.0, &Course { to_ellipse_s, nats, seconds })
            };
            for axes in [[f64::NAN, 1.0], [f64::INFINITY; 2], [4.0, f64::NAN]] {
                assert!(cost(axes).is_infinite() && cost(axes) > 0.0, "{axes:?}");
            }
            for nats in [f64::NAN, f64::INFINITY] {
                let course = Course { nats, to_ellipse_s: nats, seconds: 1.0 };
                assert!(rollout.cost(45.0, &course) > f64::MAX);
            }
            assert!(cost([4.0, 1.0]).is_finite());
        }
    }
}
