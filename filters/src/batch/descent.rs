//! Descents of the cost from several starts to its distinct optima.

use alloc::vec::Vec;

use foxhunt_core::{Covariance, MeasurementModel, State};
use nalgebra::Vector2;

use super::{BatchError, Datum, Local, Problem};
use crate::count::number;

/// Reciprocal condition below which a direction is left open.
pub(super) const LEAST_RCOND: f64 = 1e-12;

/// A full step that lowers the cost by less than this share leads near enough to an optimum for
/// Newton's iteration to be tried.
const NEAR: f64 = 1e-4;

/// A full step that lowers the cost by less than this share leads nowhere.
const SETTLED: f64 = 1e-13;

/// Largest number of saddles left.
const MOST_ESCAPES: u8 = 3;

/// Number of iterations after which the Hessian gives the steps: Gauss and Newton's approximation
/// is poor where residuals are large, or a loss is far from quadratic.
const GAUSS_NEWTON: u32 = 15;

/// Disc that the iterates stay in.
#[derive(Clone, Copy, Debug)]
pub(super) struct Region {
    pub centre: Vector2<f64>,
    /// Radius in metres; infinite where a prior keeps the optimum near.
    pub limit: f64,
}

/// The cost's second derivatives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Hessian<const N: usize>(pub Covariance<N>);

impl<const N: usize> Hessian<N> {
    /// Finds the way in which the cost falls, by the power iteration on a bound of the largest
    /// eigenvalue less the Hessian, each component in the unit that `scale` gives it.
    fn curvature(&self, scale: &Covariance<N>) -> Curvature<N> {
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

/// Kind of a stationary place.
#[derive(Clone, Copy, Debug)]
enum Curvature<const N: usize> {
    /// The cost grows all round, or at least does not fall.
    Up,
    /// It falls both ways along this step, about a tenth of a standard deviation long.
    Down(State<N>),
}

/// End of an iteration.
#[derive(Clone, Debug)]
pub(super) struct End<const N: usize> {
    pub state: State<N>,
    pub cost: f64,
    /// The information there: the cost's Hessian.
    pub information: Covariance<N>,
    pub iterations: u32,
    /// Reason that this is no optimum.
    pub refused: Option<BatchError>,
}

impl<const N: usize> End<N> {
    /// Returns true if a state is within this many of the optimum's standard deviations.
    fn is_within(&self, deviations: f64, state: &State<N>) -> bool {
        let apart = state - self.state;
        apart.dot(&(self.information * apart)) < deviations * deviations
    }
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

/// The distinct optima that some starts led to.
#[derive(Clone, Debug)]
pub(super) struct Modes<const N: usize> {
    /// The best first; there is one at least.
    pub ends: Vec<End<N>>,
    /// Number of starts that led to the best.
    pub agreeing: usize,
}

/// Reason that there is no optimum, and the end of the lowest descent.
#[derive(Clone, Debug)]
pub(super) struct NoMode<const N: usize> {
    pub error: BatchError,
    pub lowest: Option<State<N>>,
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
fn settle<H, const N: usize, const M: usize>(
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

/// Refuses an information that leaves a direction open, or a place less certain than the region is
/// wide.
fn flatness<const N: usize>(information: &Covariance<N>, region: Region) -> Result<(), BatchError> {
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

/// Levenberg and Marquardt's iteration, damped by the gain (Nielsen 1999; Madsen, Nielsen &
/// Tingleff 2004, §3.2), and Newton's near the optimum.
fn descend<H, const N: usize, const M: usize>(
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

/// Returns the fall of the cost expected of the undamped step.
fn full_gain<const N: usize>(local: &Local<N>) -> Option<f64> {
    let step = local.information.cholesky()?.solve(&local.gradient);
    Some(0.5 * local.gradient.dot(&step)).filter(|gain| gain.is_finite())
}

fn is_finite<const N: usize>(local: &Local<N>) -> bool {
    let numbers = local.gradient.iter().chain(local.information.iter());
    local.cost.is_finite() && numbers.copied().all(f64::is_finite)
}

/// Descends from every start.
///
/// One that ran away, or settled where the likelihood is flat, decides only if it came lower than
/// every optimum: the likelihood's supremum is there, and a higher optimum does not count.
pub(super) fn search<H, const N: usize, const M: usize>(
    problem: &Problem<'_, H, N, M>,
    starts: &[State<N>],
    region: Region,
    most_iterations: u32,
) -> Result<Modes<N>, NoMode<N>>
where
    H: MeasurementModel<N, M>,
{
    let mut all: Vec<End<N>> = Vec::with_capacity(starts.len());
    for start in starts {
        all.push(descend(problem, start, region, most_iterations, &all));
    }
    let (mut ends, mut refused): (Vec<_>, Vec<_>) =
        all.into_iter().partition(|end| end.refused.is_none());
    by_cost(&mut ends);
    by_cost(&mut refused);
    let lowest = ends.first().map_or(f64::INFINITY, |end| end.cost);
    let least = 1e-6 * (1.0 + lowest.abs());
    let decides = |end: &&End<N>| {
        let supremum =
            matches!(end.refused, Some(BatchError::RanAway { .. } | BatchError::Flat { .. }));
        ends.is_empty() || (supremum && end.cost < lowest - least)
    };
    if let Some(end) = refused.iter().find(decides)
        && let Some(error) = end.refused
    {
        return Err(NoMode { error, lowest: Some(end.state) });
    }
    // Ends less than a thousandth of a standard deviation apart are one.
    let mut modes = Modes { ends: Vec::new(), agreeing: 0 };
    for end in ends {
        let known = modes.ends.iter().position(|mode| mode.is_within(1e-3, &end.state));
        modes.agreeing += usize::from(known.unwrap_or(modes.ends.len()) == 0);
        if known.is_none() {
            modes.ends.push(end);
        }
    }
    if modes.ends.is_empty() {
        let error = BatchError::TooFew { what: "starts", have: starts.len(), need: 1 };
        return Err(NoMode { error, lowest: None });
    }
    Ok(modes)
}

/// Returns the observation with angles made nearest to the optimum, if that is within a standard
/// deviation of it: the angle could be any there, and its linearisation is invalid.
pub(super) fn overhead<H, const N: usize, const M: usize>(
    problem: &Problem<'_, H, N, M>,
    mode: &End<N>,
) -> Option<usize>
where
    H: MeasurementModel<N, M>,
{
    let covariance = mode.information.cholesky()?.inverse();
    let variance = covariance[(0, 0)] + covariance[(1, 1)];
    let place = mode.state.fixed_rows::<2>(0);
    let near = problem.data.iter().enumerate().filter(|(_, datum)| problem.has_angle(datum));
    let near = near.map(|(index, datum)| {
        (index, (place - datum.observation.receiver().position.xy()).norm_squared())
    });
    let nearest = near.filter(|(_, square)| *square < variance);
    nearest.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(index, _)| index)
}

/// Returns the observation that draws a descent into its receiver.
///
/// At the receiver itself a bearing fits whatever its value: the density has a spike there without
/// any mass, and a descent creeps into it without end. Its angles have most of the information on
/// some component there, the more the nearer it came.
pub(super) fn trap<H, const N: usize, const M: usize>(
    problem: &Problem<'_, H, N, M>,
    state: &State<N>,
) -> Option<usize>
where
    H: MeasurementModel<N, M>,
{
    let whole = problem.local(state).information.diagonal();
    let share = |datum: &Datum<M>| {
        let own = Problem { data: core::slice::from_ref(datum), prior: None, ..*problem };
        let own = own.local(state).information.diagonal();
        own.component_div(&whole).max()
    };
    let angular = problem.data.iter().enumerate().filter(|(_, h)| problem.has_angle(h));
    let shares = angular.map(|(index, datum)| (index, share(datum))).filter(|(_, s)| *s > 0.5);
    shares.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(index, _)| index)
}

/// Sorts by cost; apart from the search, so that it is compiled once for all problems.
fn by_cost<const N: usize>(ends: &mut [End<N>]) {
    ends.sort_by(|a, b| a.cost.total_cmp(&b.cost));
}
