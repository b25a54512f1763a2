use alloc::vec::Vec;

use foxhunt_core::{
    Estimate, EstimatorError, Pose,
    parameter::{finite, not_negative, positive, require},
};
use nalgebra::Vector2;

use super::polar_moments;
use crate::count::number;

/// A first bearing and an interval of ranges as components of a bank: Gaussians in a row along the
/// bearing, their ranges in geometric progression, so that each has the same coefficient of
/// variation and its filter the same nonlinearity (Peach 1995; Arulampalam & Ristic 2000).
///
/// With ρ = (r_max / r_min)^(1/k), component i covers r_min ρ^(i−1) … r_min ρ^i: its range has the
/// mean of that interval and its width / √12 as standard deviation. The bearing that this was made
/// of must not be fused again.
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
