//! The sum of Gaussians, and its update where directions compete for a bearing.

use alloc::vec::Vec;

use foxhunt_core::{
    Axis, Correction, Estimate, Estimator, EstimatorError, MeasurementModel, MotionModel,
    Observation, OutlierMixture, Quantity, State,
    noise::log_add,
    parameter::{not_negative, positive, require},
};

use super::{
    Reinitialise,
    bank::Bank,
    reduction::{Part, principal_axes, reduce, split_along},
};
use crate::{Kalman, Transform, count::number};

/// The lightest component that is worth splitting.
const LIGHT: f64 = 1e-3;

/// The lightest component that is kept of several hypotheses.
const NEGLIGIBLE: f64 = 1e-6;

/// The Gaussian-sum filter (Alspach & Sorenson 1972): a prior split into narrow Gaussians, each
/// run by a Kalman filter of its own.
///
/// A [`Bank`] of Kalman filters that, besides dropping what is light, merges what costs least
/// after each update (Runnalls 2007): pairs that cost less than 10⁻³ nats, and as many more as it
/// takes to have no more components than there were at the start. With
/// [`with_resplitting`](Self::with_resplitting) it splits again where the measurement is far from
/// linear. Its components may also come from a [`RangeParameterised`](crate::RangeParameterised)
/// first bearing.
///
/// ```
/// use foxhunt_core::{Estimate, Estimator, MeasurementModel, Observation, Pose, Quantity,
///     RandomWalk, State, nalgebra::{Matrix1, Vector1, Vector2}};
/// use foxhunt_filters::{GaussianSum, Ukf, split};
///
/// /// The distance of the target, in metres.
/// #[derive(Clone)]
/// struct Range;
///
/// impl MeasurementModel<2, 1> for Range {
///     fn quantities(&self) -> [Quantity; 1] {
///         [Quantity::RANGE]
///     }
///     fn expected(&self, target: &State<2>, receiver: &Pose) -> Vector1<f64> {
///         Vector1::new((target - receiver.position.xy()).norm())
///     }
/// }
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let prior = Estimate::isotropic(Vector2::zeros(), 10.0);
/// let filter = Ukf::new(RandomWalk::uniform(0.0), Range, prior)?;
/// let mut sum = GaussianSum::new(&filter, split(&prior, [7, 7])?)?;
/// let range = Observation::new(0.0, Pose::default(), Vector1::new(12.0), Matrix1::new(1.0))?;
/// let _ = sum.update(&range)?;
/// // A ring: its mean is in the middle, its samples are not.
/// assert!(sum.estimate().mean.norm() < 0.1);
/// let mut distance = 0.0;
/// sum.visit_samples(&mut |place, weight| distance += weight * place.norm());
/// assert!((distance - 12.0).abs() < 1.0);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct GaussianSum<T, F, H, const N: usize, const M: usize> {
    bank: Bank<Kalman<T, F, H, N, M>, N, M>,
    most: usize,
    cheap: f64,
    resplitting: Option<Resplitting>,
    outliers: Option<OutlierMixture<M>>,
}

impl<T, F, H, const N: usize, const M: usize> GaussianSum<T, F, H, N, M>
where
    T: Transform + Clone,
    F: MotionModel<N> + Clone,
    H: MeasurementModel<N, M> + Clone,
{
    /// A sum of these Gaussians with weights in proportion to these, each run by a copy of
    /// `filter`; as many are the most there will be.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when no Gaussian is given, a weight is negative or not finite,
    /// or all are zero; when an estimate does not make a filter.
    pub fn new(
        filter: &Kalman<T, F, H, N, M>,
        parts: impl IntoIterator<Item = (f64, Estimate<N>)>,
    ) -> Result<Self, EstimatorError> {
        let mut components = Vec::new();
        for (weight, estimate) in parts {
            let mut component = filter.clone();
            component.reinitialise(&estimate)?;
            components.push((weight, component));
        }
        let bank = Bank::new(components)?
            .with_axes(filter.motion().axes())?
            .with_innovation(Kalman::innovation);
        Ok(Self { most: bank.len(), bank, cheap: 1e-3, resplitting: None, outliers: None })
    }

    /// Sets the largest number of components after an update.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when it is 0.
    pub fn with_most_components(self, most: usize) -> Result<Self, EstimatorError> {
        require(most > 0, "most components", 0.0, "at least 1")?;
        Ok(Self { most, ..self })
    }

    /// Sets the cost, in nats, below which every pair is merged.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when it is negative or not finite.
    pub fn with_merging_below(self, cost: f64) -> Result<Self, EstimatorError> {
        Ok(Self { cheap: not_negative("merging cost", cost)?, ..self })
    }

    /// Sets the share of the heaviest component below which one is dropped, see
    /// [`Bank::with_pruning`].
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when it is not in [0, 1).
    pub fn with_pruning(self, least: f64) -> Result<Self, EstimatorError> {
        Ok(Self { bank: self.bank.with_pruning(least)?, ..self })
    }

    /// Splits a component in `parts` before an update where [`Kalman::nonlinearity`] is above
    /// `above`, the first where weight and nonlinearity are largest, again as long as that is so,
    /// up to `parts` times the most components; along that principal axis of its position that
    /// leaves the parts the more linear.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when `above` is not a positive number or the number of parts
    /// not in 2..=64.
    pub fn with_resplitting(self, above: f64, parts: usize) -> Result<Self, EstimatorError> {
        positive("nonlinearity", above)?;
        require((2..=64).contains(&parts), "parts", number(parts), "in 2..=64")?;
        Ok(Self { resplitting: Some(Resplitting { above, parts }), ..self })
    }

    /// The sum for a share of outliers among the observations: every component is split into two,
    /// one that has fused the observation and one that takes it for an outlier, with the weights
    /// that the evidence gives them. Its filters need no gate.
    #[must_use]
    pub fn with_outliers(self, outliers: OutlierMixture<M>) -> Self {
        Self { outliers: Some(outliers), ..self }
    }

    /// The weights, which sum to 1, and the filters.
    pub fn components(&self) -> impl ExactSizeIterator<Item = (f64, &Kalman<T, F, H, N, M>)> {
        self.bank.components()
    }

    pub(super) fn axes(&self) -> &[Axis; N] {
        self.bank.axes()
    }

    /// Puts other components in place of these, if together they are a belief.
    pub(super) fn replace(
        &mut self,
        components: impl IntoIterator<Item = (f64, Kalman<T, F, H, N, M>)>,
    ) -> Result<(), EstimatorError> {
        self.bank.replace(components)
    }

    /// The components, split where that is due; `None` where it is nowhere.
    #[expect(clippy::type_complexity, reason = "a list of weighted filters")]
    fn resplit(
        &self,
        observation: &Observation<M>,
    ) -> Result<Option<Vec<(f64, Kalman<T, F, H, N, M>)>>, EstimatorError> {
        let Some(Resplitting { above, parts }) = self.resplitting else { return Ok(None) };
        // What it is worth to split a component: nothing where it is linear enough, or light.
        let gain = |weight: f64, filter: &Kalman<T, F, H, N, M>| {
            let share = filter.nonlinearity(observation).unwrap_or(0.0);
            if share > above && weight >= LIGHT { weight * share } else { 0.0 }
        };
        let mut components: Vec<_> =
            self.components().map(|(w, f)| (w, f.clone(), gain(w, f))).collect();
        let mut split_any = false;
        while components.len() + parts <= self.most.saturating_mul(parts) + 1 {
            let worst = components.iter().enumerate().max_by(|a, b| a.1.2.total_cmp(&b.1.2));
            let Some((index, &(weight, _, gain_here))) = worst else { break };
            if gain_here <= 0.0 {
                break;
            }
            let (_, filter, _) = components.remove(index);
            for (share, part) in most_linear(&filter, parts, observation)? {
                let gain = gain(weight * share, &part);
                components.push((weight * share, part, gain));
            }
            split_any = true;
        }
        Ok(split_any.then(|| components.into_iter().map(|(w, f, _)| (w, f)).collect()))
    }

    /// The components with the cheapest pairs merged.
    #[expect(clippy::type_complexity, reason = "a list of weighted filters")]
    fn merged(
        &self,
        bank: &Bank<Kalman<T, F, H, N, M>, N, M>,
    ) -> Result<Vec<(f64, Kalman<T, F, H, N, M>)>, EstimatorError> {
        let filters: Vec<_> = bank.components().collect();
        let part = |(i, (weight, filter)): (usize, &(f64, &Kalman<T, F, H, N, M>))| {
            Part::new(i, *weight, filter.estimate())
        };
        let mut parts: Vec<Part<N>> = filters.iter().enumerate().map(part).collect();
        reduce(&mut parts, self.most, self.cheap, bank.axes())?;
        let mut components = Vec::with_capacity(parts.len());
        for part in parts {
            let mut filter = filters[part.origin].1.clone();
            if part.merged {
                filter.reinitialise(&part.estimate)?;
            }
            components.push((part.weight, filter));
        }
        Ok(components)
    }
}

impl<T, F, H, const N: usize, const M: usize> Estimator<N, M> for GaussianSum<T, F, H, N, M>
where
    T: Transform + Clone,
    F: MotionModel<N> + Clone,
    H: MeasurementModel<N, M> + Clone,
{
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        self.bank.predict(dt)
    }

    fn update(&mut self, observation: &Observation<M>) -> Result<Correction, EstimatorError> {
        if observation.is_empty() {
            return Ok(Correction::Empty);
        }
        let mut bank = self.bank.clone();
        if let Some(components) = self.resplit(observation)? {
            bank.replace(components)?;
        }
        let before = self.outliers.map(|outliers| (outliers, bank.clone()));
        let mut correction = update_each(&mut bank, observation)?;
        if let (Some((outliers, before)), Correction::Fused { log_evidence, .. }) =
            (before, &mut correction)
        {
            let parts = outliers.log_parts(*log_evidence, observation);
            *log_evidence = log_add(parts[0], parts[1]);
            let [sound, outlier] = parts.map(|log| libm::exp(log - *log_evidence));
            let both = bank.components().map(|(w, f)| (w * sound, f));
            let both = both.chain(before.components().map(|(w, f)| (w * outlier, f)));
            let both: Vec<_> =
                both.filter(|(w, _)| *w > NEGLIGIBLE).map(|(w, f)| (w, f.clone())).collect();
            bank.replace(both)?;
        }
        let components = self.merged(&bank)?;
        bank.replace(components)?;
        self.bank = bank;
        Ok(correction)
    }

    fn estimate(&self) -> Estimate<N> {
        self.bank.estimate()
    }

    fn quantities(&self) -> [Quantity; M] {
        self.bank.quantities()
    }

    fn visit_samples(&self, visit: &mut dyn FnMut(&State<N>, f64)) {
        self.bank.visit_samples(visit);
    }
}

#[derive(Clone, Copy, Debug)]
struct Resplitting {
    above: f64,
    parts: usize,
}

/// A filter split along the one of its position's principal axes that leaves the less nonlinear
/// parts.
#[expect(clippy::type_complexity, reason = "a list of weighted filters")]
fn most_linear<T, F, H, const N: usize, const M: usize>(
    filter: &Kalman<T, F, H, N, M>,
    parts: usize,
    observation: &Observation<M>,
) -> Result<Vec<(f64, Kalman<T, F, H, N, M>)>, EstimatorError>
where
    T: Transform + Clone,
    F: MotionModel<N> + Clone,
    H: MeasurementModel<N, M> + Clone,
{
    let mut best: Option<(f64, Vec<(f64, Kalman<T, F, H, N, M>)>)> = None;
    for axis in principal_axes(&filter.estimate())? {
        let mut split = Vec::with_capacity(parts);
        let mut left = 0.0;
        for (share, estimate) in split_along(&filter.estimate(), &axis, parts)? {
            let mut part = filter.clone();
            part.reinitialise(&estimate)?;
            left += share * part.nonlinearity(observation)?;
            split.push((share, part));
        }
        if best.as_ref().is_none_or(|(least, _)| left < *least) {
            best = Some((left, split));
        }
    }
    Ok(best.map_or_else(Vec::new, |(_, split)| split))
}

/// Conditions a bank on an observation; where directions compete for a bearing, every component
/// goes on as one for each of them, with the weights that the evidence gives them.
fn update_each<T, F, H, const N: usize, const M: usize>(
    bank: &mut Bank<Kalman<T, F, H, N, M>, N, M>,
    observation: &Observation<M>,
) -> Result<Correction, EstimatorError>
where
    T: Transform + Clone,
    F: MotionModel<N> + Clone,
    H: MeasurementModel<N, M> + Clone,
{
    if observation.bearing_modes().is_none() {
        return bank.update(observation);
    }
    let mut fused = Vec::new();
    let mut first = None;
    for (weight, one) in observation.hypotheses() {
        let mut branch = bank.clone();
        let correction = branch.update(&one)?;
        if let Correction::Fused { log_evidence, .. } = correction {
            fused.push((libm::log(weight) + log_evidence, branch));
        }
        // The first that some component fuses, or else the first.
        first = match first {
            Some(Correction::Fused { .. }) => first,
            Some(_) if !matches!(correction, Correction::Fused { .. }) => first,
            _ => Some(correction),
        };
    }
    let Some(mut correction) = first else { return Ok(Correction::Empty) };
    let highest = fused.iter().map(|(log, _)| *log).fold(f64::NEG_INFINITY, f64::max);
    if fused.is_empty() || highest <= f64::NEG_INFINITY {
        return Ok(correction);
    }
    let total: f64 = fused.iter().map(|(log, _)| libm::exp(log - highest)).sum();
    if let Correction::Fused { log_evidence, .. } = &mut correction {
        *log_evidence = highest + libm::log(total);
    }
    if let [(_, branch)] = &fused[..] {
        *bank = branch.clone();
        return Ok(correction);
    }
    let each = fused.iter().flat_map(|(log, branch)| {
        let share = libm::exp(log - highest) / total;
        branch.components().map(move |(weight, filter)| (share * weight, filter))
    });
    let each: Vec<_> = each.filter(|(w, _)| *w > NEGLIGIBLE).map(|(w, f)| (w, f.clone())).collect();
    bank.replace(each)?;
    Ok(correction)
}
