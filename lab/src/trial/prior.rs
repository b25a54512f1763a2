use foxhunt_core::{Estimate, EstimatorError, Pose, State, parameter::positive};
use foxhunt_filters::{RangeParameterised, polar_moments, split_standard_normal};
use foxhunt_hunt::config;
use nalgebra::{Matrix4, Vector2, Vector4};
use rand::{RngExt, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;
use statrs::distribution::{ContinuousCDF, Normal};

use super::PriorConfig;

/// The prior of place and velocity in one run.
#[derive(Clone, Copy, Debug)]
pub(super) enum Prior {
    Room { low: Vector2<f64>, high: Vector2<f64>, speed_sigma: f64 },
    Ranging(Ranging),
}

/// Means and standard deviations of independent normal quantities.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ranging {
    receiver: Vector2<f64>,
    bearing: (f64, f64),
    range: (f64, f64),
    speed: (f64, f64),
    course: (f64, f64),
    least_range: f64,
}

/// Beyond this many standard deviations of the range a bank has no components.
const REACH: f64 = 3.0;

impl Prior {
    /// The prior of a run whose target begins at `truth`; `first` is the first bearing, where the
    /// prior uses it up.
    pub(super) fn new(
        config: &PriorConfig,
        truth: &Vector4<f64>,
        receiver: Vector2<f64>,
        first: (f64, f64),
        rng: &mut Xoshiro256PlusPlus,
    ) -> Self {
        match *config {
            PriorConfig::Room { west_m, east_m, south_m, north_m, speed_sigma_mps } => Self::Room {
                low: Vector2::new(west_m, south_m),
                high: Vector2::new(east_m, north_m),
                speed_sigma: speed_sigma_mps,
            },
            PriorConfig::Ranging {
                sigma_range_m,
                sigma_speed_mps,
                sigma_course_rad,
                least_range_m,
                least_speed_mps,
            } => {
                let mut mean =
                    |truth: f64, sigma: f64, least: f64| (above(truth, sigma, least, rng), sigma);
                let distance = (truth.xy() - receiver).norm();
                Self::Ranging(Ranging {
                    receiver,
                    bearing: first,
                    range: mean(distance, sigma_range_m, least_range_m),
                    speed: mean(truth.fixed_rows::<2>(2).norm(), sigma_speed_mps, least_speed_mps),
                    course: (first.0 + core::f64::consts::PI, sigma_course_rad),
                    least_range: least_range_m,
                })
            }
        }
    }

    /// Returns true if the first bearing is part of it.
    pub(super) fn holds_first_bearing(&self) -> bool {
        matches!(self, Self::Ranging(_))
    }

    /// A draw from it.
    pub(super) fn draw(&self, rng: &mut Xoshiro256PlusPlus) -> Vector4<f64> {
        match *self {
            Self::Room { low, high, speed_sigma } => {
                let mut between =
                    |row: usize| low[row] + (high[row] - low[row]) * rng.random::<f64>();
                let east = between(0);
                let north = between(1);
                let mut speed = || speed_sigma * rng.sample::<f64, _>(StandardNormal);
                Vector4::new(east, north, speed(), speed())
            }
            Self::Ranging(r) => {
                let range = above(r.range.0, r.range.1, r.least_range, rng);
                let mut normal =
                    |(mean, sigma): (f64, f64)| mean + sigma * rng.sample::<f64, _>(StandardNormal);
                let (bearing, speed, course) =
                    (normal(r.bearing), normal(r.speed), normal(r.course));
                let place = r.receiver + polar(range, bearing);
                let velocity = polar(speed, course);
                Vector4::new(place.x, place.y, velocity.x, velocity.y)
            }
        }
    }

    /// Returns the mean and covariance of the prior.
    fn moments(&self) -> Estimate<4> {
        match *self {
            Self::Room { low, high, speed_sigma } => {
                // A uniform density is a twelfth of its width squared in variance.
                let spread = (high - low) / 12.0_f64.sqrt();
                let mean = 0.5 * (low + high);
                let sigma = Vector4::new(spread.x, spread.y, speed_sigma, speed_sigma);
                gaussian(Vector4::new(mean.x, mean.y, 0.0, 0.0), &sigma)
            }
            Self::Ranging(r) => {
                let mut place = polar_moments(r.range, r.bearing);
                place.mean += r.receiver;
                join(&place, &polar_moments(r.speed, r.course))
            }
        }
    }

    /// Returns the prior's information at a state; `None` for a room, whose density has no slope.
    pub(super) fn information(&self, state: &Vector4<f64>) -> Option<Matrix4<f64>> {
        let Self::Ranging(r) = *self else { return None };
        let place = state.xy() - r.receiver;
        let sigmas = [r.range.1, r.bearing.1, r.speed.1, r.course.1];
        Some(polar_information([place.x, place.y], [state[2], state[3]], sigmas))
    }

    /// The prior as a sum of Gaussians side by side: `parts[0]` in each direction of a room or
    /// along the range, `parts[1]` along the course.
    fn sum(&self, parts: [usize; 2]) -> Result<Vec<(f64, Estimate<4>)>, EstimatorError> {
        match *self {
            Self::Room { low, high, .. } => {
                let count = f64::from(u32::try_from(parts[0]).unwrap_or(u32::MAX));
                let cell = (high - low) / count;
                let mut sum = Vec::new();
                for i in 0..parts[0] * parts[0] {
                    let [east, north] = [i % parts[0], i / parts[0]]
                        .map(|k| 0.5 + f64::from(u32::try_from(k).unwrap_or(u32::MAX)));
                    let mut part = self.moments();
                    part.mean.x = low.x + east * cell.x;
                    part.mean.y = low.y + north * cell.y;
                    part.covariance[(0, 0)] = cell.x * cell.x / 12.0;
                    part.covariance[(1, 1)] = cell.y * cell.y / 12.0;
                    sum.push((1.0, part));
                }
                Ok(sum)
            }
            Self::Ranging(r) => {
                let (spread, ranges) = split_standard_normal(parts[0])?;
                let places = ranges.into_iter().map(|(weight, at)| {
                    let range = (r.range.0 + at * r.range.1, spread * r.range.1);
                    let mut place = polar_moments(range, r.bearing);
                    place.mean += r.receiver;
                    (weight, range.0, place)
                });
                // A range of less than nothing is on the other side.
                let places = places.filter(|(_, range, _)| *range > 0.0).map(|(w, _, p)| (w, p));
                r.with_courses(places, parts[1])
            }
        }
    }

    /// The prior as a row of Gaussians whose ranges are in geometric progression, where there is a
    /// range; `parts` along the range and along the course.
    fn row(&self, parts: [usize; 2]) -> Result<Option<Vec<(f64, Estimate<4>)>>, EstimatorError> {
        let Self::Ranging(r) = *self else { return Ok(None) };
        let (mean, sigma) = r.range;
        let interval = ((mean - REACH * sigma).max(r.least_range), mean + REACH * sigma);
        let receiver = Pose::at(r.receiver.x, r.receiver.y, 0.0);
        positive("sigma of the range", sigma)?;
        let normal = Normal::new(mean, sigma).map_err(|_| EstimatorError::Unsupported {
            what: "a range without a normal distribution",
        })?;
        let row = RangeParameterised::new(&receiver, r.bearing, interval, parts[0])?
            .with_prior(|from, to| normal.cdf(to) - normal.cdf(from))?;
        r.with_courses(row.places(), parts[1]).map(Some)
    }
}

/// The prior of the first N components of the state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leading<'a>(pub &'a Prior);

/// Gaussians along the course, whatever their number along the range.
const COURSES: usize = 5;

impl<const N: usize> config::Prior<N> for Leading<'_> {
    fn moments(&self) -> Estimate<N> {
        leading_estimate(&self.0.moments())
    }

    fn is_gaussian(&self) -> bool {
        false
    }

    fn draw(&self, rng: &mut Xoshiro256PlusPlus) -> State<N> {
        leading(&self.0.draw(rng))
    }

    fn sum(&self, parts: usize) -> Result<Vec<(f64, Estimate<N>)>, EstimatorError> {
        Ok(leading_parts(self.0.sum([parts, parts])?))
    }

    fn row(&self, parts: usize) -> Result<Option<Vec<(f64, Estimate<N>)>>, EstimatorError> {
        Ok(self.0.row([parts, COURSES])?.map(leading_parts))
    }
}

fn leading_parts<const N: usize>(parts: Vec<(f64, Estimate<4>)>) -> Vec<(f64, Estimate<N>)> {
    parts.into_iter().map(|(weight, part)| (weight, leading_estimate(&part))).collect()
}

impl Ranging {
    /// Each place with each part of the velocity.
    fn with_courses(
        &self,
        places: impl IntoIterator<Item = (f64, Estimate<2>)>,
        parts: usize,
    ) -> Result<Vec<(f64, Estimate<4>)>, EstimatorError> {
        let (spread, courses) = split_standard_normal(parts)?;
        let velocities: Vec<(f64, Estimate<2>)> = courses
            .into_iter()
            .map(|(weight, at)| {
                let course = (self.course.0 + at * self.course.1, spread * self.course.1);
                (weight, polar_moments(self.speed, course))
            })
            .collect();
        let with_each = |(weight, place): (f64, Estimate<2>)| {
            let pair = move |(share, velocity): &(f64, Estimate<2>)| {
                (weight * share, join(&place, velocity))
            };
            velocities.iter().map(pair).collect::<Vec<_>>()
        };
        Ok(places.into_iter().flat_map(with_each).collect())
    }
}

/// The first components of a state.
fn leading<const N: usize>(state: &Vector4<f64>) -> State<N> {
    state.fixed_rows::<N>(0).into_owned()
}

/// The first components of an estimate.
fn leading_estimate<const N: usize>(estimate: &Estimate<4>) -> Estimate<N> {
    Estimate {
        mean: leading(&estimate.mean),
        covariance: estimate.covariance.fixed_view::<N, N>(0, 0).into_owned(),
    }
}

/// J of a prior that is Gaussian in range, bearing, speed and course, at a state.
fn polar_information(place: [f64; 2], velocity: [f64; 2], sigmas: [f64; 4]) -> Matrix4<f64> {
    let mut information = Matrix4::zeros();
    for (at, [x, y], along, turn) in
        [(0, place, sigmas[0], sigmas[1]), (2, velocity, sigmas[2], sigmas[3])]
    {
        // The gradients of length and direction, each over its σ.
        let length = x.hypot(y);
        let mut gradient = Vector4::zeros();
        (gradient[at], gradient[at + 1]) = (x / length / along, y / length / along);
        information += gradient * gradient.transpose();
        (gradient[at], gradient[at + 1]) =
            (-y / length / length / turn, x / length / length / turn);
        information += gradient * gradient.transpose();
    }
    information
}

/// A bearing, course or range as a vector.
fn polar(length: f64, direction: f64) -> Vector2<f64> {
    let (sin, cos) = direction.sin_cos();
    Vector2::new(cos, sin) * length
}

/// A normal draw, again until it is above the least.
fn above(mean: f64, sigma: f64, least: f64, rng: &mut Xoshiro256PlusPlus) -> f64 {
    for _ in 0..10_000 {
        let value = mean + sigma * rng.sample::<f64, _>(StandardNormal);
        if value > least {
            return value;
        }
    }
    // The mean lies far below: all that is above lies next to the least.
    least
}

fn gaussian(mean: Vector4<f64>, sigma: &Vector4<f64>) -> Estimate<4> {
    let covariance = Matrix4::from_diagonal(&sigma.component_mul(sigma));
    Estimate { mean, covariance }
}

/// A place and a velocity, independent of each other.
fn join(place: &Estimate<2>, velocity: &Estimate<2>) -> Estimate<4> {
    let mut joined = Estimate::isotropic(Vector4::zeros(), 0.0);
    for (at, part) in [(0, place), (2, velocity)] {
        joined.mean.fixed_rows_mut::<2>(at).copy_from(&part.mean);
        joined.covariance.fixed_view_mut::<2, 2>(at, at).copy_from(&part.covariance);
    }
    joined
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    /// The moments of a weighted sum.
    fn mixed(parts: &[(f64, Estimate<4>)]) -> Estimate<4> {
        let total: f64 = parts.iter().map(|p| p.0).sum();
        let mean = parts.iter().map(|(w, p)| p.mean * *w).sum::<Vector4<f64>>() / total;
        let spread = |(w, p): &(f64, Estimate<4>)| {
            (p.covariance + (p.mean - mean) * (p.mean - mean).transpose()) * *w
        };
        Estimate { mean, covariance: parts.iter().map(spread).sum::<Matrix4<f64>>() / total }
    }

    /// Returns true if they agree to some share of the standard deviations.
    fn near(a: &Estimate<4>, b: &Estimate<4>, share: f64) -> bool {
        let sigma = b.covariance.map_diagonal(f64::sqrt);
        let scale = sigma * sigma.transpose();
        (a.mean - b.mean).component_div(&sigma).amax() < share
            && (a.covariance - b.covariance).component_div(&scale).amax() < share
    }

    #[test]
    fn draws_moments_and_sums_are_of_one_prior() {
        // Seed 4, 40 000 draws: 5 standard errors of a normal's variance are 0.035.
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(4);
        let room = Prior::Room {
            low: Vector2::new(-3.0, -1.0),
            high: Vector2::new(3.0, 7.0),
            speed_sigma: 0.3,
        };
        let ranging = Prior::Ranging(Ranging {
            receiver: Vector2::new(100.0, -50.0),
            bearing: (2.0, 0.03),
            range: (5000.0, 1000.0),
            speed: (4.0, 0.5),
            course: (-1.0, 0.9),
            least_range: 600.0,
        });
        // A course side by side has its variance, but not quite the mean of its cosine.
        for (prior, parts, share) in [(room, [5, 1], 1e-9), (ranging, [9, 6], 0.05)] {
            let drawn: Vec<_> = (0..40_000)
                .map(|_| (1.0, Estimate::isotropic(prior.draw(&mut rng), 0.0)))
                .collect();
            assert!(near(&mixed(&drawn), &prior.moments(), 0.035), "{:?}", mixed(&drawn));
            let sum = prior.sum(parts).expect("in range");
            assert!(near(&mixed(&sum), &prior.moments(), share), "{:?}", mixed(&sum));
            // A row covers three standard deviations, in intervals.
            match prior.row(parts).expect("in range") {
                Some(row) => {
                    assert!(near(&mixed(&row), &prior.moments(), 0.1), "{:?}", mixed(&row))
                }
                None => assert!(!prior.holds_first_bearing()),
            }
        }
    }
}
