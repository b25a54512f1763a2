//! Prediction and update of the grid filter, and its smoothing forwards and backwards.

use alloc::{vec, vec::Vec};
use core::mem;

use foxhunt_core::{
    Correction, Covariance, Estimate, Estimator, EstimatorError, MeasurementModel, MotionModel,
    Observation, Quantity, Smooth, State, absorb_receiver_noise, columns,
};
use nalgebra::{Matrix2, SVector, Vector2};

use super::{GridFilter, REACH, log_total, slope_of_place};
use crate::{
    Innovation,
    grid::{DEPTH, Lattice, Window, columns::Columns, likelihood::Likelihood, weights::Weights},
    vectorised::{Dot, Largest, Map, Sum, run},
};

/// Largest number of rebuilds of the lattice for one observation: each makes the cells at least 1.5
/// times finer, or twice, or half as wide again.
const LAYOUTS: usize = 24;

/// Least reach of a lattice each way after a prediction, in standard deviations; a smaller one is
/// made to reach [`REACH`].
const LEAST_REACH: f64 = 5.5;

/// Cells of less probability are not shown: all that there may be of them come to 10⁻⁷.
const LEAST_VISITED: f64 = 1e-12;

/// Cells less likely than the likeliest by this, 4.9 standard deviations of a Gaussian, have no
/// part in what is expected of an observation.
const LEAST_LIKELY: f64 = 6e-6;

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
        let (mut columns, mut weights) = mem::take(&mut self.spare);
        let lattice = self.moved(dt, &mut columns, &mut weights)?;
        self.belief = weights.moments(&columns, &lattice, &self.reference)?;
        self.take(lattice, columns, weights);
        Ok(())
    }

    fn update(&mut self, observation: &Observation<M>) -> Result<Correction, EstimatorError> {
        if observation.is_empty() && !observation.is_censored() {
            return Ok(Correction::Empty);
        }
        let (mut columns, mut weights) = mem::take(&mut self.spare);
        let likelihood =
            Likelihood::new(&self.measurement, self.reference, observation, &self.config);
        let place = self.belief.estimate().position();
        let mut lattice = self.lattice.clone();
        columns.copy_from(&self.columns);
        let mut pool = mem::take(&mut self.pool);
        likelihood.multiply(&mut columns, &lattice, &mut pool)?;
        let mut log_one = weights.set(&columns);
        for _ in 0..LAYOUTS {
            let widest = self.widest.as_ref();
            let Some(window) = Window::of(&lattice, widest, weights.all()) else { break };
            let side = self.config.side;
            let most = self.config.most_per_side;
            let Some(better) = window.better(&lattice, widest, side, most)? else { break };
            // Read from the prior as it was, not from what was read from it.
            self.over(&self.columns, &self.lattice, &better, &place, &mut columns);
            likelihood.multiply(&mut columns, &better, &mut pool)?;
            log_one = weights.set(&columns);
            lattice = better;
        }
        if log_one <= f64::NEG_INFINITY {
            return Err(EstimatorError::Impossible { particles: lattice.len() });
        }
        let log_evidence = log_one + log_total(&weights, &lattice);
        columns.shift(-log_evidence);
        let belief = weights.moments(&columns, &lattice, &self.reference)?;
        let nis = self.innovation(observation).map(|innovation| innovation.nis);
        (self.belief, self.pool) = (belief, pool);
        self.take(lattice, columns, weights);
        Ok(Correction::Fused { nis, log_evidence, effective_sample_size: None })
    }

    fn estimate(&self) -> Estimate<N> {
        *self.belief.estimate()
    }

    fn quantities(&self) -> [Quantity; M] {
        self.measurement.quantities()
    }

    fn visit_samples(&self, visit: &mut dyn FnMut(&State<N>, f64)) {
        let weights = self.weights.all();
        let least = LEAST_VISITED * self.weights.total();
        let visited = || weights.iter().enumerate().filter(|(_, weight)| **weight > least);
        let total: f64 = visited().map(|(_, weight)| weight).sum();
        visited().for_each(|(index, weight)| visit(&self.state(index), weight / total));
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
        let model = &self.measurement;
        let mean = self.belief.mean();
        let observation = absorb_receiver_noise(model, mean, observation);
        let receiver = observation.receiver();
        let centre = model.expected(mean, receiver);
        let (states, weights) = self.likely_states();
        let states = columns::slices(&states);
        let mut deviations: [Vec<f64>; M] = core::array::from_fn(|_| vec![0.0; weights.len()]);
        model.residuals(states, &centre, receiver, columns::slices_mut(&mut deviations));
        let total = run(Sum(&weights));
        let mut shift = SVector::<f64, M>::zeros();
        let mut square = Covariance::<M>::zeros();
        let mut weighted = vec![0.0; weights.len()];
        for i in 0..M {
            let of = |[weight, x]: [f64; 2], _| weight * x;
            run(Map { columns: [&weights, &deviations[i]], of, out: &mut weighted });
            // The residuals of the centre point the other way.
            shift[i] = -run(Sum(&weighted)) / total;
            (0..M).for_each(|j| square[(i, j)] = run(Dot(&weighted, &deviations[j])) / total);
        }
        // Cells have the mean of the further components; what these vary within a cell comes along.
        if let Some(within) = self.weights.within() {
            let slope = model.jacobian(mean, receiver);
            square += slope * within * slope.transpose();
        }
        Innovation::of_deviations(&centre, &shift, &square, model, &observation)
    }

    /// The state of a cell, the further components at their mean over all hypotheses.
    fn state(&self, index: usize) -> State<N> {
        let place = self.lattice.place(index);
        State::from_fn(|i, _| match i {
            0 | 1 => place[i],
            _ => self.reference[i] + self.weights.mean_behind(i, index),
        })
    }

    /// The states of the cells that carry the belief, as columns, and their weights.
    fn likely_states(&self) -> ([Vec<f64>; N], Vec<f64>) {
        let weights = self.weights.all();
        let side = self.lattice.side();
        let carrying = || self.lattice.carrying(weights, LEAST_LIKELY * run(Largest(weights)));
        let count = carrying().map(|cells| cells.len()).sum();
        let mut states: [Vec<f64>; N] = core::array::from_fn(|_| Vec::with_capacity(count));
        let mut likely = Vec::with_capacity(count);
        let mut places = [Vec::new(), Vec::new()];
        for cells in carrying() {
            let row = cells.start / side;
            self.lattice.places(row..row + 1, &mut places);
            let within = cells.start - row * side..cells.end - row * side;
            for (i, column) in states.iter_mut().enumerate() {
                match places.get(i) {
                    Some(places) => column.extend_from_slice(&places[within.clone()]),
                    None => {
                        let mean = |index| self.reference[i] + self.weights.mean_behind(i, index);
                        column.extend(cells.clone().map(mean));
                    }
                }
            }
            likely.extend_from_slice(&weights[cells]);
        }
        (states, likely)
    }

    /// Makes a step's result the belief, and what that was the next one's memory.
    fn take(&mut self, lattice: Lattice, columns: Columns<N>, weights: Weights<N>) {
        self.lattice = lattice;
        self.spare =
            (mem::replace(&mut self.columns, columns), mem::replace(&mut self.weights, weights));
    }

    /// Makes `out` a belief over other cells. Beyond its own it falls from what stands on the
    /// border as a Gaussian of the belief's covariance falls from its mean.
    fn over(
        &self,
        columns: &Columns<N>,
        from: &Lattice,
        to: &Lattice,
        place: &Estimate<2>,
        out: &mut Columns<N>,
    ) {
        let factor = place.covariance.cholesky();
        let fall = |beyond: &Vector2<f64>| match &factor {
            Some(factor) if self.widest.is_none() => -0.5 * beyond.dot(&factor.solve(beyond)),
            _ => f64::NEG_INFINITY,
        };
        columns.over(from, to, fall, out);
        if self.config.cliffs {
            columns.keep_cliffs(from, to, out);
        }
    }

    /// Returns the lattice after `dt`, and sets the belief in its cells.
    fn moved(
        &self,
        dt: f64,
        columns: &mut Columns<N>,
        weights: &mut Weights<N>,
    ) -> Result<Lattice, EstimatorError> {
        let mean = self.belief.mean();
        let slope = slope_of_place(&self.motion, mean, dt)?;
        let noise = self.motion.noise_factor(mean, dt);
        let spread: Covariance<N> = noise * noise.transpose();
        let noise: Matrix2<f64> = spread.fixed_view::<2, 2>(0, 0).into_owned();

        let mut state = *mean;
        state.fixed_rows_mut::<2>(0).copy_from(&self.lattice.centre());
        let centre = self.motion.propagate(&state, dt).fixed_rows::<2>(0).into_owned();
        let mut lattice = self.lattice.moved(centre, &slope)?;
        columns.copy_from(&self.columns);
        columns.shift(-libm::log(libm::fabs(slope.determinant())));
        let mut before = Some(&self.weights);

        let mut place = self.belief.estimate().position();
        place.mean = self.motion.propagate(mean, dt).fixed_rows::<2>(0).into_owned();
        place.covariance = slope * place.covariance * slope.transpose();
        let mut left = 1.0;
        while left > 0.0 {
            let share = left * resolved_share(&place.covariance, &(noise * left));
            let part = spread * share;
            place.covariance += noise * share;
            if let Some(wider) = self.widened(&lattice, &place, &(noise * share))? {
                let narrow = columns.clone();
                self.over(&narrow, &lattice, &wider, &place, columns);
                lattice = wider;
                weights.set(columns);
                before = None;
            }
            diffuse(columns, before.take(), weights, &lattice, &part)?;
            left = if share < left { left - share } else { 0.0 };
        }
        Ok(lattice)
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

/// The share of a noise that cells which resolve a belief can take in at once: what makes its
/// standard deviation twice as large in some direction. In coarser cells it would be lost.
fn resolved_share(belief: &Matrix2<f64>, noise: &Matrix2<f64>) -> f64 {
    let Some(factor) = belief.cholesky() else { return 1.0 };
    let ratio = factor.solve(noise).trace();
    if ratio > 3.0 { 3.0 / ratio } else { 1.0 }
}

/// Spreads the place by the noise's first two components, and the further components by the rest;
/// leaves a density that integrates to 1. The weights come from `before`, where given.
fn diffuse<const N: usize>(
    columns: &mut Columns<N>,
    before: Option<&Weights<N>>,
    weights: &mut Weights<N>,
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
    weights.blur(before, lattice.side(), variance);
    let log_one = -log_total(weights, lattice);
    for (hypothesis, weights) in weights.each().iter().enumerate() {
        columns.diffuse(hypothesis, weights, log_one, &behind)?;
    }
    Ok(())
}
