use alloc::{vec, vec::Vec};

use foxhunt_core::{
    Correction, Covariance, Estimate, Estimator, EstimatorError, MeasurementModel, MotionModel,
    Observation, Quantity, State, absorb_receiver_noise, elementary,
    parameter::{ParameterError, require},
};
use nalgebra::{Matrix2, SVector, Vector2};

use super::{
    Columns, Lattice, Likelihood, Window,
    blur::blur,
    columns::log_densities,
    filter::{GridFilter, REACH, log_total, normalise, shift},
};
use crate::{
    Innovation,
    vectorised::{Dot, Map, Sum, run},
};

/// How often, at most, the cells are laid out anew for one observation: each time they become at
/// least 1.5 times finer, or twice, or half as wide again.
const LAYOUTS: usize = 24;

/// A lattice that reaches less than so many standard deviations each way after a prediction is
/// made to reach [`REACH`] of them.
const LEAST_REACH: f64 = 5.5;

/// Cells of less probability are not shown: all that there may be of them come to 10⁻⁷.
const LEAST_VISITED: f64 = 1e-12;

/// ∂f/∂x over the place, after refusing a motion of the further components that is not a random
/// walk, such as that of a velocity.
pub(super) fn slope_of_place<const N: usize>(
    motion: &impl MotionModel<N>,
    state: &State<N>,
    dt: f64,
) -> Result<Matrix2<f64>, ParameterError> {
    let slope = motion.jacobian(state, dt);
    let mut rest = slope - Covariance::<N>::identity();
    rest.fixed_view_mut::<2, 2>(0, 0).fill(0.0);
    let coupling = rest.norm();
    let name = "the motion of the components beside the place";
    require(coupling <= 1e-9, name, coupling, "a random walk independent of the place")?;
    Ok(slope.fixed_view::<2, 2>(0, 0).into_owned())
}

impl<F, H, const N: usize, const M: usize> Estimator<N, M> for GridFilter<F, H, N, M>
where
    F: MotionModel<N>,
    H: MeasurementModel<N, M>,
{
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        EstimatorError::check_time_step(dt)?;
        if dt <= 0.0 {
            return Ok(());
        }
        let (lattice, mut columns) = self.moved(dt)?;
        let marginals = normalise(&mut columns, &lattice);
        self.belief = self.moments(&columns, &marginals, &lattice)?;
        (self.lattice, self.columns, self.marginals) = (lattice, columns, marginals);
        Ok(())
    }

    fn update(&mut self, observation: &Observation<M>) -> Result<Correction, EstimatorError> {
        if observation.is_empty() && !observation.is_censored() {
            return Ok(Correction::Empty);
        }
        let likelihood =
            Likelihood::new(&self.measurement, self.reference, observation, &self.config);
        let place = self.belief.estimate().position();
        let mut lattice = self.lattice.clone();
        let mut posterior = likelihood.times(&self.columns, &lattice)?;
        let mut marginals = posterior.log_marginals();
        let mut logs = log_densities(&marginals);
        for _ in 0..LAYOUTS {
            let Some(window) = Window::of(&lattice, self.widest.as_ref(), &logs) else { break };
            let (side, most) = (self.config.side, self.config.most_per_side);
            let Some(better) = window.better(&lattice, self.widest.as_ref(), side, most)? else {
                break;
            };
            // Read from the prior as it was, not from what was read from it.
            let prior = self.over(&self.columns, &self.lattice, &better, &place);
            posterior = likelihood.times(&prior, &better)?;
            marginals = posterior.log_marginals();
            logs = log_densities(&marginals);
            lattice = better;
        }
        let log_evidence = log_total(&logs, &lattice);
        if log_evidence <= f64::NEG_INFINITY {
            return Err(EstimatorError::Impossible { particles: lattice.len() });
        }
        shift(&mut posterior, -log_evidence);
        marginals.iter_mut().flatten().for_each(|log| *log -= log_evidence);
        let belief = self.moments(&posterior, &marginals, &lattice)?;
        let nis = self.innovation(observation).map(|innovation| innovation.nis);
        (self.lattice, self.columns) = (lattice, posterior);
        (self.marginals, self.belief) = (marginals, belief);
        Ok(Correction::Fused { nis, log_evidence, effective_sample_size: None })
    }

    fn estimate(&self) -> Estimate<N> {
        *self.belief.estimate()
    }

    fn quantities(&self) -> [Quantity; M] {
        self.measurement.quantities()
    }

    fn visit_samples(&self, visit: &mut dyn FnMut(&State<N>, f64)) {
        let (states, weights) = self.weighted_states();
        for (index, weight) in weights.into_iter().enumerate() {
            visit(&State::from_fn(|i, _| states[i][index]), weight);
        }
    }
}

impl<F, H, const N: usize, const M: usize> GridFilter<F, H, N, M>
where
    F: MotionModel<N>,
    H: MeasurementModel<N, M>,
{
    /// [`Innovation::of_belief`], by columns.
    fn innovation(&self, observation: &Observation<M>) -> Option<Innovation<M>> {
        if observation.is_empty() {
            return None;
        }
        let (model, mean) = (&self.measurement, self.belief.mean());
        let observation = absorb_receiver_noise(model, mean, observation);
        let receiver = observation.receiver();
        let centre = model.expected(mean, receiver);
        let (states, weights) = self.weighted_states();
        let states = states.each_ref().map(|column| &column[..]);
        let mut deviations: [Vec<f64>; M] = core::array::from_fn(|_| vec![0.0; weights.len()]);
        let columns = deviations.each_mut().map(|column| &mut column[..]);
        model.residuals(states, &centre, receiver, columns);
        let (mut shift, mut square) = (SVector::<f64, M>::zeros(), Covariance::<M>::zeros());
        let mut weighted = vec![0.0; weights.len()];
        for i in 0..M {
            let of = |[weight, x]: [f64; 2], _| weight * x;
            run(Map { columns: [&weights, &deviations[i]], of, out: &mut weighted });
            // The residuals of the centre point the other way.
            shift[i] = -run(Sum(&weighted));
            (0..M).for_each(|j| square[(i, j)] = run(Dot(&weighted, &deviations[j])));
        }
        Innovation::of_deviations(&centre, &shift, &square, model, &observation)
    }

    /// The states of the cells, the further components at their mean over all hypotheses, as
    /// columns, and their weights, which sum to 1.
    fn weighted_states(&self) -> ([Vec<f64>; N], Vec<f64>) {
        let area = self.lattice.cell_area();
        let log_least = libm::log(LEAST_VISITED / area);
        let cells = self.lattice.len();
        let (mut weights, mut shares) = (vec![0.0; cells], vec![0.0; cells]);
        let mut behind = vec![vec![0.0; cells]; N - 2];
        for (hypothesis, logs) in self.marginals.iter().enumerate() {
            let share = |[log]: [f64; 1], _| {
                let share = area * elementary::exp(log);
                if log > log_least { share } else { 0.0 }
            };
            run(Map { columns: [logs], of: share, out: &mut shares });
            let add = |[share]: [f64; 1], sum| sum + share;
            run(Map { columns: [&shares], of: add, out: &mut weights });
            for (sum, mean) in behind.iter_mut().zip(self.columns.means(hypothesis)) {
                let add = |[share, mean]: [f64; 2], sum| sum + share * mean;
                run(Map { columns: [&shares, &mean], of: add, out: sum });
            }
        }
        let places = self.lattice.places();
        let visited: Vec<usize> = (0..cells).filter(|i| weights[*i] > 0.0).collect();
        let states = core::array::from_fn(|row| {
            let component = |i: &usize| match row {
                0 | 1 => places[row][*i],
                _ => self.reference[row] + behind[row - 2][*i] / weights[*i],
            };
            visited.iter().map(component).collect()
        });
        let total = run(Sum(&weights));
        (states, visited.into_iter().map(|i| weights[i] / total).collect())
    }

    /// A belief over other cells. Beyond its own it falls from what stands on the border as a
    /// Gaussian of the belief's covariance falls from its mean.
    fn over(
        &self,
        columns: &Columns<N>,
        from: &Lattice,
        to: &Lattice,
        place: &Estimate<2>,
    ) -> Columns<N> {
        let factor = place.covariance.cholesky();
        let fall = |beyond: &Vector2<f64>| match &factor {
            Some(factor) if self.widest.is_none() => -0.5 * beyond.dot(&factor.solve(beyond)),
            _ => f64::NEG_INFINITY,
        };
        columns.over(from, to, fall)
    }

    /// Where the cells and what is believed in them are after `dt`.
    fn moved(&self, dt: f64) -> Result<(Lattice, Columns<N>), EstimatorError> {
        let mean = self.belief.mean();
        let slope = slope_of_place(&self.motion, mean, dt)?;
        let noise = self.motion.noise_factor(mean, dt);
        let spread: Covariance<N> = noise * noise.transpose();
        let noise: Matrix2<f64> = spread.fixed_view::<2, 2>(0, 0).into_owned();

        let mut state = *mean;
        state.fixed_rows_mut::<2>(0).copy_from(&self.lattice.centre());
        let centre = self.motion.propagate(&state, dt).fixed_rows::<2>(0).into_owned();
        let mut lattice = self.lattice.moved(centre, &slope)?;
        let mut columns = self.columns.clone();
        shift(&mut columns, -libm::log(libm::fabs(slope.determinant())));

        let mut place = self.belief.estimate().position();
        place.mean = self.motion.propagate(mean, dt).fixed_rows::<2>(0).into_owned();
        place.covariance = slope * place.covariance * slope.transpose();
        let mut left = 1.0;
        while left > 0.0 {
            let share = left * resolved_share(&place.covariance, &(noise * left));
            let part = spread * share;
            place.covariance += noise * share;
            if let Some(wider) = self.widened(&lattice, &place, &(noise * share))? {
                columns = self.over(&columns, &lattice, &wider, &place);
                lattice = wider;
            }
            diffuse(&mut columns, &lattice, &part)?;
            left = if share < left { left - share } else { 0.0 };
        }
        Ok((lattice, columns))
    }

    /// The lattice that a belief with these moments, which this noise has made, needs instead of
    /// its own: along the axes of the noise, and wide enough. `None` where its own will do.
    fn widened(
        &self,
        lattice: &Lattice,
        place: &Estimate<2>,
        noise: &Matrix2<f64>,
    ) -> Result<Option<Lattice>, EstimatorError> {
        let sides = lattice.half_sides();
        let mut directions =
            Matrix2::from_columns(&[sides.column(0).normalize(), sides.column(1).normalize()]);
        let mut half = Vector2::new(sides.column(0).norm(), sides.column(1).norm());
        let along = directions.tr_mul(noise) * directions;
        let aslant = along[(0, 1)].abs() > 1e-6 * noise.trace()
            || directions.column(0).dot(&directions.column(1)).abs() > 1e-6;
        if aslant {
            directions = noise.symmetric_eigen().eigenvectors;
            half = Vector2::zeros();
        }
        let covers_all =
            self.widest.as_ref().is_some_and(|widest| lattice.area() > 0.9 * widest.area());
        let mut changed = aslant;
        for k in 0..2 {
            let direction = directions.column(k);
            let sigma = libm::sqrt(direction.dot(&(place.covariance * direction)));
            if half[k] < LEAST_REACH * sigma && (aslant || !covers_all) {
                half[k] = REACH * sigma;
                changed = true;
            }
        }
        if !changed {
            return Ok(None);
        }
        let half_sides = directions * Matrix2::from_diagonal(&half);
        Lattice::new(lattice.centre(), half_sides, lattice.side()).map(Some)
    }
}

/// The share of a noise that cells which resolve a belief can take in at once: what makes its
/// standard deviation twice as large in some direction. In coarser cells it would be lost.
fn resolved_share(belief: &Matrix2<f64>, noise: &Matrix2<f64>) -> f64 {
    let Some(factor) = belief.cholesky() else { return 1.0 };
    let ratio = factor.solve(noise).trace();
    if ratio > 3.0 { 3.0 / ratio } else { 1.0 }
}

/// Spreads the place by the noise's first two components, and the further components by the rest.
fn diffuse<const N: usize>(
    columns: &mut Columns<N>,
    lattice: &Lattice,
    spread: &Covariance<N>,
) -> Result<(), EstimatorError> {
    // In steps of the lattice, along whose sides the noise's axes lie.
    let steps = lattice.steps();
    let variance = [0, 1].map(|k| {
        let step = steps.column(k);
        let length = step.norm_squared();
        let noise: Matrix2<f64> = spread.fixed_view::<2, 2>(0, 0).into_owned();
        step.dot(&(noise * step)) / (length * length)
    });
    let mut behind = *spread;
    behind.fixed_columns_mut::<2>(0).fill(0.0);
    behind.fixed_rows_mut::<2>(0).fill(0.0);
    for (hypothesis, before) in columns.log_marginals().into_iter().enumerate() {
        let mut logs = before.clone();
        blur(&mut logs, lattice.side(), variance);
        columns.spread_behind(hypothesis, &before, &logs, &behind)?;
    }
    Ok(())
}
