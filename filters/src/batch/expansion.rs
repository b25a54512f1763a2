use core::array;

use foxhunt_core::{Covariance, MeasurementModel, State};

use super::{curvature::hessian, iteration::End, problem::Problem};

/// A cost about one of its optima, to third order: what a new observation adds takes no second
/// look at those before it.
#[derive(Clone, Debug)]
pub(super) struct Expansion<const N: usize> {
    centre: State<N>,
    cost: f64,
    gradient: State<N>,
    curvature: Covariance<N>,
    /// Change of the curvature along each axis.
    bend: [Covariance<N>; N],
}

/// Largest change of the curvature from the centre's, as a share of itself. The expansion's error
/// is of the order of its square.
const STRAIGHT: f64 = 0.05;

/// Distance to either side for the curvature's slope, in standard deviations.
const REACH: f64 = 0.02;

/// Rounds of Newton's iteration for the minimum of a cubic, which settles in a few or not at all.
const ROUNDS: usize = 20;

impl<const N: usize> Expansion<N> {
    /// Expands a cost about the end of a descent of it.
    pub(super) fn new<H, const M: usize>(problem: &Problem<'_, H, N, M>, end: &End<N>) -> Self
    where
        H: MeasurementModel<N, M>,
    {
        let centre = end.state;
        let curvature = end.information;
        let bend = bend(problem, &centre, &curvature);
        Self { centre, cost: end.cost, gradient: State::zeros(), curvature, bend }
    }

    /// Adds another cost.
    pub(super) fn add<H, const M: usize>(&mut self, other: &Problem<'_, H, N, M>)
    where
        H: MeasurementModel<N, M>,
    {
        let local = other.local(&self.centre);
        let bend = bend(other, &self.centre, &self.curvature);
        self.curvature += hessian(other, &self.centre, &self.curvature).0;
        self.cost += local.cost;
        self.gradient += local.gradient;
        self.bend.iter_mut().zip(bend).for_each(|(sum, bend)| *sum += bend);
    }

    /// Its minimum; `None` where that is so far from the centre that the expansion errs.
    pub(super) fn minimum(&self) -> Option<End<N>> {
        let mut step = State::<N>::zeros();
        for iterations in (1..).take(ROUNDS) {
            let change = self.change(&step);
            let slope = self.gradient + (self.curvature + change * 0.5) * step;
            let information = self.curvature + change;
            let shift = information.cholesky()?.solve(&slope);
            step -= shift;
            if slope.dot(&shift) > 1e-20 {
                continue;
            }
            let change = self.change(&step);
            let information = self.curvature + change;
            if self.share(&change)? > STRAIGHT {
                return None;
            }
            let bent = self.curvature * 0.5 + change / 6.0;
            let cost = self.cost + self.gradient.dot(&step) + step.dot(&(bent * step));
            let state = self.centre + step;
            return Some(End { state, cost, information, iterations, refused: None });
        }
        None
    }

    /// Returns the curvature's change over a step.
    fn change(&self, step: &State<N>) -> Covariance<N> {
        self.bend.iter().zip(step.iter()).map(|(bend, step)| bend * *step).sum()
    }

    /// Returns the size of a change in units of the curvature.
    fn share(&self, change: &Covariance<N>) -> Option<f64> {
        let factor = self.curvature.cholesky()?.unpack();
        let half = factor.solve_lower_triangular(change)?;
        Some(factor.solve_lower_triangular(&half.transpose())?.norm())
    }
}

/// The cost's third derivatives, by central differences of the second ones.
fn bend<H, const N: usize, const M: usize>(
    problem: &Problem<'_, H, N, M>,
    x: &State<N>,
    information: &Covariance<N>,
) -> [Covariance<N>; N]
where
    H: MeasurementModel<N, M>,
{
    array::from_fn(|i| {
        let size = information[(i, i)];
        let step = REACH / libm::sqrt(if size > 0.0 { size } else { 1.0 });
        let mut low = *x;
        let mut high = *x;
        low[i] -= step;
        high[i] += step;
        let change = hessian(problem, &high, information).0 - hessian(problem, &low, information).0;
        change / (high[i] - low[i])
    })
}
