use alloc::{vec, vec::Vec};
use core::{
    f64::consts::{PI, TAU},
    ops::Range,
};

use foxhunt_core::{
    Axis, EstimatorError, MeasurementModel, Observation, Role, State, absorb_receiver_noise,
};
use nalgebra::{SMatrix, SVector};

use super::{Columns, GridConfig, Lattice};
use crate::vectorised::{Map, run};

/// The likelihood of an observation in every cell.
pub(super) struct Likelihood<'a, H, const N: usize, const M: usize> {
    measurement: &'a H,
    /// Where n is counted from; 0 in the first two components.
    reference: State<N>,
    /// The observation under each hypothesis of its noise.
    observations: Vec<Observation<M>>,
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
        Self { measurement, reference, observations }
    }

    /// The posterior over the prior's cells, not normalised.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::NotFinite`] when a likelihood is NaN or +∞.
    pub(super) fn times(
        &self,
        prior: &Columns<N>,
        lattice: &Lattice,
    ) -> Result<Columns<N>, EstimatorError> {
        let mut posterior = prior.clone();
        if N == 2 {
            self.add_log_likelihoods(&mut posterior, lattice)?;
        } else {
            self.add_linear(&mut posterior, lattice)?;
        }
        Ok(posterior)
    }

    /// ln p(z | x) as the model has it.
    fn add_log_likelihoods(
        &self,
        posterior: &mut Columns<N>,
        lattice: &Lattice,
    ) -> Result<(), EstimatorError> {
        let places = lattice.places();
        let columns: [&[f64]; N] = core::array::from_fn(|row| &places[row][..]);
        let mut logs = vec![0.0; lattice.len()];
        for (hypothesis, observation) in self.observations.iter().enumerate() {
            self.measurement.log_likelihoods(columns, observation, &mut logs);
            if logs.iter().any(|log| log.is_nan() || *log >= f64::INFINITY) {
                return Err(EstimatorError::NotFinite { role: Role::Expected });
            }
            let sums = posterior.logs_mut(hypothesis).iter_mut().zip(&logs);
            sums.for_each(|(sum, log)| *sum += log);
        }
        Ok(())
    }

    /// ln N(r − C n; 0, R) as a quadratic in n, with r the residual at the reference and C the
    /// model's slope there.
    fn add_linear(
        &self,
        posterior: &mut Columns<N>,
        lattice: &Lattice,
    ) -> Result<(), EstimatorError> {
        let Some(first) = self.observations.first() else { return Ok(()) };
        let places = lattice.places();
        let (residuals, slopes) = self.linearised(&places, first);
        if !residuals.iter().chain(slopes.iter().flatten()).flatten().all(|v| v.is_finite()) {
            return Err(EstimatorError::NotFinite { role: Role::Expected });
        }
        let linear = Linear { residuals, slopes };
        if first.receiver_sigma().is_some() {
            // The noise is another one in every cell.
            for index in 0..lattice.len() {
                let state = self.state(&places, index);
                let noises = self.noises(Some(&state))?;
                linear.add_to(posterior, &noises, index..index + 1);
            }
        } else {
            linear.add_to(posterior, &self.noises(None)?, 0..lattice.len());
        }
        for (hypothesis, bearing) in self.competing().iter().enumerate() {
            for (index, log) in posterior.logs_mut(hypothesis).iter_mut().enumerate() {
                let state = self.state(&places, index);
                let [mixture, moments] =
                    bearing.each_ref().map(|o| self.measurement.log_likelihood(&state, o));
                *log += mixture - moments;
            }
        }
        Ok(())
    }

    /// A cell's state, n at the reference.
    fn state(&self, places: &[Vec<f64>; 2], index: usize) -> State<N> {
        State::from_fn(|i, _| if i < 2 { places[i][index] } else { self.reference[i] })
    }

    /// r and C of every cell, with 0 for what is missing and no column for a slope of 0.
    fn linearised(
        &self,
        places: &[Vec<f64>; 2],
        observation: &Observation<M>,
    ) -> ([Vec<f64>; M], [[Vec<f64>; N]; M]) {
        let cells = places[0].len();
        let present = observation.strike(SVector::<f64, M>::repeat(1.0));
        let residuals_at = |state: &State<N>| {
            let behind: Vec<Vec<f64>> = (2..N).map(|i| vec![state[i]; cells]).collect();
            let states =
                core::array::from_fn(|i| if i < 2 { &places[i][..] } else { &behind[i - 2][..] });
            let mut columns: [Vec<f64>; M] = core::array::from_fn(|_| vec![0.0; cells]);
            let out = columns.each_mut().map(|column| &mut column[..]);
            let (z, receiver) = (observation.value(), observation.receiver());
            self.measurement.residuals(states, z, receiver, out);
            for (row, column) in columns.iter_mut().enumerate() {
                column.iter_mut().filter(|_| present[row] <= 0.0).for_each(|r| *r = 0.0);
            }
            columns
        };
        let axes = self.measurement.axes();
        let residuals = residuals_at(&self.reference);
        let mut slopes: [[Vec<f64>; N]; M] =
            core::array::from_fn(|_| core::array::from_fn(|_| Vec::new()));
        for i in 2..N {
            // The model is linear in n, whatever the step.
            let step = libm::fmax(1.0, self.reference[i].abs());
            let mut state = self.reference;
            state[i] += step;
            for (row, mut column) in residuals_at(&state).into_iter().enumerate() {
                let turn = if axes[row] == Axis::Angle { TAU } else { 0.0 };
                let of = |[residual]: [f64; 1], moved| {
                    let off: f64 = residual - moved;
                    let off = if off > PI { off - turn } else { off };
                    (if off < -PI { off + turn } else { off }) / step
                };
                run(Map { columns: [&residuals[row]], of, out: &mut column });
                if column.iter().any(|slope| slope.abs() > 0.0 || slope.is_nan()) {
                    slopes[row][i] = column;
                }
            }
        }
        (residuals, slopes)
    }

    /// Where directions compete for a bearing that has no part in the further components: the
    /// bearing alone under each hypothesis, as a mixture and by the moments that the quadratic has.
    fn competing(&self) -> Vec<[Observation<M>; 2]> {
        let bearing = |observation: &Observation<M>| {
            let (bearing, alone) = observation.competing_bearing()?;
            let (_, slope) = self.at(&self.reference, observation);
            (slope.row(bearing).norm_squared() <= 0.0).then_some(alone)
        };
        self.observations.iter().filter_map(bearing).collect()
    }

    /// The log-density of no residual and the inverse of the noise, under each hypothesis; that of
    /// an uncertain receiver as it stands for a target in `state`.
    fn noises(
        &self,
        state: Option<&State<N>>,
    ) -> Result<Vec<(f64, SMatrix<f64, M, M>)>, EstimatorError> {
        let noise = |observation: &Observation<M>| {
            let observation = match state {
                Some(state) => absorb_receiver_noise(self.measurement, state, observation),
                None => *observation,
            };
            let information = observation.noise().cholesky()?.inverse();
            Some((observation.log_density(&SVector::zeros()), information))
        };
        let not_definite = EstimatorError::NotPositiveDefinite { role: Role::Innovation };
        self.observations.iter().map(|o| noise(o).ok_or(not_definite)).collect()
    }

    /// The residual at a state, and the slope over what lies behind its place.
    fn at(
        &self,
        state: &State<N>,
        observation: &Observation<M>,
    ) -> (SVector<f64, M>, SMatrix<f64, M, N>) {
        let receiver = observation.receiver();
        let expected = self.measurement.expected(state, receiver);
        let mut slope = self.measurement.jacobian(state, receiver);
        slope.fixed_columns_mut::<2>(0).fill(0.0);
        (self.measurement.residual(observation.value(), &expected), slope)
    }
}

/// The residual r at n = 0 of every cell and its slope C over n, a column for each number.
struct Linear<const N: usize, const M: usize> {
    residuals: [Vec<f64>; M],
    /// Of each component over those of the state; empty where there is none.
    slopes: [[Vec<f64>; N]; M],
}

impl<const N: usize, const M: usize> Linear<N, M> {
    /// Adds ln N(r − C n; 0, R) in these cells, given the log-density of 0 and W = R⁻¹ under each
    /// hypothesis: − ½ rᵀ W r to l, Cᵀ W r to η and Cᵀ W C to Λ.
    fn add_to(
        &self,
        columns: &mut Columns<N>,
        noises: &[(f64, SMatrix<f64, M, M>)],
        cells: Range<usize>,
    ) {
        for (hypothesis, (at_zero, information)) in noises.iter().enumerate() {
            let (logs, rest) = columns.columns_mut(hypothesis).split_at_mut(1);
            logs[0][cells.clone()].iter_mut().for_each(|log| *log += at_zero);
            for (a, b) in (0..M).flat_map(|a| (0..M).map(move |b| (a, b))) {
                let weight = information[(a, b)];
                if weight.abs() <= 0.0 {
                    continue;
                }
                let add = |factor: f64, x: &[f64], y: &[f64], out: &mut [f64]| {
                    let columns = [&x[cells.clone()], &y[cells.clone()]];
                    let of = |[x, y]: [f64; 2], sum| sum + factor * (x * y);
                    run(Map { columns, of, out: &mut out[cells.clone()] });
                };
                add(-0.5 * weight, &self.residuals[a], &self.residuals[b], &mut logs[0]);
                let mut row = N - 2;
                for i in 2..N {
                    let slope = &self.slopes[a][i];
                    if slope.is_empty() {
                        row += i - 1;
                        continue;
                    }
                    add(weight, slope, &self.residuals[b], &mut rest[i - 2]);
                    for other in &self.slopes[b][2..=i] {
                        if !other.is_empty() {
                            add(weight, slope, other, &mut rest[row]);
                        }
                        row += 1;
                    }
                }
            }
        }
    }
}
