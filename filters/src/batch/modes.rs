use alloc::vec::Vec;

use foxhunt_core::{MeasurementModel, State};

use super::{
    BatchError,
    iteration::{End, descend},
    problem::{Datum, Problem},
    region::Region,
};

/// The distinct optima that some starts led to.
#[derive(Clone, Debug)]
pub(super) struct Modes<const N: usize> {
    /// The best first; there is one at least.
    pub(super) ends: Vec<End<N>>,
    /// Number of starts that led to the best.
    pub(super) agreeing: usize,
}

/// Reason that there is no optimum, and the end of the lowest descent.
#[derive(Clone, Debug)]
pub(super) struct NoMode<const N: usize> {
    pub(super) error: BatchError,
    pub(super) lowest: Option<State<N>>,
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
    ends.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    refused.sort_by(|a, b| a.cost.total_cmp(&b.cost));
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
