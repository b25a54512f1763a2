//! The posterior Cramér-Rao bound, and Fisher information by quadrature.

use core::{borrow::Borrow, f64::consts::TAU};

use foxhunt_core::{
    Axis, Covariance, Estimate, EstimatorError, MeasurementModel, MotionModel, Observation, Role,
    State,
    parameter::{positive, require},
};
use nalgebra::{SMatrix, SVector};

use crate::{Gaussian, count::number, triangle};

/// Largest difference between states that passes for rounding: numerical Jacobians.
const ROUNDING: f64 = 1e-6;

/// Tolerance of the likelihood's integral about 1.
const MASS_TOLERANCE: f64 = 1e-3;

/// Reason that there is no bound.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CramerRaoError {
    /// There is no trajectory to take an expectation over.
    #[error("there is no trajectory to take an expectation over")]
    NoTrajectories,
    /// The motion's noise depends on the state: the recursion is that of additive noise.
    #[error("the motion's noise differs between states by {difference} of its size")]
    StateDependentNoise {
        /// The largest difference of two factors, relative to the first.
        difference: f64,
    },
    /// The motion's Jacobian depends on the state in a component that has no noise.
    #[error("the noiseless direction of the motion changes with the state, by {difference}")]
    Noiseless {
        /// The largest element of what noise does not cover.
        difference: f64,
    },
    /// The motion maps different states onto one.
    #[error("the motion's Jacobian is singular")]
    SingularMotion,
    /// The likelihood is no density over the measurement, or the quadrature misses a part of it.
    #[error("the likelihood integrates to {mass} over the measurement, not to 1")]
    NotADensity {
        /// The likelihood's integral.
        mass: f64,
    },
    /// A model gave NaN or infinity, or the information has no inverse.
    #[error(transparent)]
    Estimator(#[from] EstimatorError),
}

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

impl<const N: usize> PosteriorCramerRao<N> {
    /// The bound before the first observation, with a Gaussian prior: J = P⁻¹.
    ///
    /// # Errors
    ///
    /// An error when the prior is not finite or its covariance not symmetric and positive definite.
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
    /// An error when there is no trajectory or a Jacobian is not finite. The bound is then left as
    /// it was.
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
    /// An error when there is no trajectory, or as [`FisherQuadrature::information`]. The bound is
    /// then left as it was.
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

/// The Fisher information of a measurement about the state by numerical integration, for any
/// likelihood: ∫ ∇ln p(z | x) ∇ln p(z | x)ᵀ p(z | x) dz (Van Trees 1968, §2.4.2), by the
/// midpoint rule over z and central differences over x.
///
/// An angle is integrated over its whole turn, a linear component over `reach` standard
/// deviations of the observation's noise to each side of what is expected. For a smooth density
/// that vanishes at its ends, or is periodic, the rule's error falls faster than any power of the
/// number of points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FisherQuadrature {
    points: u32,
    reach: f64,
}

impl FisherQuadrature {
    /// `points` along each component, and the reach in standard deviations.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when there are fewer than 8 points or the reach is not
    /// positive and finite.
    pub fn new(points: u32, reach: f64) -> Result<Self, EstimatorError> {
        require(points >= 8, "points", f64::from(points), "at least 8")?;
        Ok(Self { points, reach: positive("reach", reach)? })
    }

    /// The information of an observation of `observation`'s noise, pose and components, whatever
    /// its values, about the state `x`.
    ///
    /// # Errors
    ///
    /// [`CramerRaoError::NotADensity`] when the likelihood does not integrate to 1, to a
    /// thousandth; [`CramerRaoError::Estimator`] when the model gives NaN.
    pub fn information<const N: usize, const M: usize>(
        &self,
        model: &(impl MeasurementModel<N, M> + ?Sized),
        x: &State<N>,
        observation: &Observation<M>,
    ) -> Result<Covariance<N>, CramerRaoError> {
        let grid = Grid::new(self, model, x, observation);
        let mut information = Covariance::<N>::zeros();
        let mut mass = 0.0;
        let mut index = [0; M];
        loop {
            let at = grid.observation(observation, &index)?;
            let density = libm::exp(model.log_likelihood(x, &at)) * grid.volume;
            if density > 0.0 {
                let slope = score(model, x, &at);
                information += slope * (slope * density).transpose();
                mass += density;
            }
            if !grid.next(&mut index) {
                break;
            }
        }
        if !information.iter().all(|v| v.is_finite()) {
            return Err(EstimatorError::NotFinite { role: Role::Expected }.into());
        }
        if (mass - 1.0).abs() <= MASS_TOLERANCE {
            Ok(information)
        } else {
            Err(CramerRaoError::NotADensity { mass })
        }
    }
}

impl Default for FisherQuadrature {
    /// 512 points, 12 standard deviations.
    fn default() -> Self {
        Self { points: 512, reach: 12.0 }
    }
}

/// The midpoints over the components present.
struct Grid<const M: usize> {
    start: SVector<f64, M>,
    step: SVector<f64, M>,
    counts: [u32; M],
    volume: f64,
}

impl<const M: usize> Grid<M> {
    fn new<const N: usize>(
        quadrature: &FisherQuadrature,
        model: &(impl MeasurementModel<N, M> + ?Sized),
        x: &State<N>,
        observation: &Observation<M>,
    ) -> Self {
        let expected = model.expected(x, observation.receiver());
        let axes = model.axes();
        let noise = observation.noise();
        let width = SVector::<f64, M>::from_fn(|i, _| match axes[i] {
            Axis::Angle => TAU,
            Axis::Linear => 2.0 * quadrature.reach * libm::sqrt(noise[(i, i)]),
        });
        let counts =
            core::array::from_fn(|i| if observation.has(i) { quadrature.points } else { 1 });
        let step = SVector::from_fn(|i, _| width[i] / f64::from(counts[i]));
        let start = expected - (width - step) * 0.5;
        let present = (0..M).filter(|&i| observation.has(i));
        Self { start, step, counts, volume: present.map(|i| step[i]).product() }
    }

    fn observation(
        &self,
        like: &Observation<M>,
        index: &[u32; M],
    ) -> Result<Observation<M>, CramerRaoError> {
        let value = SVector::from_fn(|i, _| self.start[i] + f64::from(index[i]) * self.step[i]);
        let whole = Observation::new(like.time(), *like.receiver(), value, like.noise())
            .map_err(|_| EstimatorError::NotFinite { role: Role::Expected })?;
        Ok((0..M).filter(|&i| !like.has(i)).fold(whole, Observation::without))
    }

    /// The next midpoint; false after the last.
    fn next(&self, index: &mut [u32; M]) -> bool {
        for (i, count) in index.iter_mut().zip(&self.counts) {
            *i += 1;
            if *i < *count {
                return true;
            }
            *i = 0;
        }
        false
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

/// ∇ln p(z | x) by central differences.
fn score<const N: usize, const M: usize>(
    model: &(impl MeasurementModel<N, M> + ?Sized),
    x: &State<N>,
    at: &Observation<M>,
) -> State<N> {
    foxhunt_core::numeric_jacobian(
        x,
        |x| SVector::<f64, 1>::new(model.log_likelihood(x, at)),
        |a, b| a - b,
    )
    .transpose()
}

/// HᵀR⁻¹H: the information of Gaussian noise.
fn gaussian<const N: usize, const M: usize>(
    model: &(impl MeasurementModel<N, M> + ?Sized),
    x: &State<N>,
    observation: &Observation<M>,
) -> Option<Covariance<N>> {
    let slope = model.jacobian(x, observation.receiver());
    let slope = observation.strike(slope);
    let white = observation.noise().cholesky()?.unpack().solve_lower_triangular(&slope)?;
    let information = white.transpose() * white;
    information.iter().all(|v| v.is_finite()).then_some(information)
}

/// The number of samples as a divisor.
fn mean<const N: usize>(sum: Covariance<N>, count: usize) -> Result<Covariance<N>, CramerRaoError> {
    if count == 0 { Err(CramerRaoError::NoTrajectories) } else { Ok(sum / number(count)) }
}
