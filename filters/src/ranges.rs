//! Localisation by ranges, or by differences of ranges.

use alloc::vec::Vec;

use foxhunt_core::{
    Covariance, Estimate, MeasurementModel, Observation, Pose, Quantity, State,
    gaussian_log_likelihood,
    noise::log_normal_cdf,
    parameter::{ParameterError, finite},
};
use nalgebra::{Matrix1, Matrix2, Matrix3, RowVector2, RowVector4, Vector1, Vector2, Vector3};

use crate::batch::{BatchError, BatchFix, BatchSolver, at_least, finite_entry, positive_entry};

/// Distance of a target from a receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlantRange {
    /// The receiver's East, North and Up in metres.
    pub receiver: Vector3<f64>,
    /// The distance through the air, in metres.
    pub range: f64,
    /// Standard deviation of the distance, in metres.
    pub sigma: f64,
}

/// z = the slant range, negated: what is farther away than a limit is below it.
#[derive(Clone, Copy, Debug)]
struct Nearness {
    target_up: f64,
}

impl MeasurementModel<2, 1> for Nearness {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::RANGE]
    }

    fn expected(&self, target: &State<2>, receiver: &Pose) -> Vector1<f64> {
        Vector1::new(-(target.push(self.target_up) - receiver.position).norm())
    }

    fn jacobian(&self, target: &State<2>, receiver: &Pose) -> RowVector2<f64> {
        let way = target.push(self.target_up) - receiver.position;
        let range = way.norm();
        if range > 0.0 { -way.xy().transpose() / range } else { RowVector2::zeros() }
    }

    fn log_likelihood(&self, target: &State<2>, observation: &Observation<1>) -> f64 {
        let Some((limit, sigma)) = observation.upper_limit(0) else {
            return gaussian_log_likelihood(self, target, observation);
        };
        let expected = self.expected(target, observation.receiver());
        log_normal_cdf((limit - expected[0]) / sigma)
    }
}

/// z = the slant range with an offset and a scale that all have, negated.
#[derive(Clone, Copy, Debug)]
struct BiasedNearness(Nearness);

impl MeasurementModel<4, 1> for BiasedNearness {
    fn quantities(&self) -> [Quantity; 1] {
        self.0.quantities()
    }

    fn expected(&self, target: &State<4>, receiver: &Pose) -> Vector1<f64> {
        let near = self.0.expected(&target.xy(), receiver);
        Vector1::new((1.0 + target.w) * near[0] - target.z)
    }

    fn jacobian(&self, target: &State<4>, receiver: &Pose) -> RowVector4<f64> {
        let place = self.0.jacobian(&target.xy(), receiver) * (1.0 + target.w);
        let near = self.0.expected(&target.xy(), receiver);
        RowVector4::new(place[0], place[1], -1.0, near[0])
    }
}

/// Difference of a target's distances from a receiver and from a reference receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlantRangeDifference {
    /// The receiver's East, North and Up in metres.
    pub receiver: Vector3<f64>,
    /// Distance of the receiver from the target less that of the reference, in metres: the
    /// difference of the arrivals' times, times the speed of light.
    pub difference: f64,
    /// Standard deviation of the difference, in metres.
    pub sigma: f64,
}

/// The place of a target at the height `target_up` in metres from ranges, by least squares.
///
/// The start comes from the linear equations that differences of squared ranges obey, each weighed
/// by the error of its square (Caffery 2000), and from both sides of the line that the receivers
/// lie along: receivers on a line see two places alike, and [`BatchFix::rivals`] shows the other.
///
/// The ranges in `beyond` say only that the target is farther away, up to their σ: each weighs in
/// by the probability of that (Tobin 1958). Errors count them behind the others.
///
/// # Errors
///
/// [`BatchError::TooFew`] below three ranges; [`BatchError::Value`] for a number that is not
/// finite, or a range or σ that is not positive; [`BatchError::Flat`] when all receivers are in one
/// place; what [`BatchSolver::solve`] has.
pub fn multilaterate(
    ranges: &[SlantRange],
    beyond: &[SlantRange],
    target_up: f64,
) -> Result<BatchFix<2>, BatchError> {
    at_least("ranges", ranges.len(), 3)?;
    let observations = observations(ranges, beyond, target_up)?;
    BatchSolver::new(Nearness { target_up }).solve(&observations, &starts(ranges, target_up)?)
}

/// The place of a target at the height `target_up` in metres from ranges that share an offset and a
/// scale, r = (1 + s) d + b: East and North in metres, b in metres, and s. Priors of the two are
/// N(0, (0.2 of the median range)²) and N(0, 0.1²).
///
/// # Errors
///
/// [`BatchError::TooFew`] below four ranges; else those of [`multilaterate`].
pub fn multilaterate_with_bias(
    ranges: &[SlantRange],
    target_up: f64,
) -> Result<BatchFix<4>, BatchError> {
    at_least("ranges", ranges.len(), 4)?;
    let observations = observations(ranges, &[], target_up)?;
    let [offset_sigma, scale_sigma] = range_bias_sigmas(ranges);
    let mut sorted: Vec<f64> = ranges.iter().map(|r| r.range).collect();
    sorted.sort_by(f64::total_cmp);
    let nearest = sorted.first().copied().unwrap_or(0.0);
    let farthest = sorted.last().copied().unwrap_or(0.0);
    // The squares of ranges hide their offset and scale from the linear equations: several are
    // tried.
    let mut from = Vec::new();
    for scale in [-0.1, 0.0, 0.1] {
        for offset in [-0.2 * farthest, 0.0, 0.5 * nearest] {
            let less =
                |r: &SlantRange| SlantRange { range: (r.range - offset) / (1.0 + scale), ..*r };
            let less: Vec<SlantRange> = ranges.iter().map(less).collect();
            let places = starts(&less, target_up)?;
            from.extend(places.iter().map(|at| State::<4>::new(at.x, at.y, offset, scale)));
        }
    }
    let count = crate::count::number(ranges.len());
    let middle = ranges.iter().map(|r| r.receiver.xy()).sum::<Vector2<f64>>() / count;
    let apart = |r: &SlantRange| (r.receiver.xy() - middle).norm();
    let wide = 10.0 * (ranges.iter().map(apart).fold(0.0, f64::max) + farthest);
    let sigmas = State::<4>::new(wide, wide, offset_sigma, scale_sigma);
    let prior = Estimate {
        mean: State::<4>::new(middle.x, middle.y, 0.0, 0.0),
        covariance: Covariance::<4>::from_diagonal(&sigmas.component_mul(&sigmas)),
    };
    BatchSolver::new(BiasedNearness(Nearness { target_up }))
        .with_prior(prior)?
        .solve(&observations, &from)
}

/// Prior standard deviations of the offset in metres and of the scale that ranges share, as
/// [`multilaterate_with_bias`] has them.
#[must_use]
pub fn range_bias_sigmas(ranges: &[SlantRange]) -> [f64; 2] {
    let mut sorted: Vec<f64> = ranges.iter().map(|r| r.range).collect();
    sorted.sort_by(f64::total_cmp);
    let median = sorted.get(sorted.len() / 2).copied().unwrap_or(1.0);
    [0.2 * median, 0.1]
}

/// Builds observations of negated ranges: measured ones, then lower limits of ranges.
fn observations(
    ranges: &[SlantRange],
    beyond: &[SlantRange],
    target_up: f64,
) -> Result<Vec<Observation<1>>, BatchError> {
    finite("target_up", target_up)?;
    let mut observations = Vec::with_capacity(ranges.len() + beyond.len());
    let all = ranges.iter().chain(beyond).enumerate();
    for (index, SlantRange { receiver, range, sigma }) in all {
        for coordinate in receiver {
            finite_entry("the receiver's place", index, *coordinate)?;
        }
        positive_entry("the range", index, *range)?;
        positive_entry("the range's sigma", index, *sigma)?;
        let receiver = Pose::at(receiver.x, receiver.y, receiver.z);
        let noise = Matrix1::new(sigma * sigma);
        let observation = Observation::new(0.0, receiver, Vector1::new(-range), noise);
        // A sigma whose square underflows.
        let name = "the range's sigma";
        let requirement = "a positive number with a positive square";
        let error = ParameterError { name, value: *sigma, requirement };
        let observation = observation.map_err(|_| BatchError::Value { index, error })?;
        let is_known = index < ranges.len();
        observations.push(if is_known { observation } else { observation.below(0) });
    }
    Ok(observations)
}

/// The solution of the linear equations, and one on each side of the receivers' line.
fn starts(ranges: &[SlantRange], target_up: f64) -> Result<Vec<State<2>>, BatchError> {
    // The squared distance over ground, and the inverse variance of its error.
    let square = |r: &SlantRange| {
        let up = target_up - r.receiver.z;
        let weight = 1.0 / (2.0 * r.range * r.sigma);
        (f64::max(0.0, r.range * r.range - up * up), weight * weight)
    };
    let total: f64 = ranges.iter().map(|r| square(r).1).sum();
    let mean: Vector2<f64> =
        ranges.iter().map(|r| r.receiver.xy() * square(r).1).sum::<Vector2<f64>>() / total;
    let mut scatter = Matrix2::zeros();
    let mut right = Vector2::zeros();
    let mut middle = 0.0;
    for r in ranges {
        let (square, weight) = square(r);
        let place = r.receiver.xy() - mean;
        let weight = weight / total;
        scatter += place * place.transpose() * weight;
        right += place * ((place.norm_squared() - square) * weight * 0.5);
        middle += (square - place.norm_squared()) * weight;
    }
    let axes = scatter.symmetric_eigen();
    let long = axes.eigenvalues.imax();
    let short = axes.eigenvalues.imin();
    let rcond = axes.eigenvalues[short] / axes.eigenvalues[long];
    // Receivers apart by a millionth of the range are in one place.
    let farthest = ranges.iter().map(|r| r.range).fold(0.0, f64::max);
    if rcond.is_nan() || libm::sqrt(axes.eigenvalues[long]) < 1e-6 * farthest {
        return Err(BatchError::Flat { rcond: 0.0 });
    }
    let axis: Vector2<f64> = axes.eigenvectors.column(long).into_owned();
    let along = axis * (axis.dot(&right) / axes.eigenvalues[long]);
    // Σ w |x|² is Σ w (ρ² − |p|²) about the receivers' mean.
    let across = libm::sqrt(f64::max(0.0, middle - along.norm_squared()));
    let across = Vector2::new(-axis.y, axis.x) * across;
    let mut starts = alloc::vec![mean + along + across, mean + along - across];
    if rcond > 1e-9
        && let Some(place) = scatter.lu().solve(&right)
    {
        starts.push(mean + place);
    }
    Ok(starts)
}

/// Locates a target at the height `target_up` in metres from range differences to one reference
/// receiver, in closed form: spherical intersection (Schau & Robinson 1987).
///
/// Given the distance r₀ from the reference, the squares of the ranges are linear in the place,
/// so that least squares have x = a + b r₀; the reference's own sphere makes a quadratic equation
/// for r₀ of it. Both of its roots may be positive, and noise may leave none: then the real part
/// of the complex pair stands in, or the height. From three differences on, r₀ is also solved for
/// as an unknown of its own (spherical interpolation, Smith & Abel 1987).
///
/// The places come with the best fitting one first. They are starts for
/// [`BatchSolver`] with a model of range differences, which then reaches the
/// Cramér-Rao bound; alone they are poor near the reference.
///
/// # Errors
///
/// [`BatchError::TooFew`] below two differences; [`BatchError::Value`] for a number that is not
/// finite or a σ that is not positive; [`BatchError::Flat`] when all receivers lie on one line
/// with the reference.
pub fn spherical_intersection(
    reference: Vector3<f64>,
    differences: &[SlantRangeDifference],
    target_up: f64,
) -> Result<Vec<Vector2<f64>>, BatchError> {
    at_least("range differences", differences.len(), 2)?;
    for (index, SlantRangeDifference { receiver, difference, sigma }) in
        differences.iter().enumerate()
    {
        for coordinate in receiver.iter().chain(&reference).chain([&target_up]) {
            finite_entry("a place", index, *coordinate)?;
        }
        finite_entry("the range difference", index, *difference)?;
        positive_entry("the range difference's sigma", index, *sigma)?;
    }
    let up = target_up - reference.z;
    // Σ w q qᵀ and Σ w q k with q = (p, d): each difference is an equation q · (x, r₀) = k.
    let mut whole = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for d in differences {
        let place = d.receiver.xy() - reference.xy();
        let weight = 1.0 / (d.sigma * d.sigma);
        let above = target_up - d.receiver.z;
        let square = place.norm_squared() + above * above - up * up;
        let known = place.push(d.difference);
        whole += known * known.transpose() * weight;
        right += known * (0.5 * (square - d.difference * d.difference) * weight);
    }
    let matrix: Matrix2<f64> = whole.fixed_view::<2, 2>(0, 0).into_owned();
    let apart = right.xy();
    let toward = -whole.column(2).xy();
    let size = matrix.trace();
    let rcond = matrix.determinant() / (size * size);
    let flat = BatchError::Flat { rcond };
    if rcond.is_nan() || rcond < 1e-12 {
        return Err(flat);
    }
    let factor = matrix.cholesky().ok_or(flat)?;
    let a = factor.solve(&apart);
    let b = factor.solve(&toward);
    let square = a.norm_squared() + up * up;
    let roots = roots(b.norm_squared() - 1.0, a.dot(&b), square);
    // No range is less than the height; where noise makes it so, the target is at the reference.
    let largest = roots.into_iter().filter(|r| r.is_finite()).fold(up.abs(), f64::max);
    let ranges = roots.into_iter().chain([largest]).filter(|r| *r >= up.abs() && r.is_finite());
    let mut places: Vec<Vector2<f64>> = ranges.map(|r| reference.xy() + a + b * r).collect();
    places.dedup();
    // With the range taken for a third unknown of its own (Smith & Abel 1987).
    places.extend(whole.cholesky().map(|factor| reference.xy() + factor.solve(&right).xy()));
    let misfit = |place: &Vector2<f64>| -> f64 {
        let range = |from: &Vector3<f64>| (place.push(target_up) - from).norm();
        let own = range(&reference);
        let apart = |d: &SlantRangeDifference| (range(&d.receiver) - own - d.difference) / d.sigma;
        differences.iter().map(|d| apart(d) * apart(d)).sum()
    };
    places.retain(|place| place.iter().all(|c| c.is_finite()));
    if places.is_empty() {
        return Err(flat);
    }
    places.sort_by(|x, y| misfit(x).total_cmp(&misfit(y)));
    Ok(places)
}

/// The roots of a r² + 2 h r + c; of a complex pair, the real part twice.
fn roots(a: f64, h: f64, c: f64) -> [f64; 2] {
    let root = libm::sqrt(f64::max(0.0, h * h - a * c));
    // The sum without cancellation; the other root by Vieta.
    let q = -(h + libm::copysign(root, h));
    if h * h < a * c { [-h / a; 2] } else { [q / a, c / q] }
}
