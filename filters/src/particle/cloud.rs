use alloc::{vec, vec::Vec};

use foxhunt_core::{Axis, Covariance, Estimate, EstimatorError, Role, State, angle::Resultant};

use crate::count::number;

/// Weighted states, one column for each component.
#[derive(Clone, Debug)]
pub(super) struct Cloud<const N: usize> {
    pub(super) columns: [Vec<f64>; N],
    pub(super) weights: Weights,
}

impl<const N: usize> Cloud<N> {
    pub(super) fn len(&self) -> usize {
        self.weights.linear.len()
    }

    /// No particle at all.
    pub(super) fn empty() -> Self {
        let weights = Weights { linear: Vec::new(), log: Vec::new() };
        Self { columns: core::array::from_fn(|_| Vec::new()), weights }
    }

    /// Becomes `other`, in the memory that it has if that is enough.
    pub(super) fn copy_from(&mut self, other: &Self) {
        self.resize(other.len());
        for (column, others) in self.columns.iter_mut().zip(&other.columns) {
            column.copy_from_slice(others);
        }
        self.weights.copy_from(&other.weights);
    }

    /// Makes room for `count` particles; what they hold is of no use.
    pub(super) fn resize(&mut self, count: usize) {
        self.columns.iter_mut().for_each(|column| column.resize(count, 0.0));
        self.weights.linear.resize(count, 0.0);
        self.weights.log.resize(count, 0.0);
    }

    pub(super) fn state(&self, particle: usize) -> State<N> {
        State::from_fn(|row, _| self.columns[row][particle])
    }

    /// Adds a particle without a weight yet.
    pub(super) fn push(&mut self, state: &State<N>) {
        self.columns.iter_mut().zip(state.iter()).for_each(|(column, value)| column.push(*value));
        self.weights.linear.push(0.0);
        self.weights.log.push(0.0);
    }

    pub(super) fn set(&mut self, particle: usize, state: &State<N>) {
        for (column, value) in self.columns.iter_mut().zip(state.iter()) {
            column[particle] = *value;
        }
    }
}

/// Weights that sum to 1, and their logarithms: a product of many likelihoods underflows.
#[derive(Clone, Debug)]
pub(super) struct Weights {
    pub(super) linear: Vec<f64>,
    pub(super) log: Vec<f64>,
}

impl Weights {
    pub(super) fn even(count: usize) -> Self {
        let share = 1.0 / number(count);
        Self { linear: vec![share; count], log: vec![libm::log(share); count] }
    }

    pub(super) fn fill_even(&mut self) {
        let share = 1.0 / number(self.linear.len());
        self.linear.fill(share);
        self.log.fill(libm::log(share));
    }

    pub(super) fn copy_from(&mut self, other: &Self) {
        self.linear.copy_from_slice(&other.linear);
        self.log.copy_from_slice(&other.log);
    }

    /// 1 / Σ w².
    pub(super) fn effective_sample_size(&self) -> f64 {
        1.0 / self.linear.iter().map(|w| w * w).sum::<f64>()
    }

    /// Makes the posterior weights, `self.log` being the log-likelihoods and `prior` the weights
    /// so far; returns the log-evidence ln Σ wᵢ p(z | xᵢ).
    ///
    /// # Errors
    ///
    /// When a likelihood is NaN or infinite, or none is positive; `self` is then of no use.
    pub(super) fn condition(&mut self, prior: &Self) -> Result<f64, EstimatorError> {
        let mut best = f64::NEG_INFINITY;
        for (log, before) in self.log.iter_mut().zip(&prior.log) {
            // A particle that was impossible stays so, whatever it makes of this observation.
            if log.is_nan() || *log >= f64::INFINITY {
                return Err(EstimatorError::NotFinite { role: Role::Expected });
            }
            *log += before;
            best = best.max(*log);
        }
        if best <= f64::NEG_INFINITY {
            return Err(EstimatorError::Impossible { particles: self.log.len() });
        }
        let mut total = 0.0;
        for (weight, log) in self.linear.iter_mut().zip(&self.log) {
            *weight = libm::exp(log - best);
            total += *weight;
        }
        let evidence = best + libm::log(total);
        for (weight, log) in self.linear.iter_mut().zip(&mut self.log) {
            *weight /= total;
            *log -= evidence;
        }
        Ok(evidence)
    }
}

/// The weighted mean and covariance of states in columns.
///
/// Deviations on an angle are taken about the direction of the cloud's resultant, so that neither
/// ±π nor a stray particle matters; where the directions cancel, about the first state.
pub(super) fn moments<const N: usize>(
    columns: &[Vec<f64>; N],
    weights: &[f64],
    axes: &[Axis; N],
) -> Estimate<N> {
    let state = |i: usize| -> State<N> { State::from_fn(|row, _| columns[row][i]) };
    let origin = State::from_fn(|row, _| match axes[row] {
        Axis::Linear => columns[row][0],
        Axis::Angle => {
            let mut resultant = Resultant::default();
            columns[row].iter().zip(weights).for_each(|(angle, w)| resultant.add(*angle, *w));
            resultant.direction(1e-9).unwrap_or(columns[row][0])
        }
    });
    let mean = origin
        + weights.iter().enumerate().fold(State::zeros(), |sum: State<N>, (i, w)| {
            sum + Axis::difference(axes, &state(i), &origin) * *w
        });
    let mut covariance = Covariance::zeros();
    for (i, w) in weights.iter().enumerate() {
        let deviation = Axis::difference(axes, &state(i), &mean);
        covariance += deviation * (deviation * *w).transpose();
    }
    covariance.fill_upper_triangle_with_lower_triangle();
    Estimate { mean: Axis::difference(axes, &mean, &State::zeros()), covariance }
}

#[cfg(test)]
mod tests {
    use foxhunt_core::nalgebra::Vector2;

    use super::*;

    #[test]
    fn moments_of_a_cloud_across_the_cut() {
        let axes = [Axis::Linear, Axis::Angle];
        let columns = [vec![1.0, 3.0, 5.0], vec![-3.1, 3.1, 3.0]];
        let estimate = moments(&columns, &[0.5, 0.25, 0.25], &axes);
        // By hand: the angles are −3.1, −3.1832 and −3.2832, unwrapped.
        let turned: [f64; 3] = [-3.1, 3.1 - core::f64::consts::TAU, 3.0 - core::f64::consts::TAU];
        let angle = 0.5 * turned[0] + 0.25 * (turned[1] + turned[2]);
        let mean = Vector2::new(2.5, foxhunt_core::angle::wrap(angle));
        assert!((estimate.mean - mean).norm() < 1e-14, "{}", estimate.mean);
        let variance = |w: [f64; 3]| -> f64 {
            w.iter().zip(turned).map(|(w, t)| w * (t - angle) * (t - angle)).sum()
        };
        assert!((estimate.covariance[(1, 1)] - variance([0.5, 0.25, 0.25])).abs() < 1e-14);
        assert!((estimate.covariance[(0, 0)] - 2.75).abs() < 1e-14);
    }

    #[test]
    fn a_stray_first_particle_does_not_split_the_others() {
        // Seen from 3.0, −0.3 and 0.1 lie on different sides.
        let columns = [vec![3.0, -0.3, 0.1]];
        let estimate = moments(&columns, &[0.0, 0.5, 0.5], &[Axis::Angle]);
        assert!((estimate.mean[0] + 0.1).abs() < 1e-14, "{}", estimate.mean);
        assert!((estimate.covariance[0] - 0.04).abs() < 1e-14, "{}", estimate.covariance);
    }

    #[test]
    fn weights_far_below_the_smallest_number_are_still_distinguished() {
        let prior = Weights::even(4);
        let mut posterior = Weights::even(4);
        posterior.log = vec![-2000.0, -2000.0 + libm::log(3.0), f64::NEG_INFINITY, -3000.0];
        let evidence = posterior.condition(&prior).expect("two are possible");
        assert!((evidence + 2000.0).abs() < 1e-12, "ln(¼ (1 + 3)) = 0: {evidence}");
        let expected = [0.25, 0.75, 0.0, 0.0];
        for (weight, expected) in posterior.linear.iter().zip(expected) {
            assert!((weight - expected).abs() < 1e-12, "{weight}, not {expected}");
        }
        assert!((posterior.effective_sample_size() - 1.6).abs() < 1e-12);
        // What is left at −∞ makes no NaN the next time.
        let mut again = Weights::even(4);
        again.log = vec![-1.0; 4];
        let evidence = again.condition(&posterior).expect("possible");
        assert!((evidence + 1.0).abs() < 1e-12);
        assert!(again.linear.iter().all(|w| w.is_finite()));
    }

    #[test]
    fn likelihoods_that_are_none_are_refused() {
        let prior = Weights::even(2);
        let condition = |logs: [f64; 2]| {
            let mut weights = Weights::even(2);
            weights.log.copy_from_slice(&logs);
            weights.condition(&prior)
        };
        let not_finite = Err(EstimatorError::NotFinite { role: Role::Expected });
        assert_eq!(condition([0.0, f64::NAN]), not_finite);
        assert_eq!(condition([0.0, f64::INFINITY]), not_finite);
        let impossible = Err(EstimatorError::Impossible { particles: 2 });
        assert_eq!(condition([f64::NEG_INFINITY; 2]), impossible);
    }
}
