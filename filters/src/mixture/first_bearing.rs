//! A first bearing as a row of Gaussians along it.

use alloc::vec::Vec;

use foxhunt_core::{
    Axis, Correction, Estimate, Estimator, EstimatorError, MeasurementModel, MotionModel,
    Observation, Pose, Quantity, State,
    parameter::{ParameterError, finite, not_negative, positive, require},
};
use nalgebra::{Matrix2, Vector2};

use super::GaussianSum;
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
    pub(super) filter: Kalman<T, F, H, N, M>,
    pub(super) bank: Option<GaussianSum<T, F, H, N, M>>,
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

/// A first bearing and an interval of ranges as components of a bank: Gaussians in a row along the
/// bearing, their ranges in geometric progression, so that each has the same coefficient of
/// variation and its filter the same nonlinearity (Peach 1995; Arulampalam & Ristic 2000).
///
/// With ρ = (r_max / r_min)^(1/k), component i covers r_min ρ^(i−1) … r_min ρ^i: its range
/// has the mean of that interval and its width / √12 as standard deviation. The bearing that this
/// was made of must not be fused again.
///
/// ```
/// use foxhunt_core::{Estimate, Pose, State};
/// use foxhunt_filters::RangeParameterised;
///
/// # fn main() -> Result<(), foxhunt_core::EstimatorError> {
/// let row = RangeParameterised::new(&Pose::default(), (0.5, 0.03), (100.0, 6400.0), 6)?;
/// // East and North of this prior are replaced, its velocity stays.
/// let velocity = Estimate::isotropic(State::<4>::zeros(), 5.0);
/// let components = row.states(&velocity);
/// assert_eq!(components.len(), 6);
/// assert!((components[0].1.mean.xy().norm() - 150.0).abs() < 0.1);
/// assert!((components[5].1.mean.xy().norm() - 4800.0).abs() < 3.0);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct RangeParameterised {
    receiver: Vector2<f64>,
    bearing: (f64, f64),
    /// The ends of the intervals, one more than there are.
    ends: Vec<f64>,
    weights: Vec<f64>,
}

impl RangeParameterised {
    /// `parts` components of one weight, from a bearing with its standard deviation, in radians,
    /// taken at `receiver`, and the least and the largest range, in metres.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when the bearing or the receiver is not finite, its standard
    /// deviation or the least range not positive, the interval empty or infinite, or the number
    /// of parts not in 1..=1000.
    pub fn new(
        receiver: &Pose,
        bearing: (f64, f64),
        (least, most): (f64, f64),
        parts: usize,
    ) -> Result<Self, EstimatorError> {
        let receiver = receiver.position.xy();
        finite("receiver", receiver.sum())?;
        finite("bearing", bearing.0)?;
        positive("sigma of the bearing", bearing.1)?;
        positive("least range", least)?;
        require(most > least && most.is_finite(), "largest range", most, "above the least")?;
        require((1..=1000).contains(&parts), "parts", number(parts), "in 1..=1000")?;
        let end = |i: usize| least * libm::pow(most / least, number(i) / number(parts));
        let (ends, weights) =
            ((0..=parts).map(end).collect(), Vec::from_iter((0..parts).map(|_| 1.0)));
        Ok(Self { receiver, bearing, ends, weights })
    }

    /// Sets the weights from a prior of the range: `mass(a, b)` is in proportion to its probability
    /// between `a` and `b` metres.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when one is negative or not finite, or all are zero.
    pub fn with_prior(self, mass: impl Fn(f64, f64) -> f64) -> Result<Self, EstimatorError> {
        let weights: Vec<f64> = self.ends.windows(2).map(|end| mass(end[0], end[1])).collect();
        for weight in &weights {
            not_negative("range prior", *weight)?;
        }
        let sum = weights.iter().sum::<f64>();
        require(sum > 0.0, "range prior", sum, "positive somewhere")?;
        Ok(Self { weights, ..self })
    }

    /// The components of a target at rest: weights, not normalised, and places.
    #[must_use]
    pub fn places(&self) -> Vec<(f64, Estimate<2>)> {
        let place = |(end, weight): (&[f64], &f64)| {
            let middle = 0.5 * (end[0] + end[1]);
            let width = end[1] - end[0];
            let mut place = polar_moments((middle, width / libm::sqrt(12.0)), self.bearing);
            place.mean += self.receiver;
            (*weight, place)
        };
        self.ends.windows(2).zip(&self.weights).map(place).collect()
    }

    /// Returns the components of a state whose first two components are the place: the others, such
    /// as a velocity, come from `rest`, independent of it.
    #[must_use]
    pub fn states<const N: usize>(&self, rest: &Estimate<N>) -> Vec<(f64, Estimate<N>)> {
        let state = |(weight, place): (f64, Estimate<2>)| {
            let mut state = *rest;
            state.mean.fixed_rows_mut::<2>(0).copy_from(&place.mean);
            state.covariance.fixed_rows_mut::<2>(0).fill(0.0);
            state.covariance.fixed_columns_mut::<2>(0).fill(0.0);
            state.covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&place.covariance);
            (weight, state)
        };
        self.places().into_iter().map(state).collect()
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

/// The mean and covariance of a vector whose length and direction are independent: a length of
/// this mean and standard deviation, and a normal direction, in radians counter-clockwise from
/// East.
///
/// Exact however uncertain the direction is (Lerro & Bar-Shalom 1993; Longbin et al. 1998): with
/// its deviation δ, E cos δ = exp(−σ² / 2) and E cos² δ = (1 + exp(−2 σ²)) / 2.
#[must_use]
pub fn polar_moments(
    (length, sigma_length): (f64, f64),
    (direction, sigma_direction): (f64, f64),
) -> Estimate<2> {
    let variance = sigma_direction * sigma_direction;
    let square = length * length + sigma_length * sigma_length;
    let shrunk = libm::exp(-0.5 * variance);
    let twice = libm::exp(-2.0 * variance);
    // Along the mean direction and across it. The difference of the first is that of a thin
    // fan's length, spelled out so that nothing cancels: E[r²] (1 + e^(−2σ²)) / 2 − r²
    // e^(−σ²).
    let fan = libm::expm1(-variance);
    let along =
        0.5 * length * length * fan * fan + 0.5 * sigma_length * sigma_length * (1.0 + twice);
    let across = -0.5 * square * libm::expm1(-2.0 * variance);
    let (sin, cos) = libm::sincos(direction);
    let turn = Matrix2::new(cos, -sin, sin, cos);
    let mut covariance =
        turn * Matrix2::from_diagonal(&Vector2::new(along, across)) * turn.transpose();
    covariance.fill_upper_triangle_with_lower_triangle();
    Estimate { mean: Vector2::new(cos, sin) * (length * shrunk), covariance }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn the_moments_are_those_of_an_integral() {
        for (sigma, direction, spread) in [(0.3, 0.7, 0.9), (2.0, -2.0, 0.05), (1.0, 3.0, 2.0)] {
            let made = polar_moments((5.0, sigma), (direction, spread));
            let mut mass = 0.0;
            let mut mean = Vector2::zeros();
            let mut second = Matrix2::zeros();
            for i in -200..=200 {
                let at = f64::from(i) * 0.04;
                let weight = libm::exp(-0.5 * at * at);
                let (sin, cos) = libm::sincos(direction + spread * at);
                let unit = Vector2::new(cos, sin);
                mass += weight;
                mean += unit * (5.0 * weight);
                second += unit * unit.transpose() * (weight * (25.0 + sigma * sigma));
            }
            mean /= mass;
            let covariance = second / mass - mean * mean.transpose();
            assert!((made.mean - mean).norm() < 1e-12, "{}", made.mean);
            assert!((made.covariance - covariance).norm() < 1e-11, "{}", made.covariance);
        }
    }

    #[test]
    fn a_thin_fan_keeps_its_digits() {
        let made = polar_moments((1e4, 1.0), (0.0, 1e-6));
        // Across: (r σ)² (1 − σ²) + …; along: σ_r² and half of (r σ²)².
        assert_abs_diff_eq!(made.covariance[(1, 1)], 1e-4, epsilon = 1e-10);
        assert_abs_diff_eq!(made.covariance[(0, 0)], 1.0, epsilon = 1e-10);
    }
}
