//! Forward-backward smoothing over cells.

use foxhunt_core::{Covariance, Estimator, EstimatorError, MeasurementModel, MotionModel, Smooth};
use nalgebra::Matrix2;

use super::{GridFilter, log_total, slope_of_place};
use crate::{
    grid::{DEPTH, columns::Columns, weights::Weights},
    vectorised::{Largest, run},
};

/// Forward-backward smoothing: p(x | all) = p(x) ∫ N(x₊; x, Q) s(x₊) / p⁻(x₊) dx₊, with
/// s the smoothed density of the later time and p⁻ its prediction. The smoothed belief
/// has the later one's cells, widened by the noise: they are as fine as later observations are
/// sharp.
///
/// A state that holds more than a place is refused, as is a motion that carries the place along.
impl<F, H, const N: usize, const M: usize> Smooth<N, M> for GridFilter<F, H, N, M>
where
    F: MotionModel<N> + Clone,
    H: MeasurementModel<N, M> + Clone,
{
    fn smooth(&mut self, later: &Self, dt: f64) -> Result<(), EstimatorError> {
        EstimatorError::check_time_step(dt)?;
        if N > 2 {
            return Err(EstimatorError::Unsupported {
                what: "smoothing cells whose state holds more than a place",
            });
        }
        let mean = self.belief.mean();
        let carried = (slope_of_place(&self.motion, mean, dt)? - Matrix2::identity()).norm()
            + (self.motion.propagate(mean, dt) - mean).norm();
        if carried > 1e-9 * (1.0 + mean.norm()) {
            return Err(EstimatorError::Unsupported {
                what: "smoothing cells under a motion that carries the place along",
            });
        }
        let factor = self.motion.noise_factor(mean, dt);
        let spread: Covariance<N> = factor * factor.transpose();
        let noise: Matrix2<f64> = spread.fixed_view::<2, 2>(0, 0).into_owned();
        let mut predicted = self.clone();
        predicted.predict(dt)?;

        let mut place = later.belief.estimate().position();
        place.covariance += noise;
        let wider = later.widened(&later.lattice, &place, &noise)?;
        let lattice = wider.unwrap_or_else(|| later.lattice.clone());
        let read = |grid: &Self| {
            let mut out = Columns::default();
            let place = grid.belief.estimate().position();
            grid.over(&grid.columns, &grid.lattice, &lattice, &place, &mut out);
            out
        };
        let mut ratio = read(later);
        let before = read(&predicted);
        for (ratio, before) in ratio.hypotheses_mut().iter_mut().zip(before.hypotheses()) {
            let least = run(Largest(&ratio.logs)) - DEPTH;
            for (log, before) in ratio.logs.iter_mut().zip(&before.logs) {
                let known = *log > least && before.is_finite();
                *log = if known { *log - before } else { f64::NEG_INFINITY };
            }
        }
        let impossible = EstimatorError::Impossible { particles: lattice.len() };
        let mut weights = Weights::default();
        if weights.set(&ratio) <= f64::NEG_INFINITY {
            return Err(impossible);
        }
        // In cells², along the sides, where the noise's axes lie.
        let steps = lattice.steps();
        let variance = [0, 1].map(|k| {
            let step = steps.column(k);
            let length = step.norm_squared();
            step.dot(&(noise * step)) / (length * length)
        });
        weights.blur(None, lattice.side(), variance);
        let mut columns = read(self);
        for (own, factors) in columns.hypotheses_mut().iter_mut().zip(weights.each()) {
            let pairs = own.logs.iter_mut().zip(factors);
            pairs.for_each(|(log, factor)| *log += libm::log(factor.max(0.0)));
        }
        let log_one = weights.set(&columns);
        if log_one <= f64::NEG_INFINITY {
            return Err(impossible);
        }
        columns.shift(-(log_one + log_total(&weights, &lattice)));
        self.belief = weights.moments(&columns, &lattice, &self.reference)?;
        self.columns = columns;
        self.weights = weights;
        self.lattice = lattice;
        Ok(())
    }
}
