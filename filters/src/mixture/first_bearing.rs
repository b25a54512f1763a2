use foxhunt_core::{
    Axis, Correction, Estimate, Estimator, EstimatorError, MeasurementModel, MotionModel,
    Observation, Quantity, State,
    parameter::{ParameterError, require},
};
use nalgebra::Vector2;

use super::{GaussianSum, RangeParameterised};
use crate::{Kalman, Transform, count::number};

/// The least range of a bank, as a share of the largest.
const LEAST_SHARE: f64 = 0.01;

/// Reach of the largest range beyond the prior's mean, in standard deviations of the prior.
const BEYOND: f64 = 3.0;

/// A range-parameterised bank that begins with its first bearing (Peach 1995).
///
/// Until the first bearing it is the Kalman filter that it is made of. The first one becomes a
/// row of Gaussians along its ray ([`RangeParameterised`]), from 1/100 of the largest range to
/// what the belief then has within three standard deviations; their weights are what that belief
/// has along the ray. The rest of that observation, such as a level, is fused by each.
#[derive(Clone, Debug)]
pub struct FirstBearing<T, F, H, const N: usize, const M: usize> {
    filter: Kalman<T, F, H, N, M>,
    bank: Option<GaussianSum<T, F, H, N, M>>,
    /// Index of the bearing in the measurement.
    bearing: usize,
    parts: usize,
}

impl<T, F, H, const N: usize, const M: usize> FirstBearing<T, F, H, N, M>
where
    T: Transform + Clone,
    F: MotionModel<N> + Clone,
    H: MeasurementModel<N, M> + Clone,
{
    /// A bank of `parts` copies of a filter, whose belief is the prior.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when no component of the measurement is an angle, or the
    /// number of parts is not in 1..=1000.
    pub fn new(filter: Kalman<T, F, H, N, M>, parts: usize) -> Result<Self, EstimatorError> {
        let angle = filter.measurement().axes().iter().position(|axis| *axis == Axis::Angle);
        let name = "bearings among the components";
        let requirement = "at least one";
        let bearing = angle.ok_or(ParameterError { name, value: 0.0, requirement })?;
        require((1..=1000).contains(&parts), "parts", number(parts), "in 1..=1000")?;
        Ok(Self { filter, bank: None, bearing, parts })
    }

    /// The bank, once there was a bearing.
    #[must_use]
    pub fn bank(&self) -> Option<&GaussianSum<T, F, H, N, M>> {
        self.bank.as_ref()
    }

    /// The bank that an observation's bearing makes of the belief.
    fn begin(
        &self,
        observation: &Observation<M>,
    ) -> Result<GaussianSum<T, F, H, N, M>, EstimatorError> {
        let (angle, variance) =
            (observation.value()[self.bearing], observation.noise()[(self.bearing, self.bearing)]);
        let belief = self.filter.estimate();
        let place = belief.position();
        let receiver = observation.receiver();
        let spread = libm::sqrt(place.covariance.trace());
        let most = (place.mean - receiver.position.xy()).norm() + BEYOND * spread;
        let bearing = (angle, libm::sqrt(variance));
        let row =
            RangeParameterised::new(receiver, bearing, (most * LEAST_SHARE, most), self.parts)?
                .with_prior(|near, far| mass(&place, &receiver.position.xy(), angle, near, far))?;
        GaussianSum::new(&self.filter, row.states(&belief))
    }
}

/// Returns a Gaussian's mass between two ranges along a ray, per radian: ∫ p r dr by Simpson's
/// rule.
fn mass(place: &Estimate<2>, from: &Vector2<f64>, angle: f64, near: f64, far: f64) -> f64 {
    let Some(factor) = place.covariance.cholesky() else { return 0.0 };
    let (sin, cos) = libm::sincos(angle);
    let at = |range: f64| {
        let away = from + Vector2::new(cos, sin) * range - place.mean;
        range * libm::exp(-0.5 * away.dot(&factor.solve(&away)))
    };
    (far - near) / 6.0 * (at(near) + 4.0 * at(0.5 * (near + far)) + at(far)) + f64::MIN_POSITIVE
}

impl<T, F, H, const N: usize, const M: usize> Estimator<N, M> for FirstBearing<T, F, H, N, M>
where
    T: Transform + Clone,
    F: MotionModel<N> + Clone,
    H: MeasurementModel<N, M> + Clone,
{
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        match &mut self.bank {
            Some(bank) => bank.predict(dt),
            None => self.filter.predict(dt),
        }
    }

    fn update(&mut self, observation: &Observation<M>) -> Result<Correction, EstimatorError> {
        if let Some(bank) = &mut self.bank {
            return bank.update(observation);
        }
        if !observation.has(self.bearing) {
            return self.filter.update(observation);
        }
        // The bearing is the bank's prior; its evidence given the belief before is that of the
        // filter.
        let mut alone = self.filter.clone();
        let correction = alone.update(observation)?;
        if matches!(correction, Correction::Fused { .. }) {
            let mut bank = self.begin(observation)?;
            let _ = bank.update(&observation.without(self.bearing))?;
            self.bank = Some(bank);
        } else {
            self.filter = alone;
        }
        Ok(correction)
    }

    fn estimate(&self) -> Estimate<N> {
        match &self.bank {
            Some(bank) => bank.estimate(),
            None => self.filter.estimate(),
        }
    }

    fn quantities(&self) -> [Quantity; M] {
        self.filter.quantities()
    }

    fn visit_samples(&self, visit: &mut dyn FnMut(&State<N>, f64)) {
        match &self.bank {
            Some(bank) => bank.visit_samples(visit),
            None => self.filter.visit_samples(visit),
        }
    }
}
