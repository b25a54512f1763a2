use foxhunt_core::{Covariance, MeasurementModel, State};

use super::{
    BatchError,
    curvature::{Curvature, flatness, hessian, reciprocal_condition, settle},
    problem::{Local, Problem},
    region::Region,
};

/// End of an iteration.
#[derive(Clone, Debug)]
pub(super) struct End<const N: usize> {
    pub(super) state: State<N>,
    pub(super) cost: f64,
    /// The information there: the cost's Hessian.
    pub(super) information: Covariance<N>,
    pub(super) iterations: u32,
    /// Reason that this is no optimum.
    pub(super) refused: Option<BatchError>,
}

impl<const N: usize> End<N> {
    /// Returns true if a state is within this many of the optimum's standard deviations.
    pub(super) fn is_within(&self, deviations: f64, state: &State<N>) -> bool {
        let apart = state - self.state;
        apart.dot(&(self.information * apart)) < deviations * deviations
    }
}

/// A full step that lowers the cost by less than this share leads near enough to an optimum for
/// Newton's iteration to be tried.
const NEAR: f64 = 1e-4;

/// One that lowers it by less than this leads nowhere.
const SETTLED: f64 = 1e-13;

/// Largest number of saddles left.
const MOST_ESCAPES: u8 = 3;

/// Number of iterations after which the Hessian gives the steps: Gauss and Newton's approximation
/// is poor where residuals are large, or a loss is far from quadratic.
const GAUSS_NEWTON: u32 = 15;

/// Levenberg and Marquardt's iteration, damped by the gain (Nielsen 1999; Madsen, Nielsen &
/// Tingleff 2004, §3.2), and Newton's near the optimum.
pub(super) fn descend<H, const N: usize, const M: usize>(
    problem: &Problem<'_, H, N, M>,
    start: &State<N>,
    region: Region,
    most_iterations: u32,
    known: &[End<N>],
) -> End<N>
where
    H: MeasurementModel<N, M>,
{
    let mut state = *start;
    let mut local = problem.local(start);
    let mut damping = Damping::default();
    let mut escapes = 0;
    for iterations in 0..=most_iterations {
        let end = |state, cost, information: Covariance<N>, refused: Option<BatchError>| {
            let refused = refused.or_else(|| flatness(&information, region).err());
            End { state, cost, information, iterations, refused }
        };
        let here = |refused| end(state, local.cost, local.information, refused);
        if !is_finite(&local) {
            return here(Some(BatchError::Improper { what: "model" }));
        }
        let distance_m = (state.fixed_rows::<2>(0) - region.centre).norm();
        if distance_m > region.limit {
            return here(Some(BatchError::RanAway { distance_m, limit_m: region.limit }));
        }
        let gain = full_gain(&local).unwrap_or(f64::INFINITY) / (1.0 + local.cost);
        let is_near = |end: &&End<N>| end.refused.is_none() && end.is_within(0.1, &state);
        if gain <= NEAR
            && let Some(end) = known.iter().find(is_near)
        {
            return End { iterations, ..end.clone() };
        }
        if gain <= NEAR
            && let Some((state, cost, information)) = settle(problem, &state)
        {
            return end(state, cost, information, None);
        }
        let quadratic = match iterations < GAUSS_NEWTON {
            true => local.information,
            false => hessian(problem, &state, &local.information).0,
        };
        let mut step = || damping.step(problem, &state, &local, &quadratic);
        let next = if gain > SETTLED { step() } else { None };
        state = match next {
            Some(next) => next,
            None => {
                match hessian(problem, &state, &local.information).curvature(&local.information) {
                    Curvature::Down(way) if escapes < MOST_ESCAPES => {
                        escapes += 1;
                        let sides = [state + way, state - way];
                        let costs = sides.map(|side| problem.cost(&side));
                        if costs[1] < costs[0] { sides[1] } else { sides[0] }
                    }
                    _ => {
                        // As low as it gets; a slope that leads nowhere is no optimum.
                        let refused = here(None).refused;
                        let wall = BatchError::NotConverged { iterations };
                        return here(refused.or((gain > NEAR).then_some(wall)));
                    }
                }
            }
        };
        local = problem.local(&state);
    }
    let cost = local.cost;
    let information = local.information;
    // With next to no slope left and no optimum near, the likelihood only creeps on.
    let creeps = full_gain(&local).is_some_and(|gain| gain <= NEAR * (1.0 + cost));
    let rcond = reciprocal_condition(&information);
    let refused = Some(match creeps {
        true => BatchError::Flat { rcond },
        false => BatchError::NotConverged { iterations: most_iterations },
    });
    End { state, cost, information, iterations: most_iterations, refused }
}

/// Damping of the steps.
#[derive(Clone, Copy, Debug)]
struct Damping {
    value: f64,
    growth: f64,
}

impl Default for Damping {
    fn default() -> Self {
        Self { value: 1e-3, growth: 2.0 }
    }
}

impl Damping {
    /// The next state, of lower cost, by the model of the cost with this second derivative; `None`
    /// where no step however short lowers it.
    fn step<H, const N: usize, const M: usize>(
        &mut self,
        problem: &Problem<'_, H, N, M>,
        state: &State<N>,
        local: &Local<N>,
        quadratic: &Covariance<N>,
    ) -> Option<State<N>>
    where
        H: MeasurementModel<N, M>,
    {
        let diagonal = local.information.diagonal().map(|d| if d > 0.0 { d } else { 1.0 });
        while self.value < 1e20 {
            let damped = quadratic + Covariance::from_diagonal(&(diagonal * self.value));
            if let Some(factor) = damped.cholesky() {
                let step = -factor.solve(&local.gradient);
                let slope = local.gradient.dot(&step);
                let predicted = -slope - 0.5 * step.dot(&(quadratic * step));
                let gain = (local.cost - problem.cost(&(state + step))) / predicted;
                if gain > 0.0 {
                    let cube = 2.0 * gain - 1.0;
                    self.value *= f64::max(1.0 / 3.0, 1.0 - cube * cube * cube);
                    self.value = f64::max(self.value, 1e-12);
                    self.growth = 2.0;
                    return Some(state + step);
                }
            }
            self.value *= self.growth;
            self.growth *= 2.0;
        }
        None
    }
}

/// Returns the fall of the cost expected of the undamped step.
fn full_gain<const N: usize>(local: &Local<N>) -> Option<f64> {
    let step = local.information.cholesky()?.solve(&local.gradient);
    Some(0.5 * local.gradient.dot(&step)).filter(|gain| gain.is_finite())
}

fn is_finite<const N: usize>(local: &Local<N>) -> bool {
    let numbers = local.gradient.iter().chain(local.information.iter());
    local.cost.is_finite() && numbers.copied().all(f64::is_finite)
}
