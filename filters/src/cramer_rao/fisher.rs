use core::f64::consts::TAU;

use foxhunt_core::{
    Axis, Covariance, EstimatorError, MeasurementModel, Observation, Role, State,
    parameter::{positive, require},
};
use nalgebra::SVector;

use super::CramerRaoError;
use crate::count::number;

/// The Fisher information of a measurement about the state by numerical integration, for any
/// likelihood: ∫ ∇ln p(z | x) ∇ln p(z | x)ᵀ p(z | x) dz (Van Trees 1968, §2.4.2), by the midpoint
/// rule over z and central differences over x.
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

/// Tolerance of the likelihood's integral about 1.
const MASS_TOLERANCE: f64 = 1e-3;

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

/// HᵀR⁻¹H: the information of Gaussian noise.
pub(super) fn gaussian<const N: usize, const M: usize>(
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
pub(super) fn mean<const N: usize>(
    sum: Covariance<N>,
    count: usize,
) -> Result<Covariance<N>, CramerRaoError> {
    if count == 0 { Err(CramerRaoError::NoTrajectories) } else { Ok(sum / number(count)) }
}
