use crate::{
    Observation,
    noise::log_add,
    parameter::{ParameterError, positive, require},
};

/// A Gaussian with a share of outliers, each component of which is spread evenly over its own
/// width: p(r) = (1 − ε) N(r; 0, R) + ε / Π wᵢ, the product over the components that are
/// present.
///
/// An outlier spoils the observation as a whole. A bearing's width is 2π, a level's the span of
/// levels that the receiver can report.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutlierMixture<const M: usize> {
    share: f64,
    widths: [f64; M],
    log_sound: f64,
    log_share: f64,
}

impl<const M: usize> OutlierMixture<M> {
    /// A mixture with the `share` ε in [0, 1) of outliers, spread over these widths, each in its
    /// component's unit.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] names the share that is not in [0, 1), or the width that is not positive
    /// and finite.
    pub fn new(share: f64, widths: [f64; M]) -> Result<Self, ParameterError> {
        require((0.0..1.0).contains(&share), "the share of outliers", share, "in [0, 1)")?;
        for width in widths {
            positive("the width of the outliers", width)?;
        }
        Ok(Self { share, widths, log_sound: libm::log1p(-share), log_share: libm::log(share) })
    }

    /// The share ε of outliers.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.share
    }

    /// The two parts of the mixture at an observation, given the Gaussian's log-density of it:
    /// the logarithms of (1 − ε) N and of ε / |Ω|. Their [`log_add`] is the mixture's
    /// log-density.
    #[must_use]
    pub fn log_parts(&self, gaussian: f64, observation: &Observation<M>) -> [f64; 2] {
        let present = self.widths.iter().enumerate().filter(|(i, _)| observation.has(*i));
        let support: f64 = present.map(|(_, width)| width).product();
        [self.log_sound + gaussian, self.log_share + -libm::log(support)]
    }

    /// The mixture's log-density at an observation, given the Gaussian's; 0 for an observation
    /// without components.
    #[must_use]
    pub fn log_density(&self, gaussian: f64, observation: &Observation<M>) -> f64 {
        if observation.is_empty() {
            return 0.0;
        }
        let [sound, outlier] = self.log_parts(gaussian, observation);
        log_add(sound, outlier)
    }
}

#[cfg(test)]
mod tests {
    use core::f64::consts::TAU;

    use nalgebra::{Matrix2, Vector2};

    use super::*;
    use crate::Pose;

    fn pair() -> Observation<2> {
        let noise = Matrix2::new(4.0, 0.0, 0.0, 0.01);
        Observation::new(0.0, Pose::default(), Vector2::zeros(), noise).expect("proper")
    }

    #[test]
    fn far_out_only_the_outliers_are_left() {
        let mixture = OutlierMixture::new(0.1, [60.0, TAU]).expect("in range");
        let far = mixture.log_density(-1e6, &pair());
        assert!((far - libm::log(0.1 / (60.0 * TAU))).abs() < 1e-12);
        let none = OutlierMixture::new(0.0, [60.0, TAU]).expect("in range");
        assert!((none.log_density(-3.0, &pair()) + 3.0).abs() < 1e-15);
    }

    #[test]
    fn between_the_two_parts_the_density_is_their_sum() {
        // (1 − ε) N = 0.75 · 2/3 and ε / |Ω| = 0.25 · 2, so that p = 1.
        let mixture = OutlierMixture::new(0.25, [0.5, 1.0]).expect("in range");
        let log = mixture.log_density(libm::log(2.0 / 3.0), &pair());
        assert!(log.abs() < 1e-15, "off by {log}");
    }

    #[test]
    fn a_missing_component_has_no_support() {
        let mixture = OutlierMixture::new(0.1, [60.0, TAU]).expect("in range");
        let bearing = mixture.log_density(-1e6, &pair().without(0));
        assert!((bearing - libm::log(0.1 / TAU)).abs() < 1e-12);
        let level = mixture.log_density(-1e6, &pair().without(1));
        assert!((level - libm::log(0.1 / 60.0)).abs() < 1e-12);
        assert!(mixture.log_density(0.0, &pair().without(0).without(1)).abs() <= 0.0);
    }

    #[test]
    fn what_is_no_mixture_is_refused() {
        for (share, width) in [(1.0, 1.0), (-0.1, 1.0), (f64::NAN, 1.0), (0.1, 0.0), (0.1, -1.0)] {
            assert!(OutlierMixture::new(share, [width]).is_err(), "{share}, {width}");
        }
        assert!(OutlierMixture::new(0.1, [1.0, f64::INFINITY]).is_err());
    }
}
