//! Several transmitters, one that may be absent, and an unknown number of them.
//!
//! A scan is a list of observations, each of which is made by one transmitter or is clutter; it is
//! not known which. A transmitter makes at most one observation of a scan ([`Detection`]).
//!
//! | filter | transmitters | source |
//! |-|-|-|
//! | [`BernoulliFilter`] | one or none | Ristic, Vo, Vo & Farina 2013 |
//! | [`Jpda`] | a known number | Fortmann, Bar-Shalom & Scheffe 1983 |
//! | [`LabelledMultiBernoulli`] | an unknown number, labelled | Reuter, Vo, Vo & Dietmayer 2014 |
//!
//! Each runs over any [`Estimator`]: Kalman filters, clouds, cells. The
//! density of a track is a weighted sum of them, one for each association history ([`Reduction`]).
//! The probabilities of all joint associations are in [`Associations`].
//!
//! From rows of still transmitters, all at once, [`Sorting`] finds how many transmitters made them,
//! and which made which.
//!
//! [`gospa`] and [`ospa`] are distances between the found transmitters and the true ones.

mod assignment;
mod association;
mod bernoulli;
mod jpda;
mod labelled;
mod metric;
mod partition;
mod scan;

pub use assignment::{Assignment, assign};
pub use association::Associations;
pub use bernoulli::{BernoulliFilter, Lifetime};
pub use jpda::Jpda;
pub use labelled::{Label, LabelledMultiBernoulli, Track};
pub use metric::{Gospa, Ospa, gospa, ospa};
pub use partition::{Group, Sorted, Sorting};
pub use scan::Detection;

use alloc::vec::Vec;

use foxhunt_core::{
    Axis, Correction, Covariance, Estimate, Estimator, EstimatorError, Observation, Role, State,
    noise::log_add,
    parameter::{ParameterError, not_negative, require},
};

use crate::mixture::{Component, Part, belief_of, normalise, reduce};

/// Puts a Gaussian in place of an estimator's belief, such as
/// [`Reinitialise::reinitialise`](crate::Reinitialise::reinitialise).
pub type ReplaceBelief<E, const N: usize> = fn(&mut E, &Estimate<N>) -> Result<(), EstimatorError>;

/// Rules that keep a track's number of association histories small.
///
/// Each scan multiplies the histories of a track by its number of observations. After each scan
/// those below a share of the heaviest are dropped, and the lightest until there are at most as
/// many as stated. With [`with_merging`](Self::with_merging) similar ones are merged first.
#[derive(Clone, Copy, Debug)]
pub struct Reduction<E, const N: usize> {
    least: f64,
    most: usize,
    merging: Option<(f64, ReplaceBelief<E, N>)>,
}

impl<E, const N: usize> Reduction<E, N> {
    /// Drops histories below the share `least` of the heaviest one, and keeps at most `most`.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] when `least` is not in [0, 1), or `most` is 0.
    pub fn new(least: f64, most: usize) -> Result<Self, ParameterError> {
        require((0.0..1.0).contains(&least), "the least share of a history", least, "in [0, 1)")?;
        require(most > 0, "most histories", 0.0, "at least 1")?;
        Ok(Self { least, most, merging: None })
    }

    /// Merges two histories into a Gaussian with their mean and covariance where that costs less
    /// than `cost` nats (Runnalls 2007), and the cheapest ones until there are at most as many as
    /// [`new`](Self::new) states. `replace` puts the Gaussian into the heavier history's estimator.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] when the cost is negative or not finite.
    pub fn with_merging(
        self,
        cost: f64,
        replace: ReplaceBelief<E, N>,
    ) -> Result<Self, ParameterError> {
        Ok(Self { merging: Some((not_negative("merging cost", cost)?, replace)), ..self })
    }
}

impl<E, const N: usize> Default for Reduction<E, N> {
    /// A share of 10⁻⁴ of the heaviest, at most 16 histories, no merging.
    fn default() -> Self {
        Self { least: 1e-4, most: 16, merging: None }
    }
}

/// A weighted sum of estimators whose weights sum to 1.
#[derive(Clone, Debug)]
struct Density<E> {
    parts: Vec<Component<E>>,
}

/// A density after an observation, before it is weighed against other associations.
struct Updated<E> {
    parts: Vec<Component<E>>,
    /// ln p(z | the track made z).
    pub log_evidence: f64,
}

impl<E: Clone> Density<E> {
    fn new(estimator: E) -> Self {
        Self { parts: alloc::vec![Component { estimator, log_weight: 0.0 }] }
    }

    /// Number of histories.
    fn len(&self) -> usize {
        self.parts.len()
    }

    /// The sum of densities with these weights.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::NotFinite`] if no weight is positive.
    fn sum(weighted: impl IntoIterator<Item = (f64, Self)>) -> Result<Self, EstimatorError> {
        let weighted = weighted.into_iter().filter(|(weight, _)| *weight > 0.0);
        let parts = weighted.flat_map(|(weight, density)| {
            let log_weight = libm::log(weight);
            density
                .parts
                .into_iter()
                .map(move |part| Component { log_weight: part.log_weight + log_weight, ..part })
        });
        let mut parts: Vec<_> = parts.collect();
        normalise(&mut parts).ok_or(EstimatorError::NotFinite { role: Role::Posterior })?;
        Ok(Self { parts })
    }

    fn predict<const N: usize, const M: usize>(&mut self, dt: f64) -> Result<(), EstimatorError>
    where
        E: Estimator<N, M>,
    {
        self.parts.iter_mut().try_for_each(|part| part.estimator.predict(dt))
    }

    /// The density given that the track made an observation. `None` where no history can have made
    /// it, or its gate keeps it out.
    fn updated<const N: usize, const M: usize>(
        &self,
        observation: &Observation<M>,
    ) -> Option<Updated<E>>
    where
        E: Estimator<N, M>,
    {
        let mut parts = Vec::with_capacity(self.parts.len());
        let mut log_evidence = f64::NEG_INFINITY;
        for part in &self.parts {
            let mut estimator = part.estimator.clone();
            // A history that fails here cannot have made the observation; it stays in the density
            // of a track that made none.
            if let Ok(Correction::Fused { log_evidence: own, .. }) = estimator.update(observation)
                && own.is_finite()
            {
                let log_weight = part.log_weight + own;
                log_evidence = log_add(log_evidence, log_weight);
                parts.push(Component { estimator, log_weight });
            }
        }
        normalise(&mut parts)?;
        Some(Updated { parts, log_evidence })
    }

    /// Conditions every history on an observation that the track is certain to have made, such as a
    /// silence; returns the log-evidence.
    fn condition<const N: usize, const M: usize>(
        &mut self,
        observation: &Observation<M>,
    ) -> Result<f64, EstimatorError>
    where
        E: Estimator<N, M>,
    {
        for part in &mut self.parts {
            if let Correction::Fused { log_evidence, .. } = part.estimator.update(observation)? {
                part.log_weight += log_evidence;
            }
        }
        normalise(&mut self.parts).ok_or(EstimatorError::NotFinite { role: Role::Posterior })
    }

    fn estimate<const N: usize, const M: usize>(
        &self,
        axes: &[Axis; N],
    ) -> Result<Estimate<N>, EstimatorError>
    where
        E: Estimator<N, M>,
    {
        belief_of(&self.parts, axes)
    }

    fn visit_samples<const N: usize, const M: usize>(&self, visit: &mut dyn FnMut(&State<N>, f64))
    where
        E: Estimator<N, M>,
    {
        for part in &self.parts {
            let share = part.weight();
            part.estimator.visit_samples(&mut |state, weight| visit(state, share * weight));
        }
    }

    /// Merges and drops histories by the rules of `reduction`.
    fn reduce<const N: usize, const M: usize>(
        &mut self,
        reduction: &Reduction<E, N>,
        axes: &[Axis; N],
    ) -> Result<(), EstimatorError>
    where
        E: Estimator<N, M>,
    {
        let heaviest = self.parts.iter().map(|p| p.log_weight).fold(f64::NEG_INFINITY, f64::max);
        let least = heaviest + libm::log(reduction.least);
        self.parts.retain(|part| part.log_weight >= least);
        if let Some((cost, replace)) = reduction.merging
            && self.parts.len() > 1
        {
            let of = |(index, part): (usize, &Component<E>)| {
                Part::new(index, part.weight(), part.estimator.estimate())
            };
            let mut parts: Vec<Part<N>> = self.parts.iter().enumerate().map(of).collect();
            reduce(&mut parts, reduction.most, cost, axes)?;
            let mut merged = Vec::with_capacity(parts.len());
            for part in parts {
                let Some(own) = self.parts.get(part.origin) else { continue };
                let mut estimator = own.estimator.clone();
                if part.merged {
                    replace(&mut estimator, &part.estimate)?;
                }
                merged.push(Component { estimator, log_weight: libm::log(part.weight) });
            }
            self.parts = merged;
        }
        if self.parts.len() > reduction.most {
            // A stable sort: equal weights keep their order, so that a run can be repeated.
            self.parts.sort_by(|a, b| b.log_weight.total_cmp(&a.log_weight));
            self.parts.truncate(reduction.most);
        }
        normalise(&mut self.parts).ok_or(EstimatorError::NotFinite { role: Role::Posterior })?;
        Ok(())
    }
}

impl<E> Updated<E> {
    fn into_density(self) -> Density<E> {
        Density { parts: self.parts }
    }
}

/// Refuses an estimate that is not finite, or whose covariance is not positive definite.
fn proper<const N: usize>(estimate: Estimate<N>) -> Result<Estimate<N>, EstimatorError> {
    let role = Role::Posterior;
    let Estimate { mean, covariance }: Estimate<N> = estimate;
    if !mean.iter().chain(covariance.iter()).all(|c| c.is_finite()) {
        return Err(EstimatorError::NotFinite { role });
    }
    let symmetric: Covariance<N> = (covariance + covariance.transpose()) * 0.5;
    match symmetric.cholesky() {
        Some(_) => Ok(Estimate { mean, covariance: symmetric }),
        None => Err(EstimatorError::NotPositiveDefinite { role }),
    }
}
