//! The Kalman filters: their models as maps between vector spaces, and the linearisation of these
//! about one belief after another.

mod belief;
mod filter;
mod gate;

use foxhunt_core::{
    Axis, EstimatorError, MeasurementModel, MotionModel, Observation, Pose, Role, State,
    noise::{self, LogProduct},
    parameter::{not_negative, require},
};
use nalgebra::{SMatrix, SVector};

use crate::{
    Gaussian, Image, Innovation, Map, Transform,
    count::number,
    triangle::{self, Conditioned},
};

pub use filter::{Ckf, Ekf, Kalman, Ukf};
#[cfg(all(feature = "alloc", target_has_atomic = "ptr"))]
pub(crate) use gate::Record;
pub use gate::{Gate, GateLimit};

/// A step is halved at most this often: to a 256th.
const HALVINGS: u32 = 8;

/// Largest rise of J that a step may cause, in units of χ²: where the regression is at rest over
/// sigma points, J is not quite at its least, and must not hold it back.
const ROOM: f64 = 0.1;

/// Advantage (nats) over the last posterior that an earlier one needs to be preferred: the images
/// that give the free energy are themselves not exact.
const SLACK: f64 = 0.5;

/// Limits to the linearisations of an update, each about the posterior of the previous one.
///
/// ```
/// # use foxhunt_filters::Iterations;
/// # fn main() -> Result<(), foxhunt_core::EstimatorError> {
/// let iterations = Iterations::at_most(10)?.with_tolerance(1e-6)?;
/// assert_eq!(iterations.max(), 10);
/// assert_eq!(Iterations::once().max(), 1);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Iterations {
    max: u32,
    tolerance: f64,
}

impl Iterations {
    /// About the prior, and that is all: the textbook's update.
    #[must_use]
    pub const fn once() -> Self {
        Self { max: 1, tolerance: 1e-3 }
    }

    /// At most `max` linearisations, fewer when two posteriors in a row differ by less than 10⁻³
    /// nats, which is a shift of 0.045 standard deviations.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when `max` is not in 1..=1000: what has not come to rest by
    /// then goes round in circles.
    pub fn at_most(max: u32) -> Result<Self, EstimatorError> {
        require((1..=1000).contains(&max), "iterations", f64::from(max), "in 1..=1000")?;
        Ok(Self { max, ..Self::once() })
    }

    /// Sets the tolerance: the Kullback-Leibler divergence in nats of a posterior from the one
    /// before it, below which there is no further iteration.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when it is negative or not finite.
    pub fn with_tolerance(self, tolerance: f64) -> Result<Self, EstimatorError> {
        Ok(Self { tolerance: not_negative("iteration tolerance", tolerance)?, ..self })
    }

    /// The most linearisations of one update.
    #[must_use]
    pub const fn max(&self) -> u32 {
        self.max
    }

    /// The divergence, in nats, that ends the iteration.
    #[must_use]
    pub const fn tolerance(&self) -> f64 {
        self.tolerance
    }
}

impl Default for Iterations {
    /// [`Iterations::once`].
    fn default() -> Self {
        Self::once()
    }
}

/// f(·, Δt).
struct OverTime<'a, F, const N: usize> {
    motion: &'a F,
    axes: [Axis; N],
    dt: f64,
}

impl<'a, F: MotionModel<N>, const N: usize> OverTime<'a, F, N> {
    fn new(motion: &'a F, dt: f64) -> Self {
        Self { motion, axes: motion.axes(), dt }
    }
}

impl<F: MotionModel<N>, const N: usize> Map<N, N> for OverTime<'_, F, N> {
    #[inline(always)]
    fn value(&self, x: &State<N>) -> State<N> {
        self.motion.propagate(x, self.dt)
    }

    #[inline(always)]
    fn jacobian(&self, x: &State<N>) -> SMatrix<f64, N, N> {
        self.motion.jacobian(x, self.dt)
    }

    #[inline(always)]
    fn minus(&self, y: &State<N>, z: &State<N>) -> State<N> {
        Axis::difference(&self.axes, y, z)
    }

    #[inline(always)]
    fn change(&self, x: &State<N>, image: &State<N>, offset: &State<N>) -> State<N> {
        self.motion.propagated_change(x, image, offset, self.dt)
    }
}

/// h(·; pose).
struct AtReceiver<'a, H>(&'a H, &'a Pose);

impl<H: MeasurementModel<N, M>, const N: usize, const M: usize> Map<N, M> for AtReceiver<'_, H> {
    #[inline(always)]
    fn value(&self, x: &State<N>) -> SVector<f64, M> {
        self.0.expected(x, self.1)
    }

    #[inline(always)]
    fn jacobian(&self, x: &State<N>) -> SMatrix<f64, M, N> {
        self.0.jacobian(x, self.1)
    }

    #[inline(always)]
    fn minus(&self, y: &SVector<f64, M>, z: &SVector<f64, M>) -> SVector<f64, M> {
        self.0.residual(y, z)
    }

    #[inline(always)]
    fn change(&self, x: &State<N>, image: &SVector<f64, M>, offset: &State<N>) -> SVector<f64, M> {
        self.0.expected_change(x, image, offset, self.1)
    }

    #[inline(always)]
    fn parts(
        &self,
        x: &State<N>,
        image: &SVector<f64, M>,
        offset: &State<N>,
    ) -> [SVector<f64, M>; 2] {
        self.0.expected_parts(x, image, offset, self.1)
    }
}

/// The regression of the state on one observation, in square roots.
///
/// With G Gᵀ = R + W Wᵀ and x = x̂ + L ξ, ξ ~ N(0, I), the observation is G⁻¹ y = B ξ
/// plus white noise, B = G⁻¹ Vᵀ; and the covariance of y is S = R + W Wᵀ + Vᵀ V = G (I + B
/// Bᵀ) Gᵀ. No square is subtracted and S is never formed.
///
/// Missing components are struck out of V, W and y, and stand in R as a unit row.
#[derive(Clone, Copy)]
struct Regression<const N: usize, const M: usize> {
    whitened_cross: SMatrix<f64, N, M>,
    /// G, lower triangular: the noise, and what the regression does not explain.
    unexplained: SMatrix<f64, M, M>,
    expected: SVector<f64, M>,
    residual: SVector<f64, M>,
    /// ξ, given y.
    known: Conditioned<N>,
    dof: usize,
}

impl<const N: usize, const M: usize> Regression<N, M> {
    /// `residual` is z ⊖ `image.mean`.
    fn new(image: &Image<N, M>, residual: SVector<f64, M>, observation: &Observation<M>) -> Self {
        let Image { mean: expected, whitened_cross, unexplained: left } = *image;
        let residual = observation.strike(residual);
        let whitened_cross = observation.mask(whitened_cross);
        let left = observation.strike(left);

        // A straight map leaves nothing but the noise.
        let unexplained = match left == SMatrix::<f64, M, M>::zeros() {
            true => *observation.noise_factor(),
            false => triangle::lower_root([*observation.noise_factor(), left]),
        };
        let white = triangle::solve_lower(&unexplained, residual);
        let slope = triangle::solve_lower(&unexplained, whitened_cross.transpose());
        let known = Conditioned::on(slope, white);
        let dof = observation.len();
        Self { whitened_cross, unexplained, expected, residual, known, dof }
    }

    /// Refuses what was made of numbers that are not finite, or without noise.
    fn check(&self) -> Result<(), EstimatorError> {
        // Every number goes into this square, and what is not finite makes it so.
        if self.known.square.is_finite() {
            return Ok(());
        }
        let least = (0..M).map(|i| self.unexplained[(i, i)]).fold(f64::INFINITY, f64::min);
        let sum = triangle::nan_unless_finite(&self.residual)
            + triangle::nan_unless_finite(&self.whitened_cross)
            + triangle::nan_unless_finite(&self.unexplained);
        refuse(sum.is_nan(), least)
    }

    fn nis(&self) -> f64 {
        self.known.square
    }

    /// ln N(y; 0, S).
    fn log_evidence(&self) -> f64 {
        let mut root = LogProduct::default();
        (0..M).for_each(|i| root.multiply(self.unexplained[(i, i)]));
        (0..N).for_each(|i| root.multiply(self.known.roots[i]));
        noise::log_density(self.nis(), root.log(), self.dof)
    }

    /// Another residual's square in the metric of what is not explained: rᵀ (R + W Wᵀ)⁻¹ r.
    fn misfit(&self, residual: &SVector<f64, M>, observation: &Observation<M>) -> f64 {
        let residual = observation.strike(*residual);
        self.unexplained.solve_lower_triangular_unchecked(&residual).norm_squared()
    }

    fn innovation(&self) -> Innovation<M> {
        let explained = self.whitened_cross.tr_mul(&self.whitened_cross);
        let mut covariance = triangle::square(&self.unexplained) + explained;
        covariance.fill_upper_triangle_with_lower_triangle();
        let Self { residual, expected, .. } = *self;
        Innovation { residual, expected, covariance, nis: self.nis() }
    }

    /// The posterior's mean x̂ + L E[ξ] and factor L T D^-½, one form for all transforms: with
    /// the covariance T D⁻¹ Tᵀ of ξ it is, by Woodbury's identity,
    ///
    /// P⁺ = P − Pxz S⁻¹ Pxzᵀ = L (I + Bᵀ B)⁻¹ Lᵀ = L T D⁻¹ Tᵀ Lᵀ;
    ///
    /// lower triangular with a positive diagonal whatever was measured.
    fn posterior(&self, prior: &Gaussian<N>) -> (SVector<f64, N>, SMatrix<f64, N, N>) {
        let mut factor = triangle::product(prior.factor(), &self.known.factor);
        for (mut column, root) in factor.column_iter_mut().zip(self.known.roots.iter()) {
            column /= *root;
        }
        (prior.mean() + prior.factor() * self.known.mean, factor)
    }
}

/// The update of a prior N(x̂, L₀ L₀ᵀ), linearised about any Gaussian: statistical linear
/// regression (García-Fernández, Svensson, Morelande & Särkkä 2015).
///
/// About N(m, L Lᵀ) with the [`Image`] (z̄, V, W) the measurement is z ≈ A x + b + e, e ~ N(0,
/// Ω), with A = Vᵀ L⁻¹, b = z̄ − A m, and Ω = W Wᵀ as it stands. Under the prior this
/// is again an image, of the mean z̄ + A (x̂ − m), the whitened cross-covariance L₀ᵀ Aᵀ,
/// and the same W; so gain, missing components and posterior are as in every other update.
struct Linearisation<'a, T, H, const N: usize, const M: usize> {
    transform: &'a T,
    measurement: &'a H,
    axes: [Axis; N],
    prior: &'a Gaussian<N>,
    observation: &'a Observation<M>,
}

impl<T, H, const N: usize, const M: usize> Linearisation<'_, T, H, N, M>
where
    T: Transform,
    H: MeasurementModel<N, M>,
{
    /// The regression about the prior.
    fn about_prior(&self) -> Regression<N, M> {
        let (image, residual) = self.moments(self.prior);
        Regression::new(&image, residual, self.observation)
    }

    /// Returns the posterior about the last of the centres, and the log-evidence of the regression
    /// that led to it; `textbook` is the posterior about the prior, by the regression `first`.
    ///
    /// The posterior's mean is a Gauss-Newton step from the centre N(m, P) on
    ///
    /// J(m) = |m ⊖ x̂|² in the metric of the prior + |z ⊖ z̄(m)|² in that of R + Ω,
    ///
    /// z̄(m) being the image's mean at the spread of the centre; under
    /// [`Taylor`](crate::Taylor) J / 2 is −ln p(x | z) up to a constant, and the iteration the
    /// iterated extended filter (Bell & Cathey 1993). A step that raises J is halved until it
    /// does not (Raitoharju, Svensson, García-Fernández & Piché 2018), so that none runs away.
    ///
    /// Near a receiver a bearing is explained by a ray of places, and the linearised posterior
    /// there shrinks with the range for ever. So the last posterior is kept only if none before
    /// it fits the exact one better, by [`SLACK`] of its free energy. Nor does an iteration fail
    /// where the textbook's update does not: it ends.
    #[inline(never)]
    fn iterate(
        &self,
        first: &Regression<N, M>,
        textbook: Gaussian<N>,
        iterations: Iterations,
    ) -> Result<(Gaussian<N>, f64), EstimatorError> {
        let mut best = (textbook, first.log_evidence());
        let mut least = f64::INFINITY;
        let mut centre = *self.prior;
        let mut regression = *first;
        let mut full = textbook;
        let mut left = iterations.max();
        loop {
            let settled = self.divergence(&full, &centre) <= iterations.tolerance();
            let posterior = self.damped(&centre, &regression, &full)?;
            let (image, residual) = self.moments(&posterior);
            let energy = self.free_energy(&posterior, &image, &residual);
            let reached = (posterior, regression.log_evidence());
            if energy < least {
                (best, least) = (reached, energy);
            }
            left -= 1;
            // Where the model has no numbers there is no going on.
            if settled || left == 0 || !energy.is_finite() {
                let kept = energy <= least + SLACK;
                return Ok(if kept { reached } else { best });
            }
            let next = self.about(&posterior, &image, &residual);
            if next.check().is_err() {
                return Ok(best);
            }
            let Ok(onward) = self.posterior(&next) else { return Ok(best) };
            (centre, regression, full) = (posterior, next, onward);
        }
    }

    /// Returns the image about a centre, and the observation's difference from its mean.
    #[inline(never)]
    fn moments(&self, centre: &Gaussian<N>) -> (Image<N, M>, SVector<f64, M>) {
        let map = AtReceiver(self.measurement, self.observation.receiver());
        let image = self.transform.image(centre, &map);
        let residual = self.measurement.residual(self.observation.value(), &image.mean);
        (image, residual)
    }

    /// The regression about a centre with this image and residual.
    #[inline(never)]
    fn about(
        &self,
        centre: &Gaussian<N>,
        image: &Image<N, M>,
        residual: &SVector<f64, M>,
    ) -> Regression<N, M> {
        let back = Axis::difference(&self.axes, self.prior.mean(), centre.mean());
        let factor = centre.factor();
        let spread: SMatrix<f64, N, N> =
            factor.solve_lower_triangular_unchecked(self.prior.factor());
        let shift = image.whitened_cross.tr_mul(&factor.solve_lower_triangular_unchecked(&back));
        let image = Image {
            mean: image.mean + shift,
            whitened_cross: spread.tr_mul(&image.whitened_cross),
            unexplained: image.unexplained,
        };
        // Wrapped where z̄ is; what the straight line adds may well be more than half a turn.
        Regression::new(&image, residual - shift, self.observation)
    }

    fn posterior(&self, regression: &Regression<N, M>) -> Result<Gaussian<N>, EstimatorError> {
        let (mean, factor) = regression.posterior(self.prior);
        Gaussian::from_factor(mean, factor, &self.axes)
    }

    /// The posterior as far from the centre as J does not rise, but for [`ROOM`].
    fn damped(
        &self,
        centre: &Gaussian<N>,
        regression: &Regression<N, M>,
        posterior: &Gaussian<N>,
    ) -> Result<Gaussian<N>, EstimatorError> {
        let at = |mean: State<N>, spread: &Gaussian<N>| {
            Gaussian::from_factor(mean, *spread.factor(), &self.axes)
        };
        let cost = |candidate: &Gaussian<N>| {
            let away = Axis::difference(&self.axes, candidate.mean(), self.prior.mean());
            let white = self.prior.factor().solve_lower_triangular_unchecked(&away);
            let residual = self.moments(candidate).1;
            white.norm_squared() + regression.misfit(&residual, self.observation)
        };
        let (highest, step) =
            (cost(centre), Axis::difference(&self.axes, posterior.mean(), centre.mean()));
        let mut share = 1.0;
        for _ in 0..=HALVINGS {
            let mean = centre.mean() + step * share;
            if cost(&at(mean, centre)?) <= highest + ROOM {
                return at(mean, posterior);
            }
            share *= 0.5;
        }
        at(*centre.mean(), posterior)
    }

    /// The Kullback-Leibler divergence of `new` from `old`, in nats; with X = L_old⁻¹ L_new and
    /// the whitened shift w of the mean it is ½ (|X|² − n − ln |X Xᵀ| + |w|²).
    fn divergence(&self, new: &Gaussian<N>, old: &Gaussian<N>) -> f64 {
        let ratio = old.factor().solve_lower_triangular_unchecked(new.factor());
        let shift = Axis::difference(&self.axes, new.mean(), old.mean());
        let white = old.factor().solve_lower_triangular_unchecked(&shift);
        let log_root: f64 = ratio.diagonal().iter().map(|d| libm::log(*d)).sum();
        0.5 * (ratio.norm_squared() - number(N) + white.norm_squared()) - log_root
    }

    /// E_q[−ln p(x, z)] − H(q), up to a constant: what is least where q is nearest to the exact
    /// posterior in divergence (Blei, Kucukelbir & McAuliffe 2017), with the moments of z under q
    /// from its image.
    fn free_energy(&self, q: &Gaussian<N>, image: &Image<N, M>, residual: &SVector<f64, M>) -> f64 {
        let prior = self.prior.factor();
        let away = Axis::difference(&self.axes, q.mean(), self.prior.mean());
        let white = prior.solve_lower_triangular_unchecked(&away);
        let ratio = prior.solve_lower_triangular_unchecked(q.factor());

        let at_zero = self.observation.log_density(&SVector::zeros());
        let half_square = |r: SVector<f64, M>| at_zero - self.observation.log_density(&r);
        let explained = image.whitened_cross.row_iter().map(|row| half_square(row.transpose()));
        let left = image.unexplained.column_iter().map(|c| half_square(c.into_owned()));
        let misfit = half_square(*residual) + explained.sum::<f64>() + left.sum::<f64>();

        let log_root: f64 = ratio.diagonal().iter().map(|d| libm::log(*d)).sum();
        0.5 * (white.norm_squared() + ratio.norm_squared()) + misfit - log_root
    }
}

/// Returns the reason that there is no innovation, `Ok` if only its square is too large.
#[cold]
#[inline(never)]
fn refuse(not_finite: bool, least_root: f64) -> Result<(), EstimatorError> {
    if not_finite {
        return Err(EstimatorError::NotFinite { role: Role::Expected });
    }
    if least_root <= 0.0 {
        return Err(EstimatorError::NotPositiveDefinite { role: Role::Innovation });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_out_of_range_are_refused() {
        assert!(Iterations::at_most(0).is_err() && Iterations::at_most(1001).is_err());
        for tolerance in [-1e-9, f64::NAN, f64::INFINITY] {
            assert!(Iterations::once().with_tolerance(tolerance).is_err(), "{tolerance}");
        }
        assert_eq!(Iterations::at_most(1), Ok(Iterations::once()));
    }
}
