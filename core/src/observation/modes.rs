use super::Observation;
use crate::BearingModes;

impl<const M: usize> Observation<M> {
    /// Makes `component` a bearing that several directions compete for; without competition nothing
    /// changes. It takes their moments, and its noise is uncorrelated with the other components'.
    ///
    /// # Panics
    ///
    /// If there is no such component, or it is missing.
    #[must_use]
    pub fn with_bearing_modes(mut self, component: usize, modes: BearingModes) -> Self {
        let Some((mean, sigma)) = modes.moments() else { return self };
        assert!(self.present[component], "a bearing that is missing has no directions");
        self.value[component] = mean;
        self.noise.row_mut(component).fill(0.0);
        self.noise.column_mut(component).fill(0.0);
        self.noise[(component, component)] = sigma * sigma;
        self.root = self.factor();
        self.modes = Some((component, modes));
        self
    }

    /// The component that is a bearing that several directions compete for, and the directions.
    #[must_use]
    pub fn bearing_modes(&self) -> Option<(usize, &BearingModes)> {
        self.modes.as_ref().map(|(component, modes)| (*component, modes))
    }

    /// The component for which directions compete, if any, and its bearing alone, as their mixture
    /// and by its moments. A filter that has conditioned on the moments has to correct by the ratio
    /// of the two likelihoods.
    #[must_use]
    pub fn competing_bearing(&self) -> Option<(usize, [Self; 2])> {
        let (bearing, _) = self.modes?;
        let others = (0..M).filter(|component| *component != bearing);
        let mixture = others.fold(*self, Self::without);
        Some((bearing, [mixture, Self { modes: None, ..mixture }]))
    }

    /// The observations that it may be, each with its weight: one for each direction that
    /// competes, or itself.
    pub fn hypotheses(&self) -> impl Iterator<Item = (f64, Self)> + '_ {
        let alone = self.modes.is_none().then_some((1.0, *self));
        let modes =
            self.modes.iter().flat_map(|(c, modes)| modes.as_slice().iter().map(|m| (*c, m)));
        alone.into_iter().chain(modes.map(|(component, mode)| {
            let mut one = Self { modes: None, ..*self };
            one.value[component] = mode.angle;
            one.noise[(component, component)] = mode.sigma * mode.sigma;
            one.root = one.factor();
            (mode.weight, one)
        }))
    }

    /// Returns true if one Gaussian describes it, whatever the state: the receiver's place is known
    /// and nothing competes for a bearing.
    #[must_use]
    pub fn is_plain(&self) -> bool {
        self.receiver_sigma.is_none() && self.modes.is_none()
    }

    pub(super) fn with_mode_sigmas(mut self, component: usize, sigma: impl Fn(f64) -> f64) -> Self {
        if let Some((bearing, modes)) = self.modes.filter(|(bearing, _)| *bearing == component) {
            self.modes = Some((bearing, modes.with_sigma(sigma)));
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use approx::{abs_diff_eq, assert_abs_diff_eq};
    use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

    use super::*;
    use crate::{BearingMode, Pose};

    fn modes() -> BearingModes {
        let near = BearingMode { weight: 0.7, angle: 0.4, sigma: 0.1 };
        let far = BearingMode { weight: 0.3, angle: 1.4, sigma: 0.2 };
        BearingModes::new(&[near, far]).expect("proper")
    }

    fn pair() -> Observation<2> {
        let noise = Matrix2::new(4.0, 0.05, 0.05, 0.01);
        Observation::new(0.0, Pose::default(), Vector2::new(-60.0, 0.4), noise)
            .expect("proper")
            .with_bearing_modes(1, modes())
    }

    #[test]
    fn it_is_the_mixture_of_its_hypotheses() {
        let pair = pair();
        let (mean, sigma) = modes().moments().expect("two");
        assert_abs_diff_eq!(pair.value()[1], mean, epsilon = 1e-15);
        assert!((pair.noise() - Matrix2::new(4.0, 0.0, 0.0, sigma * sigma)).norm() < 1e-12);
        let total: f64 = pair.hypotheses().map(|(weight, _)| weight).sum();
        assert_abs_diff_eq!(total, 1.0, epsilon = 1e-15);
        let (weight, far) = pair.hypotheses().nth(1).expect("two");
        assert!(abs_diff_eq!(weight, 0.3, epsilon = 1e-15) && far.is_plain());
        assert!((far.value() - Vector2::new(-60.0, 1.4)).norm() < 1e-15);
        assert!((far.noise() - Matrix2::new(4.0, 0.0, 0.0, 0.04)).norm() < 1e-15);
        let alone = far.hypotheses().map(|(_, one)| one).next().expect("itself");
        assert_eq!(alone, far);
    }

    #[test]
    fn modes_go_with_their_bearing() {
        let pair = pair();
        assert!(pair.without(1).is_plain() && !pair.without(0).is_plain());
        let bearing: Observation<1> = pair.marginal(1);
        assert_eq!(bearing.bearing_modes(), Some((0, &modes())));
        assert!(pair.marginal::<1>(0).is_plain());
        let scaled = pair.with_noise_scaled(1, 3.0);
        let (_, scaled) = scaled.hypotheses().next().expect("two");
        assert_abs_diff_eq!(scaled.noise()[(1, 1)], 0.09, epsilon = 1e-12);
        let wider = pair.with_more_noise(&Matrix2::new(0.0, 0.0, 0.3, 0.0));
        let (_, wider) = wider.hypotheses().next().expect("two");
        assert_abs_diff_eq!(wider.noise()[(1, 1)], 0.10, epsilon = 1e-12);
        let three = Observation::new(0.0, Pose::default(), Vector3::zeros(), Matrix3::identity());
        let three = three.expect("proper").with_bearing_modes(2, modes());
        assert_eq!(three.marginal::<2>(1).bearing_modes(), Some((1, &modes())));
    }
}
