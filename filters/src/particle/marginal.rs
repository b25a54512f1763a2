use foxhunt_core::{
    Covariance, EstimatorError, MeasurementModel, MotionModel, Observation, Role, State, noise,
    parameter::require,
};
use nalgebra::{SMatrix, SVector};

/// The last K components of one particle, given the others: a Gaussian whose mean stands in the
/// particle's state.
#[derive(Clone, Copy, Debug)]
pub(super) struct Particle<const N: usize, const K: usize> {
    pub(super) state: State<N>,
    pub(super) spread: Covariance<K>,
}

/// An observation linearised about one particle, the nuisance integrated out.
#[derive(Clone, Copy, Debug)]
pub(super) struct Linearised<const M: usize, const K: usize> {
    /// ∂h over the last K components; missing rows are zero.
    slope: SMatrix<f64, M, K>,
    residual: SVector<f64, M>,
    /// Addition of the nuisance to the noise.
    spread: Covariance<M>,
    dof: usize,
    /// Change of the log-likelihood by directions that compete for the bearing.
    competing: f64,
}

impl<const M: usize, const K: usize> Linearised<M, K> {
    /// H with H Hᵀ = S.
    fn factor(&self, noise: &Tempered<M>) -> Option<SMatrix<f64, M, M>> {
        Some((self.spread + noise.noise).cholesky()?.unpack())
    }

    /// ln p(z | what is sampled)^φ; NaN where the model gives none.
    pub(super) fn log_density(&self, noise: &Tempered<M>) -> f64 {
        let density = |factor| noise::gaussian(&self.residual, &factor, self.dof);
        let constant = noise.log_constant + noise.exponent * self.competing;
        self.factor(noise).map_or(f64::NAN, |factor| density(factor) + constant)
    }
}

/// The noise of an observation that is applied with an exponent: N(r; 0, R)^φ is N(r; 0, R/φ) but
/// for a constant.
pub(super) struct Tempered<const M: usize> {
    noise: Covariance<M>,
    exponent: f64,
    /// The logarithm of that constant.
    log_constant: f64,
}

impl<const M: usize> Tempered<M> {
    pub(super) fn new(observation: &Observation<M>, exponent: f64) -> Result<Self, EstimatorError> {
        let whole = observation.noise();
        let noise = Covariance::from_fn(|i, j| {
            let present = observation.has(i) && observation.has(j);
            if present { whole[(i, j)] / exponent } else { whole[(i, j)] }
        });
        let factor = |noise: Covariance<M>| {
            let role = Role::Innovation;
            noise
                .cholesky()
                .map(|factor| factor.unpack())
                .ok_or(EstimatorError::NotPositiveDefinite { role })
        };
        let none = SVector::zeros();
        let dof = observation.len();
        let whole = noise::gaussian(&none, &factor(whole)?, dof);
        let log_constant = exponent * whole - noise::gaussian(&none, &factor(noise)?, dof);
        Ok(Self { noise, exponent, log_constant })
    }
}

impl<const N: usize, const K: usize> Particle<N, K> {
    /// The first of the components that are integrated out.
    const FIRST: usize = N - K;

    /// Linearises an observation about this particle; `bearing` is its
    /// [`competing_bearing`](Observation::competing_bearing).
    pub(super) fn linearised<const M: usize>(
        &self,
        model: &impl MeasurementModel<N, M>,
        observation: &Observation<M>,
        bearing: Option<&(usize, [Observation<M>; 2])>,
    ) -> Linearised<M, K> {
        let jacobian = model.jacobian(&self.state, observation.receiver());
        let slope = jacobian.fixed_columns::<K>(Self::FIRST).into_owned();
        let slope = observation.strike(slope);
        let expected = model.expected(&self.state, observation.receiver());
        let residual = model.residual(observation.value(), &expected);
        let residual = observation.strike(residual);
        let spread = slope * self.spread * slope.transpose();
        let competing = match bearing {
            Some((row, alone)) if slope.row(*row).norm_squared() <= 0.0 => {
                let [mixture, moments] =
                    alone.each_ref().map(|one| model.log_likelihood(&self.state, one));
                mixture - moments
            }
            _ => 0.0,
        };
        Linearised { slope, residual, spread, dof: observation.len(), competing }
    }

    /// The Kalman filter of the nuisance, in Joseph's form.
    pub(super) fn corrected<const M: usize>(
        &self,
        linear: &Linearised<M, K>,
        noise: &Tempered<M>,
    ) -> Option<Self> {
        // Gᵀ = S⁻¹ H P.
        let cross = linear.slope * self.spread;
        let factor = linear.factor(noise)?;
        let white = factor.solve_lower_triangular(&cross)?;
        let gain = factor.tr_solve_lower_triangular(&white)?.transpose();
        let kept = Covariance::<K>::identity() - gain * linear.slope;
        let mut spread =
            kept * self.spread * kept.transpose() + gain * noise.noise * gain.transpose();
        spread.fill_upper_triangle_with_lower_triangle();
        let step = gain * linear.residual;
        let mut state = self.state;
        (0..K).for_each(|i| state[Self::FIRST + i] += step[i]);
        Some(Self { state, spread })
    }

    /// The particle `dt` seconds on; `white` moves what is sampled.
    ///
    /// # Errors
    ///
    /// When what is sampled moves with the nuisance or shares its noise: it would depend on it.
    pub(super) fn moved(
        &self,
        motion: &impl MotionModel<N>,
        dt: f64,
        white: State<N>,
    ) -> Result<Self, EstimatorError> {
        let factor = motion.noise_factor(&self.state, dt);
        let noise = factor * factor.transpose();
        let jacobian = motion.jacobian(&self.state, dt);
        let shared = |i: usize, j: usize| {
            let scale = libm::sqrt(noise[(i, i)] * noise[(j, j)]);
            jacobian[(i, j)].abs().max(if scale > 0.0 { noise[(i, j)].abs() / scale } else { 0.0 })
        };
        let coupling = (0..Self::FIRST)
            .flat_map(|i| (Self::FIRST..N).map(move |j| (i, j)))
            .fold(0.0, |most: f64, (i, j)| most.max(shared(i, j)));
        // A numerical Jacobian is not exactly zero.
        require(
            coupling <= 1e-6,
            "coupling of the sampled components to the others",
            coupling,
            "none",
        )?;
        let mut state = motion.propagate(&self.state, dt);
        let step = factor * white;
        (0..Self::FIRST).for_each(|i| state[i] += step[i]);
        let turn = jacobian.fixed_view::<K, K>(Self::FIRST, Self::FIRST).into_owned();
        let noise = noise.fixed_view::<K, K>(Self::FIRST, Self::FIRST).into_owned();
        let mut spread = turn * self.spread * turn.transpose() + noise;
        spread.fill_upper_triangle_with_lower_triangle();
        Ok(Self { state, spread })
    }
}
