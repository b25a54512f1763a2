use alloc::vec::Vec;

use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use crate::batch::{BatchError, at_least, finite_entry, positive_entry};

/// Difference of a target's distances from a receiver and from a reference receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlantRangeDifference {
    /// The receiver's East, North and Up in metres.
    pub receiver: Vector3<f64>,
    /// Its distance from the target less that of the reference, in metres: the difference of the
    /// arrivals' times, times the speed of light.
    pub difference: f64,
    /// The standard deviation of that, in metres.
    pub sigma: f64,
}

/// Locates a target at the height `target_up` in metres from range differences to one reference
/// receiver, in closed form: spherical intersection (Schau & Robinson 1987).
///
/// Given the distance r₀ from the reference, the squares of the ranges are linear in the place, so
/// that least squares have x = a + b r₀; the reference's own sphere makes a quadratic equation for
/// r₀ of it. Both of its roots may be positive, and noise may leave none: then the real part of the
/// complex pair stands in, or the height. From three differences on, r₀ is also solved for as an
/// unknown of its own (spherical interpolation, Smith & Abel 1987).
///
/// The places come with the best fitting one first. They are starts for
/// [`BatchSolver`](crate::BatchSolver) with a model of range differences, which then reaches the
/// Cramér-Rao bound; alone they are poor near the reference.
///
/// # Errors
///
/// [`BatchError::TooFew`] below two differences; [`BatchError::Value`] for a number that is not
/// finite or a σ that is not positive; [`BatchError::Flat`] when all receivers lie on one line with
/// the reference.
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
