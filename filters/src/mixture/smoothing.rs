//! Mixtures of Gaussians, smoothed: every earlier component by every later one.

use alloc::{vec, vec::Vec};

use foxhunt_core::{
    Axis, Covariance, Estimate, Estimator, EstimatorError, MeasurementModel, MotionModel, Role,
    Smooth, State,
};

use super::{Component, FirstBearing, GaussianSum, Imm, Reinitialise, combine, normalise};
use crate::{
    Kalman, Transform,
    smoothing::{Passage, Passing},
};

/// A later component, smoothed.
struct Later<const N: usize> {
    log_weight: f64,
    estimate: Estimate<N>,
}

/// Returns the earlier components' logarithms of smoothed weights and their smoothed moments.
///
/// `earlier` are ln μᵢ and moments before the step, `log_chain(i, j)` is ln p(j after i),
/// `passage(i, j)` the step from i by the motion of j. All that came later enters as the ratio of
/// smoothed to predicted density in mode j, β(x₊) = μˢ Nˢ / μ⁻ N⁻, with N⁻ the moments
/// of all that comes to j. Each pair (i, j) has the weight μᵢ p(j | i) ∫ Nᵢⱼ β dx₊ and
/// is smoothed as one Gaussian (Koch 2000; Nadarajah, Tharmarasa, McDonald & Kirubarajan 2012).
/// Pairs of one i are merged to their moments. With one mode it is the smoother of Rauch, Tung &
/// Striebel.
///
/// # Errors
///
/// An error when a predicted covariance is not positive definite or nothing is possible.
fn smoothed<const N: usize>(
    earlier: &[(f64, Estimate<N>)],
    later: &[Later<N>],
    log_chain: &dyn Fn(usize, usize) -> f64,
    passage: &dyn Fn(usize, usize) -> Result<Passage<N>, EstimatorError>,
    axes: &[Axis; N],
) -> Result<Vec<(f64, Estimate<N>)>, EstimatorError> {
    let mut pairs: Vec<Vec<(f64, Estimate<N>)>> = vec![Vec::new(); earlier.len()];
    for (j, later) in later.iter().enumerate() {
        if later.log_weight <= f64::NEG_INFINITY {
            continue;
        }
        let mut coming = Vec::new();
        for (i, (log_weight, belief)) in earlier.iter().enumerate() {
            let log = log_weight + log_chain(i, j);
            if log > f64::NEG_INFINITY {
                let step = passage(i, j)?;
                coming.push((i, log, step, step.ahead(belief)));
            }
        }
        let best = coming.iter().map(|c| c.1).fold(f64::NEG_INFINITY, f64::max);
        let total: f64 = coming.iter().map(|c| libm::exp(c.1 - best)).sum();
        let weighted = coming.iter().map(|c| (libm::exp(c.1 - best) / total, c.3));
        let Some(news) = News::of(later, &combine(weighted, axes)?, axes) else { continue };
        let log_news = later.log_weight - best - libm::log(total);
        for (i, log, step, ahead) in &coming {
            let (log_match, at) = news.of_pair(ahead);
            let back = step.back(&earlier[*i].1, &at, axes)?;
            pairs[*i].push((log + log_news + log_match, back));
        }
    }
    let merge = |pairs: Vec<(f64, Estimate<N>)>, before: &Estimate<N>| {
        let best = pairs.iter().map(|pair| pair.0).fold(f64::NEG_INFINITY, f64::max);
        if best <= f64::NEG_INFINITY {
            return Ok((f64::NEG_INFINITY, *before));
        }
        let total: f64 = pairs.iter().map(|pair| libm::exp(pair.0 - best)).sum();
        let parts = pairs.iter().map(|pair| (libm::exp(pair.0 - best) / total, pair.1));
        Ok((best + libm::log(total), combine(parts, axes)?))
    };
    pairs.into_iter().zip(earlier).map(|(pairs, (_, before))| merge(pairs, before)).collect()
}

/// The ratio of a smoothed to a predicted Gaussian, about the predicted mean.
struct News<'a, const N: usize> {
    axes: &'a [Axis; N],
    origin: State<N>,
    /// Without a ratio that is a density times a Gaussian, what a pair goes on to.
    smoothed: Estimate<N>,
    /// S⁻¹ − P⁻¹ and S⁻¹ s.
    information: Covariance<N>,
    shift: State<N>,
    /// ln of the ratio at the origin.
    log: f64,
}

impl<'a, const N: usize> News<'a, N> {
    fn of(later: &Later<N>, predicted: &Estimate<N>, axes: &'a [Axis; N]) -> Option<Self> {
        let own = later.estimate.covariance.cholesky()?;
        let before = predicted.covariance.cholesky()?;
        let off = Axis::difference(axes, &later.estimate.mean, &predicted.mean);
        let inverse = own.inverse();
        let shift = own.solve(&off);
        let log = log_root(&before.l()) - log_root(&own.l()) - 0.5 * off.dot(&shift);
        let information = inverse - before.inverse();
        let origin = predicted.mean;
        Some(Self { axes, origin, smoothed: later.estimate, information, shift, log })
    }

    /// ln ∫ N β over a pair's prediction, and the pair's smoothed belief after the step.
    fn of_pair(&self, ahead: &Estimate<N>) -> (f64, Estimate<N>) {
        // Where merging made the smoothed belief wider than the predicted one, the pair is taken
        // to be as likely as before.
        self.exact(ahead).unwrap_or((0.0, self.smoothed))
    }

    fn exact(&self, ahead: &Estimate<N>) -> Option<(f64, Estimate<N>)> {
        let own = ahead.covariance.cholesky()?;
        let off = Axis::difference(self.axes, &ahead.mean, &self.origin);
        let along = own.solve(&off);
        let both = (own.inverse() + self.information).cholesky()?;
        let pull = along + self.shift;
        let mean = both.solve(&pull);
        let log = self.log - log_root(&own.l()) - log_root(&both.l())
            + 0.5 * (pull.dot(&mean) - off.dot(&along));
        let mut covariance = both.inverse();
        covariance.fill_upper_triangle_with_lower_triangle();
        log.is_finite().then_some((log, Estimate { mean: self.origin + mean, covariance }))
    }
}

/// ½ ln |A| of a factor.
fn log_root<const N: usize>(factor: &Covariance<N>) -> f64 {
    factor.diagonal().iter().map(|d| libm::log(*d)).sum()
}

/// Each mode by each later mode, with the chain's probabilities.
impl<E, const N: usize, const M: usize> Smooth<N, M> for Imm<E, N, M>
where
    E: Estimator<N, M> + Reinitialise<N> + Passing<N> + Clone,
{
    fn smooth(&mut self, later: &Self, dt: f64) -> Result<(), EstimatorError> {
        EstimatorError::check_time_step(dt)?;
        let modes = self.models.len();
        let over = match dt > 0.0 {
            true => self.chain.over(dt),
            // No time, no change.
            false => {
                (0..modes * modes).map(|k| if k / modes == k % modes { 1.0 } else { 0.0 }).collect()
            }
        };
        let moments = |model: &Component<E>| (model.log_weight, model.estimator.estimate());
        let earlier: Vec<_> = self.models.iter().map(moments).collect();
        let after: Vec<_> = (later.models.iter().map(moments))
            .map(|(log_weight, estimate)| Later { log_weight, estimate })
            .collect();
        let log_chain = |i: usize, j: usize| libm::log(over[i * modes + j]);
        let passage = |i: usize, j: usize| self.models[j].estimator.passage(&earlier[i].1, dt);
        let smoothed = smoothed(&earlier, &after, &log_chain, &passage, &self.axes)?;
        self.spare.clone_from(&self.models);
        for (model, (log_weight, estimate)) in self.spare.iter_mut().zip(&smoothed) {
            model.estimator.reinitialise(estimate)?;
            model.log_weight = *log_weight;
        }
        let lost = EstimatorError::NotFinite { role: Role::Posterior };
        normalise(&mut self.spare).ok_or(lost)?;
        self.take()
    }
}

/// Each component by the moments of the later sum.
impl<T, F, H, const N: usize, const M: usize> Smooth<N, M> for GaussianSum<T, F, H, N, M>
where
    T: Transform + Clone,
    F: MotionModel<N> + Clone,
    H: MeasurementModel<N, M> + Clone,
{
    fn smooth(&mut self, later: &Self, dt: f64) -> Result<(), EstimatorError> {
        let parts: Vec<_> = self.components().map(|(w, f)| (w, f.clone())).collect();
        let earlier: Vec<_> = parts.iter().map(|(w, f)| (libm::log(*w), f.estimate())).collect();
        let after = [Later { log_weight: 0.0, estimate: later.estimate() }];
        let passage = |i: usize, _| parts[i].1.passage(&earlier[i].1, dt);
        let smoothed = smoothed(&earlier, &after, &|_, _| 0.0, &passage, self.axes())?;
        let best = smoothed.iter().map(|part| part.0).fold(f64::NEG_INFINITY, f64::max);
        let mut components = Vec::with_capacity(parts.len());
        for ((_, mut filter), (log_weight, estimate)) in parts.into_iter().zip(smoothed) {
            filter.reinitialise(&estimate)?;
            components.push((libm::exp(log_weight - best), filter));
        }
        self.replace(components)
    }
}

/// Smooths as the filter before the first bearing, and as the bank after it.
impl<T, F, H, const N: usize, const M: usize> Smooth<N, M> for FirstBearing<T, F, H, N, M>
where
    T: Transform + Clone,
    F: MotionModel<N> + Clone,
    H: MeasurementModel<N, M> + Clone,
{
    fn smooth(&mut self, later: &Self, dt: f64) -> Result<(), EstimatorError> {
        if let (Some(bank), Some(later)) = (&mut self.bank, &later.bank) {
            return bank.smooth(later, dt);
        }
        let filter: &mut Kalman<T, F, H, N, M> = &mut self.filter;
        let belief = filter.estimate();
        let axes = filter.motion().axes();
        let back = filter.passage(&belief, dt)?.back(&belief, &later.estimate(), &axes)?;
        filter.reinitialise(&back)
    }
}
