use foxhunt_core::{Axis, EstimatorError, MeasurementModel, Observation, State};
use nalgebra::{SMatrix, SVector};

use super::{iterations::Iterations, models::AtReceiver, regression::Regression};
use crate::{Gaussian, Image, Transform, count::number};

/// A step is halved at most this often: to a 256th.
const HALVINGS: u32 = 8;

/// Largest rise of J that a step may cause, in units of χ²: where the regression is at rest over
/// sigma points, J is not quite at its least, and must not hold it back.
const ROOM: f64 = 0.1;

/// Advantage (nats) over the last posterior that an earlier one needs to be preferred: the images
/// that give the free energy are themselves not exact.
const SLACK: f64 = 0.5;

/// The update of a prior N(x̂, L₀ L₀ᵀ), linearised about any Gaussian: statistical linear
/// regression (García-Fernández, Svensson, Morelande & Särkkä 2015).
///
/// About N(m, L Lᵀ) with the [`Image`] (z̄, V, W) the measurement is z ≈ A x + b + e, e ~ N(0, Ω),
/// with A = Vᵀ L⁻¹, b = z̄ − A m, and Ω = W Wᵀ as it stands. Under the prior this is again an
/// image, of the mean z̄ + A (x̂ − m), the whitened cross-covariance L₀ᵀ Aᵀ, and the same W; so
/// gain, missing components and posterior are as in every other update.
pub(super) struct Linearisation<'a, T, H, const N: usize, const M: usize> {
    pub(super) transform: &'a T,
    pub(super) measurement: &'a H,
    pub(super) axes: [Axis; N],
    pub(super) prior: &'a Gaussian<N>,
    pub(super) observation: &'a Observation<M>,
}

impl<T, H, const N: usize, const M: usize> Linearisation<'_, T, H, N, M>
where
    T: Transform,
    H: MeasurementModel<N, M>,
{
    /// The regression about the prior.
    pub(super) fn about_prior(&self) -> Regression<N, M> {
        let (image, residual) = self.moments(self.prior);
        Regression::new(&image, residual, self.observation)
    }

    /// The posterior about the last of the centres, and the log-evidence of the regression that led
    /// to it; `textbook` is the one about the prior, by the regression `first`.
    ///
    /// Its mean is a Gauss-Newton step from the centre N(m, P) on
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
    pub(super) fn iterate(
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
