use alloc::{vec, vec::Vec};
use core::f64::consts::{PI, TAU};

use foxhunt_core::{
    Axis, Covariance, EstimatorError, MeasurementModel, Observation, Pose, Role, State, columns,
    noise,
};
use nalgebra::{SVector, Vector3};

use super::{
    GridConfig, Lattice,
    columns::{Column, Columns, Hypothesis, add_product},
};
use crate::vectorised::{Kernel, Map, run};

/// So many cells, in whole rows, go to a model at once: their columns stay in the nearest cache.
const BLOCK: usize = 1024;

/// The likelihood of an observation in every cell.
pub(super) struct Likelihood<'a, H, const N: usize, const M: usize> {
    measurement: &'a H,
    /// Origin of n; 0 in the first two components.
    reference: State<N>,
    /// The observation under each hypothesis of its noise.
    observations: Vec<Observation<M>>,
    /// The component whose noise is in doubt.
    doubted: Option<usize>,
}

impl<'a, H: MeasurementModel<N, M>, const N: usize, const M: usize> Likelihood<'a, H, N, M> {
    pub(super) fn new(
        measurement: &'a H,
        reference: State<N>,
        observation: &Observation<M>,
        config: &GridConfig,
    ) -> Self {
        let observations = match &config.noise_scales {
            Some(scales) => {
                let scaled = |(factor, _): &(f64, f64)| {
                    observation.with_noise_scaled(scales.component, *factor)
                };
                scales.factors.iter().map(scaled).collect()
            }
            None => vec![*observation],
        };
        let doubted = config.noise_scales.as_ref().map(|scales| scales.component);
        Self { measurement, reference, observations, doubted }
    }

    /// Makes the prior over the cells the posterior, not normalised.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::NotFinite`] when a likelihood is NaN or +∞.
    pub(super) fn multiply(
        &self,
        columns: &mut Columns<N>,
        lattice: &Lattice,
        pool: &mut Pool,
    ) -> Result<(), EstimatorError> {
        if N == 2 {
            self.add_log_likelihoods(columns, lattice)
        } else {
            self.add_linear(columns, lattice, pool)
        }
    }

    /// ln p(z | x) as the model has it.
    fn add_log_likelihoods(
        &self,
        columns: &mut Columns<N>,
        lattice: &Lattice,
    ) -> Result<(), EstimatorError> {
        let side = lattice.side();
        let rows = (BLOCK / side).max(1);
        let mut places = [Vec::new(), Vec::new()];
        let mut logs = vec![0.0; rows * side];
        for first in (0..side).step_by(rows) {
            let last = (first + rows).min(side);
            lattice.places(first..last, &mut places);
            let states: [&[f64]; N] = core::array::from_fn(|row| &places[row][..]);
            let logs = &mut logs[..(last - first) * side];
            for (hypothesis, observation) in
                columns.hypotheses_mut().iter_mut().zip(&self.observations)
            {
                self.measurement.log_likelihoods(states, observation, logs);
                let sums = &mut hypothesis.logs[first * side..last * side];
                if !run(AddBounded { logs, sums }) {
                    return Err(EstimatorError::NotFinite { role: Role::Expected });
                }
            }
        }
        Ok(())
    }

    /// ln N(r − C n; 0, R) as a quadratic in n, with r the residual at the reference and C the
    /// model's slope there.
    fn add_linear(
        &self,
        columns: &mut Columns<N>,
        lattice: &Lattice,
        pool: &mut Pool,
    ) -> Result<(), EstimatorError> {
        let Some(first) = self.observations.first() else { return Ok(()) };
        let mut places = [pool.take(0), pool.take(0)];
        lattice.places(0..lattice.side(), &mut places);
        let linear = self.linearised(&places, first, pool)?;
        let spread = first
            .receiver_sigma()
            .map(|sigma| self.receiver_spread(&places, first.receiver(), sigma, pool));
        let hypotheses = columns.hypotheses_mut().iter_mut();
        for (hypothesis, observation) in hypotheses.zip(&self.observations) {
            let noise = match &spread {
                Some(spread) => Noise::with_receiver(observation, spread, lattice.len())?,
                None => Noise::of(observation)?,
            };
            linear.add_to(hypothesis, &noise);
        }
        self.add_competing(columns, &linear, &places);
        places.into_iter().for_each(|column| pool.give(column));
        linear.residuals.into_iter().for_each(|column| pool.give_column(column));
        Ok(())
    }

    /// The residuals at a state's further components, as columns.
    fn residuals_at(
        &self,
        places: &[Vec<f64>; 2],
        state: &State<N>,
        z: &SVector<f64, M>,
        receiver: &Pose,
        pool: &mut Pool,
    ) -> [Vec<f64>; M] {
        let cells = places[0].len();
        let behind = columns_behind(cells, state, pool);
        let mut columns: [Vec<f64>; M] = core::array::from_fn(|_| pool.take(cells));
        let out = columns::slices_mut(&mut columns);
        self.measurement.residuals(states(places, &behind), z, receiver, out);
        behind.into_iter().for_each(|column| pool.give(column));
        columns
    }

    /// r and C of every cell, with 0 for what is missing.
    fn linearised(
        &self,
        places: &[Vec<f64>; 2],
        observation: &Observation<M>,
        pool: &mut Pool,
    ) -> Result<Linear<N, M>, EstimatorError> {
        let not_finite = EstimatorError::NotFinite { role: Role::Expected };
        let residuals_at = |state: &State<N>, pool: &mut Pool| {
            let z = observation.value();
            let receiver = observation.receiver();
            let mut columns = self.residuals_at(places, state, z, receiver, pool);
            for (row, column) in columns.iter_mut().enumerate() {
                if !observation.has(row) {
                    column.fill(0.0);
                }
            }
            columns
        };
        let axes = self.measurement.axes();
        let residuals = residuals_at(&self.reference, pool);
        if !residuals.iter().all(|column| run(Extent(column))[0].is_finite()) {
            return Err(not_finite);
        }
        let mut slopes: [[Column; N]; M] =
            core::array::from_fn(|_| core::array::from_fn(|_| Column::Same(0.0)));
        for i in 2..N {
            // The model is linear in n, whatever the step.
            let step = libm::fmax(1.0, self.reference[i].abs());
            let mut state = self.reference;
            state[i] += step;
            for (row, mut column) in residuals_at(&state, pool).into_iter().enumerate() {
                subtract(&mut column, &residuals[row], axes[row], 1.0 / step);
                let [least, most] = run(Extent(&column));
                let size = libm::fmax(least.abs(), most.abs());
                if !size.is_finite() {
                    return Err(not_finite);
                }
                // Apart by no more than what roundings of the levels make of one slope.
                slopes[row][i] = if most - least <= 1e-9 * size {
                    pool.give(column);
                    Column::Same(0.5 * (least + most))
                } else {
                    Column::Each(column)
                };
            }
        }
        Ok(Linear { residuals: residuals.map(Column::Each), slopes })
    }

    /// Puts the mixture in the place of the quadratic's moments where directions compete for a
    /// bearing that has no part in the further components.
    fn add_competing(
        &self,
        columns: &mut Columns<N>,
        linear: &Linear<N, M>,
        places: &[Vec<f64>; 2],
    ) {
        if self.observations.first().is_none_or(|first| first.bearing_modes().is_none()) {
            return;
        }
        let behind = columns_behind(places[0].len(), &self.reference, &mut Pool::default());
        let mut ratios = vec![0.0; places[0].len()];
        let mut moments = ratios.clone();
        for (j, (hypothesis, observation)) in
            columns.hypotheses_mut().iter_mut().zip(&self.observations).enumerate()
        {
            let Some((bearing, [mixture, gaussian])) = observation.competing_bearing() else {
                return;
            };
            if !linear.slopes[bearing].iter().all(Column::is_zero) {
                return;
            }
            // The bearing alone is the same whatever the noise of the others.
            if j == 0 || self.doubted == Some(bearing) {
                let states = states(places, &behind);
                self.measurement.log_likelihoods(states, &mixture, &mut ratios);
                self.measurement.log_likelihoods(states, &gaussian, &mut moments);
                let of = |[moments]: [f64; 1], mixture| mixture - moments;
                run(Map { columns: [&moments], of, out: &mut ratios });
            }
            let add = |[ratio]: [f64; 1], log| log + ratio;
            run(Map { columns: [&ratios], of: add, out: &mut hypothesis.logs });
        }
    }

    /// G Σ Gᵀ of every cell, as [`absorb_receiver_noise`](foxhunt_core::absorb_receiver_noise) has
    /// it, a column for each entry.
    fn receiver_spread(
        &self,
        places: &[Vec<f64>; 2],
        receiver: &Pose,
        sigma: &Vector3<f64>,
        pool: &mut Pool,
    ) -> [[Vec<f64>; M]; M] {
        let axes = self.measurement.axes();
        let cells = places[0].len();
        let mut spread: [[Vec<f64>; M]; M] =
            core::array::from_fn(|_| core::array::from_fn(|_| vec![0.0; cells]));
        for axis in 0..3 {
            let mut at = |step: f64| {
                let mut receiver = *receiver;
                receiver.position[axis] += step;
                self.residuals_at(places, &self.reference, &SVector::zeros(), &receiver, pool)
            };
            let mut slopes = at(sigma[axis]);
            let low = at(-sigma[axis]);
            for (row, column) in slopes.iter_mut().enumerate() {
                subtract(column, &low[row], axes[row], 0.5);
            }
            for (a, row) in spread.iter_mut().enumerate() {
                for (b, out) in row.iter_mut().enumerate() {
                    let of = |[a, b]: [f64; 2], sum| sum + a * b;
                    run(Map { columns: [&slopes[a], &slopes[b]], of, out });
                }
            }
            slopes.into_iter().chain(low).for_each(|column| pool.give(column));
        }
        spread
    }
}

/// Columns whose memory is used again: a heap gives large ones back to the system, and takes them
/// again page by page.
#[derive(Clone, Debug, Default)]
pub(super) struct Pool(Vec<Vec<f64>>);

impl Pool {
    /// Returns a column of `cells` cells, of any content.
    fn take(&mut self, cells: usize) -> Vec<f64> {
        let mut column = self.0.pop().unwrap_or_default();
        column.resize(cells, 0.0);
        column
    }

    fn give(&mut self, column: Vec<f64>) {
        self.0.push(column);
    }

    fn give_column(&mut self, column: Column) {
        if let Column::Each(column) = column {
            self.give(column);
        }
    }
}

/// Returns a state's further components, each as a column over `cells` cells.
fn columns_behind<const N: usize>(
    cells: usize,
    state: &State<N>,
    pool: &mut Pool,
) -> Vec<Vec<f64>> {
    let column = |i: usize| {
        let mut column = pool.take(cells);
        column.fill(state[i]);
        column
    };
    (2..N).map(column).collect()
}

fn states<'a, const N: usize>(places: &'a [Vec<f64>; 2], behind: &'a [Vec<f64>]) -> [&'a [f64]; N] {
    core::array::from_fn(|i| if i < 2 { &places[i][..] } else { &behind[i - 2][..] })
}

/// Residuals that a component has with another expectation, made `factor` times the change of that
/// expectation; the short way round on an angle.
fn subtract(moved: &mut [f64], residuals: &[f64], axis: Axis, factor: f64) {
    let turn = if axis == Axis::Angle { TAU } else { 0.0 };
    let of = |[residual]: [f64; 1], moved| {
        let off: f64 = residual - moved;
        let off = if off > PI { off - turn } else { off };
        (if off < -PI { off + turn } else { off }) * factor
    };
    run(Map { columns: [residuals], of, out: moved });
}

/// Adds to each sum; whether nothing was NaN or +∞.
struct AddBounded<'a> {
    logs: &'a [f64],
    sums: &'a mut [f64],
}

impl Kernel for AddBounded<'_> {
    type Output = bool;

    #[inline(always)]
    fn run(self) -> bool {
        let mut unbounded = false;
        for (sum, log) in self.sums.iter_mut().zip(self.logs) {
            unbounded |= log.is_nan() | (*log >= f64::INFINITY);
            *sum += log;
        }
        !unbounded
    }
}

/// The least and the largest number; NaN and NaN unless all are finite.
struct Extent<'a>(&'a [f64]);

impl Kernel for Extent<'_> {
    type Output = [f64; 2];

    #[inline(always)]
    fn run(self) -> [f64; 2] {
        let mut extent = [f64::INFINITY, f64::NEG_INFINITY];
        let mut odd = false;
        for x in self.0 {
            let [least, most] = &mut extent;
            *least = if *x < *least { *x } else { *least };
            *most = if *x > *most { *x } else { *most };
            odd |= !x.is_finite();
        }
        if odd { [f64::NAN; 2] } else { extent }
    }
}

/// The residual r at n = 0 of every cell and its slope C over n.
struct Linear<const N: usize, const M: usize> {
    residuals: [Column; M],
    /// Slopes of each component over the state's components.
    slopes: [[Column; N]; M],
}

/// A noise of every cell: the log-density of no residual, and W = R⁻¹.
struct Noise<const M: usize> {
    at_zero: Column,
    information: [[Column; M]; M],
}

impl<const M: usize> Noise<M> {
    /// Returns the observation's noise, one for all cells.
    fn of(observation: &Observation<M>) -> Result<Self, EstimatorError> {
        let not_definite = EstimatorError::NotPositiveDefinite { role: Role::Innovation };
        let information = observation.noise().cholesky().ok_or(not_definite)?.inverse();
        let entry = |a: usize, b: usize| Column::Same(information[(a, b)]);
        Ok(Self {
            at_zero: Column::Same(observation.log_density(&SVector::zeros())),
            information: core::array::from_fn(|a| core::array::from_fn(|b| entry(a, b))),
        })
    }

    /// The observation's and what an uncertain receiver adds to it.
    fn with_receiver(
        observation: &Observation<M>,
        spread: &[[Vec<f64>; M]; M],
        cells: usize,
    ) -> Result<Self, EstimatorError> {
        let not_definite = EstimatorError::NotPositiveDefinite { role: Role::Innovation };
        let mut at_zero = vec![0.0; cells];
        let mut entries: [[Vec<f64>; M]; M] =
            core::array::from_fn(|_| core::array::from_fn(|_| vec![0.0; cells]));
        let noise = observation.noise();
        for (index, at_zero) in at_zero.iter_mut().enumerate() {
            let more = Covariance::<M>::from_fn(|a, b| spread[a][b][index]);
            let more = observation.mask(observation.mask(more).transpose());
            let root = (noise + more).cholesky().ok_or(not_definite)?;
            let zero = SVector::zeros();
            *at_zero = noise::gaussian(&zero, root.l_dirty(), observation.len());
            let information = root.inverse();
            for (a, row) in entries.iter_mut().enumerate() {
                row.iter_mut().enumerate().for_each(|(b, out)| out[index] = information[(a, b)]);
            }
        }
        let information = entries.map(|row| row.map(Column::Each));
        Ok(Self { at_zero: Column::Each(at_zero), information })
    }
}

impl<const N: usize, const M: usize> Linear<N, M> {
    /// Adds ln N(r − C n; 0, R) to every cell: − ½ rᵀ W r to l, Cᵀ W r to η and Cᵀ W C to Λ.
    fn add_to(&self, hypothesis: &mut Hypothesis, noise: &Noise<M>) {
        let Hypothesis { logs, shifts, information } = hypothesis;
        let cells = logs.len();
        add_product(logs, 1.0, &noise.at_zero, &Column::Same(1.0));
        for (a, b) in (0..M).flat_map(|a| (0..M).map(move |b| (a, b))) {
            let weight = &noise.information[a][b];
            if weight.is_zero() {
                continue;
            }
            let weighted = weight.times(cells, &self.residuals[b]);
            add_product(logs, -0.5 * weighted.0, &self.residuals[a], &weighted.1);
            let mut entries = information.iter_mut();
            for i in 2..N {
                let slope = &self.slopes[a][i];
                add_product(&mut shifts[i - 2], weighted.0, slope, &weighted.1);
                for (j, entry) in (2..=i).zip(&mut entries) {
                    let other = weight.times(cells, &self.slopes[b][j]);
                    entry.add_product(cells, other.0, slope, &other.1);
                }
            }
        }
    }
}
