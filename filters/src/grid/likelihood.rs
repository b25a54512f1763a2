use alloc::{vec, vec::Vec};

use foxhunt_core::{
    EstimatorError, MeasurementModel, Observation, Role, State, absorb_receiver_noise,
};
use nalgebra::{SMatrix, SVector};

use super::{Columns, GridConfig, Lattice};

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
        let places: Vec<_> = (0..lattice.len()).map(|i| lattice.place(i)).collect();
        let columns: [Vec<f64>; N] =
            core::array::from_fn(|row| places.iter().map(|place| place[row]).collect());
        let mut logs = vec![0.0; places.len()];
        for (hypothesis, observation) in self.observations.iter().enumerate() {
            let columns = core::array::from_fn(|row| &columns[row][..]);
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
        let not_finite = EstimatorError::NotFinite { role: Role::Expected };
        let Some(first) = self.observations.first() else { return Ok(()) };
        let competing = self.competing();
        let mut noises = self.noises(None)?;
        for index in 0..lattice.len() {
            let mut state = self.reference;
            state.fixed_rows_mut::<2>(0).copy_from(&lattice.place(index));
            if first.receiver_sigma().is_some() {
                noises = self.noises(Some(&state))?;
            }
            let (residual, slope) = self.at(&state, first);
            if !residual.iter().chain(slope.iter()).all(|v| v.is_finite()) {
                return Err(not_finite);
            }
            let residual = first.strike(residual);
            let slope = first.strike(slope);
            for (hypothesis, (at_zero, root)) in noises.iter().enumerate() {
                let white: SMatrix<f64, M, N> = root.solve_lower_triangular_unchecked(&slope);
                let mut cell = posterior.cell(hypothesis, index);
                let away = root.solve_lower_triangular_unchecked(&residual);
                cell.log += at_zero - 0.5 * away.norm_squared();
                cell.shift += white.tr_mul(&away);
                cell.information += white.tr_mul(&white);
                if let Some(bearing) = competing.get(hypothesis) {
                    let [mixture, moments] =
                        bearing.each_ref().map(|o| self.measurement.log_likelihood(&state, o));
                    cell.log += mixture - moments;
                }
                posterior.set(hypothesis, index, &cell);
            }
        }
        Ok(())
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

    /// The log-density of no residual and the factor of the noise, under each hypothesis; that of
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
            let root = observation.noise().cholesky()?.unpack();
            Some((observation.log_density(&SVector::zeros()), root))
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
