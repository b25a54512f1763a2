use core::borrow::Borrow;

use foxhunt_core::{
    Covariance, Estimate, EstimatorError, MeasurementModel, MotionModel, Observation, Role, State,
};
use nalgebra::SMatrix;

use super::{
    CramerRaoError, FisherQuadrature,
    fisher::{gaussian, mean},
};
use crate::{Gaussian, count::number, triangle};

/// The posterior Cramér-Rao bound: the smallest mean square error that any estimator can have,
/// over truths drawn from the prior (Tichavský, Muravchik & Nehorai 1998).
///
/// Holds the information matrix J; no estimator's E[(x − x̂)(x − x̂)ᵀ] is below J⁻¹. Expectations
/// are averages over trajectories that come from outside: states drawn from the prior and moved
/// by the model, all at the same time, with the observations of each.
///
/// The prediction is eq. 21 of the source with additive noise,
/// J⁻ = Q⁻¹ − Q⁻¹F̄ (J + E[Fᵀ Q⁻¹ F])⁻¹ F̄ᵀQ⁻¹, in a form that does not invert Q. With
/// C = E[(F − F̄)ᵀ Q⁻¹ (F − F̄)], F̄ = E\[F\] and Q = L Lᵀ it is
/// J⁻ = F̄⁻ᵀ (K − K A (I + Aᵀ K A)⁻¹ Aᵀ K) F̄⁻¹, K = J + C and A = F̄⁻¹ L: a still target has A = 0
/// and keeps its information. Where Q is singular, F may not turn with the state (C would be
/// infinite); a linear motion never does.
///
/// ```
/// # use foxhunt_core::{Estimate, RandomWalk, nalgebra::Vector2};
/// # use foxhunt_filters::PosteriorCramerRao;
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let prior = Estimate::isotropic(Vector2::new(5.0, 0.0), 3.0);
/// let mut bound = PosteriorCramerRao::new(&prior)?;
/// bound.predict(&RandomWalk::uniform(2.0), [Vector2::new(5.0, 0.0)], 4.0)?;
/// // 3² + 4 · 2² on each axis.
/// assert!((bound.covariance()?.trace() - 2.0 * 25.0).abs() < 1e-9);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosteriorCramerRao<const N: usize> {
    information: Covariance<N>,
}

/// Largest difference between states that passes for rounding: numerical Jacobians.
const ROUNDING: f64 = 1e-6;

impl<const N: usize> PosteriorCramerRao<N> {
    /// The bound before the first observation, with a Gaussian prior: J = P⁻¹.
    ///
    /// # Errors
    ///
    /// When the prior is not finite or its covariance not symmetric and positive definite.
    pub fn new(prior: &Estimate<N>) -> Result<Self, EstimatorError> {
        let prior = Gaussian::new(*prior, Role::Prior)?;
        let white = prior
            .factor()
            .solve_lower_triangular(&SMatrix::identity())
            .ok_or(EstimatorError::NotPositiveDefinite { role: Role::Prior })?;
        Ok(Self { information: white.transpose() * white })
    }

    /// The bound for a prior of this information, E[∇ln p(x) ∇ln p(x)ᵀ]; zero for none at all.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::NotFinite`], or [`EstimatorError::NotPositiveDefinite`] when it is not
    /// symmetric (to 1e-9 of its norm) and positive semi-definite.
    pub fn from_information(information: Covariance<N>) -> Result<Self, EstimatorError> {
        let role = Role::Prior;
        if !information.iter().all(|v| v.is_finite()) {
            return Err(EstimatorError::NotFinite { role });
        }
        let skew: Covariance<N> = information - information.transpose();
        let size = information.norm();
        // A semi-definite matrix is definite with next to nothing added.
        let raised = information + Covariance::identity() * (size * 1e-12 + f64::MIN_POSITIVE);
        if skew.norm() > 1e-9 * size || raised.cholesky().is_none() {
            return Err(EstimatorError::NotPositiveDefinite { role });
        }
        Ok(Self { information })
    }

    /// Carries the bound `dt` seconds forward; `states` are the trajectories' before the step.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::TimeStep`]; [`CramerRaoError`] when there is no state or the motion has
    /// no such bound. The bound is then left as it was.
    pub fn predict<S: Borrow<State<N>>>(
        &mut self,
        motion: &(impl MotionModel<N> + ?Sized),
        states: impl IntoIterator<Item = S, IntoIter: Clone>,
        dt: f64,
    ) -> Result<(), CramerRaoError> {
        EstimatorError::check_time_step(dt)?;
        let states = states.into_iter();
        let mut sum = Covariance::<N>::zeros();
        let mut count = 0;
        let mut noise: Option<SMatrix<f64, N, N>> = None;
        for state in states.clone() {
            sum += motion.jacobian(state.borrow(), dt);
            count += 1;
            let factor = motion.noise_factor(state.borrow(), dt);
            let first = noise.get_or_insert(factor);
            let difference = (factor - *first).norm();
            if difference > ROUNDING * first.norm() {
                let difference = difference / first.norm();
                return Err(CramerRaoError::StateDependentNoise { difference });
            }
        }
        let transition = mean(sum, count)?;
        let noise = noise.unwrap_or_else(SMatrix::zeros);
        let mut scatter = Covariance::<N>::zeros();
        for state in states {
            let turn = motion.jacobian(state.borrow(), dt) - transition;
            scatter += whitened_square(&noise, &turn)?;
        }
        let kept = self.information + scatter / number(count);

        let back = inverse(&transition).ok_or(CramerRaoError::SingularMotion)?;
        let spread = back * noise;
        // I + Aᵀ K A is positive definite whatever Q is.
        let carried = kept * spread;
        let inner = (Covariance::<N>::identity() + spread.transpose() * carried)
            .cholesky()
            .ok_or(EstimatorError::NotPositiveDefinite { role: Role::Posterior })?;
        let left = kept - carried * inner.solve(&carried.transpose());
        self.accept(back.transpose() * left * back)
    }

    /// Adds the information of an observation if its noise is Gaussian: E[Hᵀ R⁻¹ H]. Each
    /// trajectory comes with its own observation, of which pose, noise and which components are
    /// present count, not the values.
    ///
    /// # Errors
    ///
    /// When there is no trajectory or a Jacobian is not finite. The bound is then left as it was.
    pub fn update<const M: usize>(
        &mut self,
        model: &(impl MeasurementModel<N, M> + ?Sized),
        observed: impl IntoIterator<Item = (State<N>, Observation<M>)>,
    ) -> Result<(), CramerRaoError> {
        self.add(observed, |x, observation| {
            let not_finite = EstimatorError::NotFinite { role: Role::Expected };
            gaussian(model, x, observation).ok_or(not_finite.into())
        })
    }

    /// Adds the information of an observation of any likelihood, by numerical integration.
    ///
    /// # Errors
    ///
    /// When there is no trajectory, or as [`FisherQuadrature::information`]. The bound is then
    /// left as it was.
    pub fn update_numerically<const M: usize>(
        &mut self,
        model: &(impl MeasurementModel<N, M> + ?Sized),
        observed: impl IntoIterator<Item = (State<N>, Observation<M>)>,
        quadrature: FisherQuadrature,
    ) -> Result<(), CramerRaoError> {
        self.add(observed, |x, observation| quadrature.information(model, x, observation))
    }

    /// J, the information.
    #[must_use]
    pub fn information(&self) -> &Covariance<N> {
        &self.information
    }

    /// J⁻¹, the bound.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::NotPositiveDefinite`] as long as something is not known at all.
    pub fn covariance(&self) -> Result<Covariance<N>, EstimatorError> {
        let factor = self.information.cholesky();
        let factor = factor.ok_or(EstimatorError::NotPositiveDefinite { role: Role::Posterior })?;
        Ok(factor.inverse())
    }

    fn add<const M: usize>(
        &mut self,
        observed: impl IntoIterator<Item = (State<N>, Observation<M>)>,
        information: impl Fn(&State<N>, &Observation<M>) -> Result<Covariance<N>, CramerRaoError>,
    ) -> Result<(), CramerRaoError> {
        let mut sum = Covariance::<N>::zeros();
        let mut count = 0;
        for (x, observation) in observed {
            sum += information(&x, &observation)?;
            count += 1;
        }
        self.accept(self.information + mean(sum, count)?)
    }

    /// Takes the information after a step, made symmetric to the bit.
    fn accept(&mut self, mut information: Covariance<N>) -> Result<(), CramerRaoError> {
        if !information.iter().all(|v| v.is_finite()) {
            return Err(EstimatorError::NotFinite { role: Role::Posterior }.into());
        }
        information.fill_upper_triangle_with_lower_triangle();
        self.information = information;
        Ok(())
    }
}

/// Dᵀ (L Lᵀ)⁻¹ D for a D within the range of L; 0 for D = 0, whatever L is.
fn whitened_square<const N: usize>(
    noise: &SMatrix<f64, N, N>,
    turn: &SMatrix<f64, N, N>,
) -> Result<Covariance<N>, CramerRaoError> {
    if turn.amax() <= ROUNDING {
        return Ok(Covariance::zeros());
    }
    // A noiseless component leaves the triangle with a zero.
    let lower = triangle::lower_root([*noise]);
    let white = lower
        .solve_lower_triangular(turn)
        .filter(|white| white.iter().all(|v| v.is_finite()))
        .ok_or(CramerRaoError::Noiseless { difference: turn.amax() })?;
    Ok(white.transpose() * white)
}

/// F⁻¹ = Fᵀ T⁻ᵀ T⁻¹ with the lower triangular T, T Tᵀ = F Fᵀ.
fn inverse<const N: usize>(f: &SMatrix<f64, N, N>) -> Option<SMatrix<f64, N, N>> {
    let lower = triangle::lower_root([*f]);
    let left = lower.solve_lower_triangular(&SMatrix::identity())?;
    let inverse = f.transpose() * lower.tr_solve_lower_triangular(&left)?;
    inverse.iter().all(|v| v.is_finite()).then_some(inverse)
}
