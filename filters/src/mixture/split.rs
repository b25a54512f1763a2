use alloc::{vec, vec::Vec};

use foxhunt_core::{Covariance, Estimate, EstimatorError, Role, State, parameter::require};
use nalgebra::Vector2;

use crate::count::number;

/// The most parts along one axis.
const MOST: usize = 64;

/// A Gaussian as a grid of narrower ones along the principal axes of its position: `parts[0]`
/// along the longer one, `parts[1]` along the other; the mixture has the same mean and covariance
/// (Alspach & Sorenson 1972, §II).
///
/// Along an axis on which the position is N(0, 1) after scaling, k parts lie 6.5 / (k + 2.5) apart,
/// each of half that as standard deviation (two parts share the variance evenly); their weights are
/// a Gaussian's, with the spread at which the mixture's variance is 1. From five parts on the sum
/// is within 7 % of the Gaussian's peak. The rest of the state follows by regression on the
/// position, so a velocity that goes with the range is split with it.
///
/// # Errors
///
/// [`EstimatorError::Parameter`] when a number of parts is not in 1..=64, and
/// [`EstimatorError::NotPositiveDefinite`] when the position's covariance is not.
pub fn split<const N: usize>(
    estimate: &Estimate<N>,
    parts: [usize; 2],
) -> Result<Vec<(f64, Estimate<N>)>, EstimatorError> {
    let [major, minor] = principal_axes(estimate)?;
    let mut grid = Vec::new();
    for (weight, part) in split_along(estimate, &major, parts[0])? {
        for (share, cell) in split_along(&part, &minor, parts[1])? {
            grid.push((weight * share, cell));
        }
    }
    Ok(grid)
}

/// The directions in which the position is spread the most and the least.
pub(super) fn principal_axes<const N: usize>(
    estimate: &Estimate<N>,
) -> Result<[Vector2<f64>; 2], EstimatorError> {
    let flat = EstimatorError::NotPositiveDefinite { role: Role::Prior };
    let ellipse = estimate.position().ellipse(0.5).ok_or(flat)?;
    let (sin, cos) = libm::sincos(ellipse.orientation);
    Ok([Vector2::new(cos, sin), Vector2::new(-sin, cos)])
}

/// A Gaussian as narrower ones side by side along a direction of its position.
pub(super) fn split_along<const N: usize>(
    estimate: &Estimate<N>,
    direction: &Vector2<f64>,
    parts: usize,
) -> Result<Vec<(f64, Estimate<N>)>, EstimatorError> {
    let mut along = State::<N>::zeros();
    along.fixed_rows_mut::<2>(0).copy_from(direction);
    // x given eᵀx is shifted by P e / √(eᵀ P e) for each standard deviation of eᵀx.
    let cross = estimate.covariance * along;
    let shift = cross / libm::sqrt(along.dot(&cross));
    let (spread, nodes) = split_standard_normal(parts)?;
    let narrowed: Covariance<N> = shift * (shift * (1.0 - spread * spread)).transpose();
    let mut covariance = estimate.covariance - narrowed;
    covariance.fill_upper_triangle_with_lower_triangle();
    let part = |(weight, at): (f64, f64)| {
        (weight, Estimate { mean: estimate.mean + shift * at, covariance })
    };
    Ok(nodes.into_iter().map(part).collect())
}

/// N(0, 1) as narrower Gaussians side by side, as [`split`] uses them: their common standard
/// deviation, and their weights and means.
///
/// # Errors
///
/// [`EstimatorError::Parameter`] when the number of parts is not in 1..=64.
pub fn split_standard_normal(parts: usize) -> Result<(f64, Vec<(f64, f64)>), EstimatorError> {
    require((1..=MOST).contains(&parts), "parts", number(parts), "in 1..=64")?;
    Ok(unit_parts(parts))
}

fn unit_parts(parts: usize) -> (f64, Vec<(f64, f64)>) {
    // Two of even weight that are 6.5 / 4.5 apart would have too much variance: each takes half of
    // it.
    let half = core::f64::consts::FRAC_1_SQRT_2;
    match parts {
        1 => return (1.0, vec![(1.0, 0.0)]),
        2 => return (half, vec![(0.5, -half), (0.5, half)]),
        _ => {}
    }
    let apart = 6.5 / (number(parts) + 2.5);
    let spread = 0.5 * apart;
    let wanted = 1.0 - spread * spread;
    let nodes: Vec<f64> =
        (0..parts).map(|i| (number(i) - 0.5 * number(parts - 1)) * apart).collect();
    let weigh = |scale: f64| -> Vec<f64> {
        let raw: Vec<f64> = nodes.iter().map(|m| libm::exp(-0.5 * m * m / scale)).collect();
        let sum: f64 = raw.iter().sum();
        raw.into_iter().map(|w| w / sum).collect()
    };
    let variance =
        |weights: &[f64]| -> f64 { weights.iter().zip(&nodes).map(|(w, m)| w * m * m).sum() };
    // The variance grows with the scale, from 0 or less than is wanted to more.
    let mut low = 1e-3;
    let mut high = 1e3;
    for _ in 0..100 {
        let middle = libm::sqrt(low * high);
        if variance(&weigh(middle)) < wanted {
            low = middle;
        } else {
            high = middle;
        }
    }
    (spread, weigh(high).into_iter().zip(nodes.iter().copied()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_have_the_moments_of_the_whole() {
        for parts in 1..=MOST {
            let (spread, nodes) = unit_parts(parts);
            let moment = |power: i32| -> f64 {
                nodes.iter().map(|(w, m)| w * libm::pow(*m, f64::from(power))).sum()
            };
            assert!((moment(0) - 1.0).abs() < 1e-12, "{parts}");
            assert!(moment(1).abs() < 1e-12, "{parts}");
            assert!((moment(2) + spread * spread - 1.0).abs() < 1e-12, "{parts}");
        }
    }

    #[test]
    fn the_sum_of_the_parts_looks_like_the_whole() {
        let normal = |x: f64, sigma: f64| {
            libm::exp(-0.5 * x * x / sigma / sigma) / sigma / libm::sqrt(core::f64::consts::TAU)
        };
        for parts in 5..=MOST {
            let (spread, nodes) = unit_parts(parts);
            for i in -300..=300 {
                let x = f64::from(i) * 0.01;
                let sum: f64 = nodes.iter().map(|(w, m)| w * normal(x - m, spread)).sum();
                let off = (sum - normal(x, 1.0)).abs() / normal(0.0, 1.0);
                assert!(off < 0.07, "{parts} parts at {x}: {off}");
            }
        }
    }
}
