use core::f64::consts::{PI, TAU};

use foxhunt_core::{
    MeasurementModel, Observation, OutlierMixture, Pose, Quantity, State, angle, elementary,
    gaussian_log_likelihood, log_likelihoods_one_by_one,
    parameter::{self, ParameterError},
    vectorised::run,
};
use nalgebra::{SMatrix, Vector1};

use super::{Sight, columns::BearingResiduals, sight::differences};

/// The bearing alone, z = atan2(N, E) + μ (Isaacs et al. 2014, eq. 29), if need be with a share
/// of reflections that point anywhere (eq. 30).
///
/// The bias μ is part of `expected`, so every estimator takes it off. The outliers are part of
/// the likelihood only: a particle filter or a grid sees the whole mixture, a Kalman filter its
/// Gaussian part and needs a gate. σ is the observation's own.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BearingOnly {
    bias: f64,
    outliers: Option<OutlierMixture<1>>,
}

impl BearingOnly {
    /// The model without bias and without outliers.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// 19 % outliers and a bias of 0.0929 rad (Isaacs et al. 2014, eq. 30); its σ of 0.2468 rad
    /// belongs into the observations.
    #[must_use]
    pub fn isaacs2014() -> Self {
        Self { bias: 0.0929, outliers: OutlierMixture::new(0.19, [TAU]).ok() }
    }

    /// Sets the bias of bearings, in radians counter-clockwise of the truth.
    ///
    /// # Errors
    ///
    /// If the bias is not finite.
    pub fn with_bias(self, bias: f64) -> Result<Self, ParameterError> {
        Ok(Self { bias: parameter::finite("bias", bias)?, ..self })
    }

    /// Sets a share of bearings that point anywhere.
    ///
    /// # Errors
    ///
    /// If the share is not in [0, 1).
    pub fn with_outliers(self, share: f64) -> Result<Self, ParameterError> {
        Ok(Self { outliers: Some(OutlierMixture::new(share, [TAU])?), ..self })
    }
}

impl<const N: usize> MeasurementModel<N, 1> for BearingOnly {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::BEARING]
    }

    fn expected(&self, state: &State<N>, receiver: &Pose) -> Vector1<f64> {
        Vector1::new(angle::wrap(Sight::new(state, receiver, 0.0).bearing() + self.bias))
    }

    #[inline(always)]
    fn expected_change(
        &self,
        state: &State<N>,
        expected: &Vector1<f64>,
        offset: &State<N>,
        receiver: &Pose,
    ) -> Vector1<f64> {
        let [odd, even] = self.expected_parts(state, expected, offset, receiver);
        odd + even
    }

    /// Computes them from the changes of range and bearing, where these are plain: no large numbers
    /// are subtracted.
    #[inline(always)]
    fn expected_parts(
        &self,
        state: &State<N>,
        expected: &Vector1<f64>,
        offset: &State<N>,
        receiver: &Pose,
    ) -> [Vector1<f64>; 2] {
        match Sight::new(state, receiver, 0.0).parts(offset[0], offset[1]) {
            Some((_, turns)) => turns.map(Vector1::new),
            None => differences(self, *state, *expected, *offset, receiver),
        }
    }

    fn jacobian(&self, state: &State<N>, receiver: &Pose) -> SMatrix<f64, 1, N> {
        let sight = Sight::new(state, receiver, 0.0);
        let mut jacobian = SMatrix::<f64, 1, N>::zeros();
        [jacobian[(0, 0)], jacobian[(0, 1)]] = sight.bearing_slope();
        jacobian
    }

    fn residuals(
        &self,
        columns: [&[f64]; N],
        z: &Vector1<f64>,
        receiver: &Pose,
        [out]: [&mut [f64]; 1],
    ) {
        let places = [columns[0], columns[1]];
        let bearing = angle::wrap(z[0] - self.bias);
        run(BearingResiduals { places, receiver, bearing, out });
    }

    fn log_likelihood(&self, state: &State<N>, observation: &Observation<1>) -> f64 {
        let gaussian = gaussian_log_likelihood(self, state, observation);
        match &self.outliers {
            Some(outliers) if !observation.is_empty() => {
                outliers.log_density(gaussian, observation)
            }
            _ => gaussian,
        }
    }

    #[inline(always)]
    fn log_likelihoods(&self, columns: [&[f64]; N], observation: &Observation<1>, out: &mut [f64]) {
        if !observation.is_plain() || observation.is_empty() {
            return log_likelihoods_one_by_one(self, columns, observation, out);
        }
        let place = observation.receiver().position;
        let bearing = angle::wrap(observation.value()[0] - self.bias);
        let slope = -0.5 / observation.noise()[(0, 0)];
        let square = |east: f64, north: f64| {
            let off = bearing - elementary::atan2(north - place.y, east - place.x);
            let off = if off > PI { off - TAU } else { off };
            let off = if off < -PI { off + TAU } else { off };
            off * off
        };
        let peak = observation.log_density(&Vector1::zeros());
        let places = out.iter_mut().zip(columns[0]).zip(columns[1]);
        match self.outliers.filter(|outliers| outliers.share() > 0.0) {
            Some(outliers) => {
                let [peak, even] = outliers.log_parts(peak, observation).map(libm::exp);
                for ((out, east), north) in places {
                    let normal = peak * elementary::exp(slope * square(*east, *north));
                    *out = elementary::ln(normal + even);
                }
            }
            None => {
                for ((out, east), north) in places {
                    *out = peak + slope * square(*east, *north);
                }
            }
        }
    }
}
