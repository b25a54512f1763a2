//! Gaussians split into narrower ones, and merged into fewer.

use alloc::{vec, vec::Vec};

use foxhunt_core::{Axis, Covariance, Estimate, EstimatorError, Role, State, parameter::require};
use nalgebra::Vector2;

use super::combine;
use crate::count::number;

/// The most parts along one axis of a split.
const MOST: usize = 64;

/// A weighted Gaussian, and which component it came from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part<const N: usize> {
    pub weight: f64,
    pub estimate: Estimate<N>,
    /// Index of the component that the part came from; after a merge, the heavier part's.
    pub origin: usize,
    pub merged: bool,
    log_determinant: f64,
}

impl<const N: usize> Part<N> {
    pub(crate) fn new(origin: usize, weight: f64, estimate: Estimate<N>) -> Self {
        let log_determinant = log_determinant(&estimate);
        Self { weight, estimate, origin, merged: false, log_determinant }
    }
}

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

/// Merges the pair that costs the least, until there are at most `most` and every pair costs
/// more than `cheap` (Runnalls 2007): each merged pair keeps its mean and covariance.
///
/// The cost ½ [(wᵢ + wⱼ) ln |Pᵢⱼ| − wᵢ ln |Pᵢ| − wⱼ ln |Pⱼ|] bounds the Kullback-Leibler
/// divergence of the mixture before from the one after, in nats.
pub(crate) fn reduce<const N: usize>(
    parts: &mut Vec<Part<N>>,
    most: usize,
    cheap: f64,
    axes: &[Axis; N],
) -> Result<(), EstimatorError> {
    let join = |a: &Part<N>, b: &Part<N>| -> Result<(f64, Part<N>), EstimatorError> {
        let weight = a.weight + b.weight;
        let pair = [(a.weight / weight, a.estimate), (b.weight / weight, b.estimate)];
        let estimate = combine(pair.into_iter(), axes)?;
        let origin = if a.weight >= b.weight { a.origin } else { b.origin };
        let whole = Part { merged: true, ..Part::new(origin, weight, estimate) };
        let split = a.weight * a.log_determinant + b.weight * b.log_determinant;
        Ok((0.5 * (weight * whole.log_determinant - split), whole))
    };
    // For each part the cheapest of those after it.
    let cheapest = |parts: &[Part<N>], i: usize| -> Result<Option<(f64, usize)>, EstimatorError> {
        let mut best: Option<(f64, usize)> = None;
        for j in i + 1..parts.len() {
            let (cost, _) = join(&parts[i], &parts[j])?;
            if best.is_none_or(|(least, _)| cost < least) {
                best = Some((cost, j));
            }
        }
        Ok(best)
    };
    let mut best = Vec::with_capacity(parts.len());
    for i in 0..parts.len() {
        best.push(cheapest(parts, i)?);
    }
    while parts.len() > 1 {
        let pairs = best.iter().enumerate().filter_map(|(i, b)| b.map(|(cost, j)| (cost, i, j)));
        let Some((cost, i, j)) = pairs.min_by(|a, b| a.0.total_cmp(&b.0)) else { break };
        if parts.len() <= most && cost > cheap {
            break;
        }
        parts[i] = join(&parts[i], &parts[j])?.1;
        parts.remove(j);
        best.remove(j);
        // Those that looked to either of the two look again; the others are moved up, and may
        // find the merged one cheaper.
        for k in 0..parts.len() {
            best[k] = match best[k] {
                Some((_, at)) if k == i || at == i || at == j => cheapest(parts, k)?,
                Some((cost, at)) => {
                    let at = if at > j { at - 1 } else { at };
                    let merged = if k < i { Some(join(&parts[k], &parts[i])?.0) } else { None };
                    match merged {
                        Some(new) if new < cost => Some((new, i)),
                        _ => Some((cost, at)),
                    }
                }
                None => None,
            };
        }
    }
    Ok(())
}

/// ln |P|; −∞ where it has no factor.
fn log_determinant<const N: usize>(estimate: &Estimate<N>) -> f64 {
    let factor = estimate.covariance.cholesky();
    factor.map_or(f64::NEG_INFINITY, |factor| {
        2.0 * factor.l_dirty().diagonal().iter().map(|d| libm::log(*d)).sum::<f64>()
    })
}

#[cfg(test)]
mod tests {
    use alloc::vec;
    use approx::{abs_diff_eq, assert_abs_diff_eq};

    use nalgebra::Vector1;

    use super::*;

    #[test]
    fn the_parts_have_the_moments_of_the_whole() {
        for parts in 1..=MOST {
            let (spread, nodes) = unit_parts(parts);
            let moment = |power: i32| -> f64 {
                nodes.iter().map(|(w, m)| w * libm::pow(*m, f64::from(power))).sum()
            };
            assert!(abs_diff_eq!(moment(0), 1.0, epsilon = 1e-12), "{parts}");
            assert!(abs_diff_eq!(moment(1), 0.0, epsilon = 1e-12), "{parts}");
            assert!(abs_diff_eq!(moment(2) + spread * spread, 1.0, epsilon = 1e-12), "{parts}");
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

    fn part(origin: usize, weight: f64, mean: f64, sigma: f64) -> Part<1> {
        Part::new(origin, weight, Estimate::isotropic(Vector1::new(mean), sigma))
    }

    #[test]
    fn the_nearest_are_merged_and_both_moments_stay() {
        let whole = vec![part(0, 0.3, 0.0, 1.0), part(1, 0.2, 9.0, 1.0), part(2, 0.5, 0.5, 1.2)];
        let moments_of = |parts: &[Part<1>]| {
            let pairs = parts.iter().map(|p| (p.weight, p.estimate));
            combine(pairs, &[Axis::Linear]).expect("finite")
        };
        let mut reduced = whole.clone();
        reduce(&mut reduced, 2, 0.0, &[Axis::Linear]).expect("finite");
        assert_eq!(reduced.len(), 2);
        assert_eq!((reduced[0].origin, reduced[0].merged), (2, true));
        assert_eq!((reduced[1].origin, reduced[1].merged), (1, false));
        let before = moments_of(&whole);
        let after = moments_of(&reduced);
        assert!((before.mean - after.mean).norm() < 1e-14);
        assert!((before.covariance - after.covariance).norm() < 1e-13);
        // A light far one costs less than a heavy near one: weights matter.
        let mut light =
            vec![part(0, 0.5, 0.0, 1.0), part(1, 1e-9, 9.0, 1.0), part(2, 0.5, 3.0, 1.0)];
        reduce(&mut light, 2, 0.0, &[Axis::Linear]).expect("finite");
        assert_abs_diff_eq!(light[0].weight, 0.5, epsilon = 1e-6);
        assert_abs_diff_eq!(light[1].weight, 0.5, epsilon = 1e-6);
    }

    #[test]
    fn every_step_takes_the_cheapest_pair() {
        // Against the plain search over all pairs at each step.
        let mut parts: Vec<Part<1>> = (0..12)
            .map(|i| {
                let x = f64::from(i * i % 17) + 0.01 * f64::from(i);
                part(0, 0.02 + 0.01 * f64::from(i % 5), x, 0.5 + 0.1 * f64::from(i % 3))
            })
            .collect();
        let whole = parts.clone();
        while parts.len() > 1 {
            let mut cheapest = (f64::INFINITY, f64::NAN);
            for i in 0..parts.len() {
                for j in i + 1..parts.len() {
                    let mut pair = vec![parts[i], parts[j]];
                    reduce(&mut pair, 1, 0.0, &[Axis::Linear]).expect("finite");
                    let ln = |p: &Part<1>| p.weight * libm::log(p.estimate.covariance[0]);
                    let cost = 0.5 * (ln(&pair[0]) - ln(&parts[i]) - ln(&parts[j]));
                    if cost < cheapest.0 {
                        cheapest = (cost, pair[0].estimate.mean[0]);
                    }
                }
            }
            let left = parts.len() - 1;
            reduce(&mut parts, left, f64::NEG_INFINITY, &[Axis::Linear]).expect("finite");
            let hit = parts.iter().any(|p| (p.estimate.mean[0] - cheapest.1).abs() < 1e-12);
            assert!(hit, "{left}: {cheapest:?}");
            // In one go as step by step: what is remembered of the costs is kept right.
            let mut at_once = whole.clone();
            reduce(&mut at_once, left, f64::NEG_INFINITY, &[Axis::Linear]).expect("finite");
            let means = |parts: &[Part<1>]| -> Vec<f64> {
                parts.iter().map(|p| p.estimate.mean[0]).collect()
            };
            assert_eq!(means(&at_once), means(&parts));
        }
    }

    #[test]
    fn what_is_remembered_of_the_costs_is_kept_right() {
        // 200 sets of 15, from a linear congruential generator (Knuth's MMIX): in one go as step
        // by step, where every cost is worked out anew.
        let mut state = 1_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            f64::from(u32::try_from(state >> 32).expect("32 bits")) / f64::from(u32::MAX)
        };
        for _ in 0..200 {
            let mut draw = |_| part(0, 0.01 + uniform(), 10.0 * uniform(), 0.2 + 2.0 * uniform());
            let whole: Vec<Part<1>> = (0..15).map(&mut draw).collect();
            let mut stepwise = whole.clone();
            for left in (2..15).rev() {
                reduce(&mut stepwise, left, f64::NEG_INFINITY, &[Axis::Linear]).expect("finite");
            }
            let mut at_once = whole;
            reduce(&mut at_once, 2, f64::NEG_INFINITY, &[Axis::Linear]).expect("finite");
            for (a, b) in at_once.iter().zip(&stepwise) {
                assert_eq!(a.estimate, b.estimate);
            }
        }
    }

    #[test]
    fn the_same_twice_is_merged_for_nothing() {
        let mut same = vec![part(0, 0.4, 1.0, 2.0), part(1, 0.6, 1.0, 2.0)];
        reduce(&mut same, 9, 1e-9, &[Axis::Linear]).expect("finite");
        assert_eq!(same.len(), 1);
    }
}
