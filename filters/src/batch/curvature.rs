use foxhunt_core::{Covariance, MeasurementModel, State};

use super::{BatchError, problem::Problem, region::Region};
use crate::count::number;

/// The cost's second derivatives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hessian<const N: usize>(pub(super) Covariance<N>);

/// Kind of a stationary place.
#[derive(Clone, Copy, Debug)]
pub(super) enum Curvature<const N: usize> {
    /// The cost grows all round, or at least does not fall.
    Up,
    /// It falls both ways along this step, about a tenth of a standard deviation long.
    Down(State<N>),
}

/// The Hessian by central differences of the gradient, over steps of a ten-thousandth of what Gauss
/// and Newton's `information` at `x` takes for a standard deviation.
pub(super) fn hessian<H, const N: usize, const M: usize>(
    problem: &Problem<'_, H, N, M>,
    x: &State<N>,
    information: &Covariance<N>,
) -> Hessian<N>
where
    H: MeasurementModel<N, M>,
{
    let mut hessian = Covariance::<N>::zeros();
    for i in 0..N {
        let size = information[(i, i)];
        let step = 1e-4 / libm::sqrt(if size > 0.0 { size } else { 1.0 });
        let mut low = *x;
        let mut high = *x;
        low[i] -= step;
        high[i] += step;
        let change = problem.local(&high).gradient - problem.local(&low).gradient;
        hessian.set_column(i, &(change / (high[i] - low[i])));
    }
    Hessian((hessian + hessian.transpose()) * 0.5)
}

/// Newton's iteration as long as each step is at most half of the last, in standard deviations: the
/// optimum, its cost and the Hessian there. `None` where it does not lead to one.
pub(super) fn settle<H, const N: usize, const M: usize>(
    problem: &Problem<'_, H, N, M>,
    start: &State<N>,
) -> Option<(State<N>, f64, Covariance<N>)>
where
    H: MeasurementModel<N, M>,
{
    let mut state = *start;
    let mut last = f64::INFINITY;
    for _ in 0..30 {
        let local = problem.local(&state);
        let Hessian(information) = hessian(problem, &state, &local.information);
        if reciprocal_condition(&information) < LEAST_RCOND {
            return None;
        }
        let step = -information.cholesky()?.solve(&local.gradient);
        let size = libm::sqrt(-local.gradient.dot(&step));
        let done = size < 1e-12 || (size < 1e-6 && size > 0.5 * last);
        if done {
            return Some((state, local.cost, information));
        }
        if size.is_nan() || size > 0.5 * last {
            return None;
        }
        state += step;
        last = size;
    }
    None
}

impl<const N: usize> Hessian<N> {
    /// Finds the way in which the cost falls, by the power iteration on a bound of the largest
    /// eigenvalue less the Hessian, each component in the unit that `scale` gives it.
    pub(super) fn curvature(&self, scale: &Covariance<N>) -> Curvature<N> {
        let unit = scale.diagonal().map(|d| if d > 0.0 { 1.0 / libm::sqrt(d) } else { 1.0 });
        let scaled = Covariance::<N>::from_fn(|i, j| self.0[(i, j)] * unit[i] * unit[j]);
        let bound = scaled.norm();
        // Of uneven entries, so that it is along no axis and across none.
        let mut way = State::<N>::from_fn(|i, _| 1.0 + 0.37 * number(i));
        for _ in 0..100 {
            way = (way * bound - scaled * way).normalize();
        }
        let curvature = way.dot(&(scaled * way));
        if curvature < -1e-6 {
            Curvature::Down(way.component_mul(&unit) * 0.1)
        } else {
            Curvature::Up
        }
    }
}

/// Below this a direction is left open.
pub(super) const LEAST_RCOND: f64 = 1e-12;

/// Refuses an information that leaves a direction open, or a place less certain than the region is
/// wide.
pub(super) fn flatness<const N: usize>(
    information: &Covariance<N>,
    region: Region,
) -> Result<(), BatchError> {
    let rcond = reciprocal_condition(information);
    let flat = BatchError::Flat { rcond };
    if rcond < LEAST_RCOND {
        return Err(flat);
    }
    let inverse = information.cholesky().ok_or(flat)?.inverse();
    let uncertainty = libm::sqrt(inverse[(0, 0)] + inverse[(1, 1)]);
    if uncertainty.is_nan() || uncertainty > region.limit { Err(flat) } else { Ok(()) }
}

/// A lower bound of the reciprocal condition, each component in its own unit; 0 where there is no
/// Cholesky factor.
pub(super) fn reciprocal_condition<const N: usize>(information: &Covariance<N>) -> f64 {
    let root = information.diagonal().map(libm::sqrt);
    let in_own_units = Covariance::<N>::from_fn(|i, j| information[(i, j)] / (root[i] * root[j]));
    // A correlation matrix's largest eigenvalue is at most its dimension; the least is the
    // inverse's largest, which its trace bounds.
    let inverse = in_own_units.cholesky().map(|factor| factor.inverse());
    let rcond = inverse.map_or(0.0, |inverse| 1.0 / (inverse.trace() * number(N)));
    if rcond.is_nan() { 0.0 } else { rcond }
}
