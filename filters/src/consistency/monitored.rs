use alloc::vec::Vec;

use foxhunt_core::{
    Correction, Estimate, Estimator, EstimatorError, MeasurementModel, Observation, Quantity, State,
};
use nalgebra::SVector;

use super::ChiSquaredAverage;
use crate::Innovation;

/// An estimator that records the innovations of its observations, and is otherwise the one inside.
///
/// The average of the NIS is over what the estimator itself calls so, rejected observations
/// included. The normalised innovations are worked out from the samples of the belief before
/// each update, for any family.
#[derive(Clone, Debug)]
pub struct Monitored<E, H, const M: usize> {
    estimator: E,
    model: H,
    nis: ChiSquaredAverage,
    innovations: Vec<SVector<Option<f64>, M>>,
}

impl<E, H, const M: usize> Monitored<E, H, M> {
    /// Watches an estimator over the measurement model that it has, or another; the interval of
    /// the NIS is that of 95 %.
    #[must_use]
    pub fn new(estimator: E, model: H) -> Self {
        Self { estimator, model, nis: ChiSquaredAverage::default(), innovations: Vec::new() }
    }

    /// The average of the normalised innovations squared.
    #[must_use]
    pub fn nis(&self) -> &ChiSquaredAverage {
        &self.nis
    }

    /// The normalised innovations in their order, as [`Whiteness`](super::Whiteness) takes them;
    /// those that could not be computed are missing as a whole.
    #[must_use]
    pub fn innovations(&self) -> &[SVector<Option<f64>, M>] {
        &self.innovations
    }

    /// The estimator inside.
    #[must_use]
    pub fn estimator(&self) -> &E {
        &self.estimator
    }
}

impl<E, H, const N: usize, const M: usize> Estimator<N, M> for Monitored<E, H, M>
where
    E: Estimator<N, M>,
    H: MeasurementModel<N, M>,
{
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        self.estimator.predict(dt)
    }

    fn update(&mut self, observation: &Observation<M>) -> Result<Correction, EstimatorError> {
        let innovation = Innovation::of_belief(&self.estimator, &self.model, observation);
        let correction = self.estimator.update(observation)?;
        if correction != Correction::Empty {
            let white =
                innovation.and_then(|innovation| innovation.normalised_present(observation));
            self.innovations.push(white.unwrap_or_else(|| SVector::repeat(None)));
        }
        if let Some(nis) = correction.nis() {
            self.nis.add(nis, observation.len());
        }
        Ok(correction)
    }

    fn estimate(&self) -> Estimate<N> {
        self.estimator.estimate()
    }

    fn quantities(&self) -> [Quantity; M] {
        self.estimator.quantities()
    }

    fn visit_samples(&self, visit: &mut dyn FnMut(&State<N>, f64)) {
        self.estimator.visit_samples(visit);
    }
}
