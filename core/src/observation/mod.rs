//! Measurements: numbers, their noise, and the marks of missing ones.

mod modes;

use nalgebra::{SMatrix, SVector, Vector3};

use crate::{BearingModes, Covariance, Pose, noise};

/// Reason for refusing an observation.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ObservationError {
    /// The time is NaN or infinite.
    #[error("the time of the observation is {time}, not a finite number")]
    Time {
        /// The time.
        time: f64,
    },
    /// The receiver's pose holds NaN or infinity.
    #[error("the receiver's pose is not finite: {pose:?}")]
    Receiver {
        /// The receiver's pose.
        pose: Pose,
    },
    /// A component is NaN or infinite.
    #[error("component {component} of the observation is {value}, not a finite number")]
    Value {
        /// Index of the component.
        component: usize,
        /// Value of the component.
        value: f64,
    },
    /// A component's variance is not positive and finite.
    #[error("the variance of component {component} is {variance}, not a positive number")]
    Variance {
        /// Index of the component.
        component: usize,
        /// The variance.
        variance: f64,
    },
    /// A standard deviation of the receiver's own place is negative or not finite.
    #[error(
        "the standard deviation of the receiver's place is {sigma} m; it must be zero or positive"
    )]
    ReceiverSigma {
        /// The standard deviation, in metres.
        sigma: f64,
    },
    /// A bearing that directions compete for is missing, or is no component at all.
    #[error("component {component} has competing directions, but no value")]
    NoBearing {
        /// Index of the component.
        component: usize,
    },
    /// The covariance has not as many rows and columns as there are components.
    #[error("the covariance of {components} components has {rows} rows and {columns} columns")]
    Size {
        /// Number of components.
        components: usize,
        /// Rows of the covariance.
        rows: usize,
        /// Columns of the covariance.
        columns: usize,
    },
    /// The covariance is not symmetric and positive definite.
    #[error("the covariance of the observation is not symmetric and positive definite")]
    Covariance,
}

impl ObservationError {
    /// Checks what observations of every size have: a time, a receiver, and values with variances.
    pub(crate) fn check(
        time: f64,
        receiver: &Pose,
        components: impl Iterator<Item = (f64, f64)>,
    ) -> Result<(), Self> {
        if !time.is_finite() {
            return Err(Self::Time { time });
        }
        if !receiver.is_finite() {
            return Err(Self::Receiver { pose: *receiver });
        }
        for (component, (value, variance)) in components.enumerate() {
            if !value.is_finite() {
                return Err(Self::Value { component, value });
            }
            if !(variance > 0.0 && variance.is_finite()) {
                return Err(Self::Variance { component, variance });
            }
        }
        Ok(())
    }

    /// Checks the standard deviations of a receiver's own place.
    pub(crate) fn check_receiver_sigma(sigma: &Vector3<f64>) -> Result<(), Self> {
        match sigma.iter().find(|s| !(**s >= 0.0 && s.is_finite())) {
            Some(&sigma) => Err(Self::ReceiverSigma { sigma }),
            None => Ok(()),
        }
    }
}

/// `M` numbers measured by one receiver at one time, each with its own noise, any of them
/// missing.
///
/// A component may also be *below a limit*: the receiver got no answer, so the level lay
/// below its floor. Such a component is missing where residuals are used; a likelihood
/// may use the limit ([`upper_limit`](Self::upper_limit)).
///
/// A bearing may be one of several ([`with_bearing_modes`](Self::with_bearing_modes)). Its value
/// and noise are then the moments of all of them, where residuals are used, and a
/// likelihood is that of the mixture.
///
/// The noise covariance travels with the numbers, because it differs at every step: a bearing's
/// σ is what the extractor made of that very sweep. It is factored once, here.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "Parts<M>"))]
#[cfg_attr(feature = "serde", serde(into = "Parts<M>"))]
pub struct Observation<const M: usize> {
    time: f64,
    receiver: Pose,
    value: SVector<f64, M>,
    noise: Covariance<M>,
    root: SMatrix<f64, M, M>,
    present: [bool; M],
    below: [bool; M],
    receiver_sigma: Option<Vector3<f64>>,
    /// The component that is a bearing that several directions compete for, and the directions.
    modes: Option<(usize, BearingModes)>,
}

impl<const M: usize> Observation<M> {
    /// An observation with every component present.
    ///
    /// # Errors
    ///
    /// Names the time, the pose or the first component that is not finite, or whose variance is
    /// not positive; or the covariance as a whole, where it is not symmetric (to 1e-9 of its norm)
    /// and positive definite.
    pub fn new(
        time: f64,
        receiver: Pose,
        value: SVector<f64, M>,
        noise: Covariance<M>,
    ) -> Result<Self, ObservationError> {
        let variances = (0..M).map(|i| noise[(i, i)]);
        ObservationError::check(time, &receiver, value.iter().copied().zip(variances))?;
        // The factor is that of the lower triangle; NaN in the upper one is no symmetry either.
        let symmetric = (noise - noise.transpose()).norm() <= 1e-9 * noise.norm();
        let root = noise.cholesky().filter(|_| symmetric);
        let root = root.ok_or(ObservationError::Covariance)?.unpack();
        let present = [true; M];
        let below = [false; M];
        let receiver_sigma = None;
        let modes = None;
        Ok(Self { time, receiver, value, noise, root, present, below, receiver_sigma, modes })
    }

    /// Removes one component.
    ///
    /// # Panics
    ///
    /// If there is no such component.
    #[must_use]
    pub fn without(mut self, component: usize) -> Self {
        self.present[component] = false;
        self.below[component] = false;
        self.modes = self.modes.filter(|(bearing, _)| *bearing != component);
        self.root = self.factor();
        self
    }

    /// Replaces one component by a limit: it lay below the value given, up to noise of its
    /// variance.
    ///
    /// # Panics
    ///
    /// If there is no such component.
    #[must_use]
    pub fn below(self, component: usize) -> Self {
        let mut below = self.without(component);
        below.below[component] = true;
        below
    }

    /// The limit below which a component lay, and the standard deviation of its noise; `None` for a
    /// component that is present, or of which nothing is known.
    #[must_use]
    pub fn upper_limit(&self, component: usize) -> Option<(f64, f64)> {
        let below = self.below.get(component).copied().unwrap_or(false);
        below.then(|| (self.value[component], libm::sqrt(self.noise[(component, component)])))
    }

    /// Returns true if some component lay below a limit.
    #[must_use]
    pub fn is_censored(&self) -> bool {
        self.below.contains(&true)
    }

    /// The `K` components from `first` on, without the others.
    ///
    /// # Panics
    ///
    /// If there are fewer than `K`.
    #[must_use]
    pub fn marginal<const K: usize>(&self, first: usize) -> Observation<K> {
        let present = core::array::from_fn(|i| self.present[first + i]);
        let below = core::array::from_fn(|i| self.below[first + i]);
        let value = SVector::from_fn(|i, _| self.value[first + i]);
        let noise = Covariance::from_fn(|i, j| self.noise[(first + i, first + j)]);
        let root = Covariance::identity();
        let modes = self.modes.and_then(|(bearing, modes)| {
            bearing.checked_sub(first).filter(|own| *own < K).map(|own| (own, modes))
        });
        let Self { time, receiver, receiver_sigma, .. } = *self;
        let mut marginal = Observation {
            time,
            receiver,
            value,
            noise,
            root,
            present,
            below,
            receiver_sigma,
            modes,
        };
        marginal.root = marginal.factor();
        marginal
    }

    /// The factor of [`noise`](Self::noise).
    fn factor(&self) -> SMatrix<f64, M, M> {
        self.noise()
            .cholesky()
            .expect("a principal submatrix of a positive definite matrix is one too")
            .unpack()
    }

    /// Multiplies one component's standard deviation by `factor`; correlations stay.
    ///
    /// # Panics
    ///
    /// If there is no such component, or the factor is not a positive number.
    #[must_use]
    pub fn with_noise_scaled(mut self, component: usize, factor: f64) -> Self {
        assert!(factor > 0.0 && factor.is_finite(), "a noise cannot be scaled by {factor}");
        self.noise.row_mut(component).scale_mut(factor);
        self.noise.column_mut(component).scale_mut(factor);
        if self.present[component] {
            self.root.row_mut(component).scale_mut(factor);
        }
        self.with_mode_sigmas(component, |sigma| sigma * factor)
    }

    /// Sets the standard deviations of the receiver's own place: East, North and Up in metres, 0
    /// where it is known. It enters the noise through the geometry
    /// ([`absorb_receiver_noise`](crate::absorb_receiver_noise)).
    ///
    /// # Errors
    ///
    /// [`ObservationError::ReceiverSigma`] when one is negative or not finite.
    pub fn with_receiver_sigma(self, sigma: Vector3<f64>) -> Result<Self, ObservationError> {
        ObservationError::check_receiver_sigma(&sigma)?;
        Ok(Self { receiver_sigma: Some(sigma), ..self })
    }

    /// σ of the receiver's own place, if it is uncertain.
    #[must_use]
    pub fn receiver_sigma(&self) -> Option<&Vector3<f64>> {
        self.receiver_sigma.as_ref()
    }

    /// Adds the covariance `more moreᵀ` to the noise, and makes the receiver's place known.
    pub(crate) fn with_more_noise<const K: usize>(mut self, more: &SMatrix<f64, M, K>) -> Self {
        let noise = self.noise + more * more.transpose();
        self.noise = (noise + noise.transpose()) * 0.5;
        self.root = self.factor();
        self.receiver_sigma = None;
        if let Some((component, _)) = self.modes {
            let more = more.row(component).norm_squared();
            return self.with_mode_sigmas(component, |sigma| libm::sqrt(sigma * sigma + more));
        }
        self
    }

    /// The time of the observation, in seconds.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.time
    }

    /// The receiver's pose.
    #[must_use]
    pub fn receiver(&self) -> &Pose {
        &self.receiver
    }

    /// The numbers; a missing component holds the value that it was given, which must not be read.
    #[must_use]
    pub fn value(&self) -> &SVector<f64, M> {
        &self.value
    }

    /// Returns true if the component exists and is present.
    #[must_use]
    pub fn has(&self, component: usize) -> bool {
        self.present.get(component).copied().unwrap_or(false)
    }

    /// Number of components that are present: the degrees of freedom of its NIS.
    #[must_use]
    pub fn len(&self) -> usize {
        self.present.iter().filter(|&&p| p).count()
    }

    /// Returns true if no component is present. It may be censored all the same.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Returns true if no component is missing.
    fn is_whole(&self) -> bool {
        self.present == [true; M]
    }

    /// R with each missing component decoupled and of unit variance.
    ///
    /// Together with [`mask`](Self::mask) this is the same as striking the
    /// component's row and column out, without changing a dimension.
    #[must_use]
    pub fn noise(&self) -> Covariance<M> {
        if self.is_whole() {
            return self.noise;
        }
        Covariance::from_fn(|i, j| match (self.present[i] && self.present[j], i == j) {
            (true, _) => self.noise[(i, j)],
            (false, true) => 1.0,
            (false, false) => 0.0,
        })
    }

    /// The lower triangular L with L Lᵀ = [`noise`](Self::noise), worked out once.
    #[must_use]
    pub fn noise_factor(&self) -> &SMatrix<f64, M, M> {
        &self.root
    }

    /// ln N(r; 0, R) over the components present.
    #[must_use]
    pub fn log_density(&self, residual: &SVector<f64, M>) -> f64 {
        noise::gaussian(&self.strike(*residual), &self.root, self.len())
    }

    /// Zeroes the missing components' rows.
    #[must_use]
    pub fn strike<const A: usize>(&self, matrix: SMatrix<f64, M, A>) -> SMatrix<f64, M, A> {
        if self.is_whole() {
            return matrix;
        }
        SMatrix::from_fn(|i, j| if self.present[i] { matrix[(i, j)] } else { 0.0 })
    }

    /// Zeroes the missing components' columns.
    #[must_use]
    pub fn mask<const A: usize>(&self, matrix: SMatrix<f64, A, M>) -> SMatrix<f64, A, M> {
        if self.is_whole() {
            return matrix;
        }
        SMatrix::from_fn(|i, j| if self.present[j] { matrix[(i, j)] } else { 0.0 })
    }
}

/// Reads back only through [`Observation::new`].
#[cfg(feature = "serde")]
impl<const M: usize> TryFrom<Parts<M>> for Observation<M> {
    type Error = ObservationError;

    fn try_from(parts: Parts<M>) -> Result<Self, ObservationError> {
        let mut whole = Self::new(parts.time, parts.receiver, parts.value, parts.noise)?;
        if let Some(sigma) = parts.receiver_sigma {
            whole = whole.with_receiver_sigma(sigma)?;
        }
        if let Some((component, modes)) = parts.modes {
            if component >= M || parts.missing[component] {
                return Err(ObservationError::NoBearing { component });
            }
            whole = whole.with_bearing_modes(component, modes);
        }
        let present = (0..M).filter(|&i| parts.missing[i]).fold(whole, Self::without);
        Ok((0..M).filter(|&i| parts.below[i]).fold(present, Self::below))
    }
}

/// Plain fields of an observation, as they stand in a file.
#[cfg(feature = "serde")]
#[derive(serde::Serialize, serde::Deserialize)]
struct Parts<const M: usize> {
    time: f64,
    receiver: Pose,
    value: SVector<f64, M>,
    noise: Covariance<M>,
    missing: SVector<bool, M>,
    #[serde(default = "nowhere", skip_serializing_if = "is_nowhere")]
    below: SVector<bool, M>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    receiver_sigma: Option<Vector3<f64>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    modes: Option<(usize, BearingModes)>,
}

#[cfg(feature = "serde")]
impl<const M: usize> From<Observation<M>> for Parts<M> {
    fn from(o: Observation<M>) -> Self {
        Self {
            time: o.time,
            receiver: o.receiver,
            value: o.value,
            noise: o.noise,
            missing: SVector::from_fn(|i, _| !o.present[i]),
            below: SVector::from_fn(|i, _| o.below[i]),
            receiver_sigma: o.receiver_sigma,
            modes: o.modes,
        }
    }
}

#[cfg(feature = "serde")]
fn nowhere<const M: usize>() -> SVector<bool, M> {
    SVector::repeat(false)
}

#[cfg(feature = "serde")]
fn is_nowhere<const M: usize>(below: &SVector<bool, M>) -> bool {
    below.iter().all(|below| !below)
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use nalgebra::{Matrix1, Matrix2, Vector1, Vector2};

    use super::*;

    #[test]
    fn a_covariance_that_is_none_is_refused() {
        for off in [[1.5, -1.5], [1.5, f64::NAN], [f64::NAN, 1.5], [7.0, 7.0]] {
            let noise = Matrix2::new(4.0, off[0], off[1], 9.0);
            let made = Observation::new(0.0, Pose::default(), Vector2::zeros(), noise);
            assert_eq!(made, Err(ObservationError::Covariance), "{noise}");
        }
    }

    #[test]
    fn a_scaled_noise_is_that_of_an_observation_made_with_it() {
        let value = Vector2::new(1.0, -2.0);
        let make = |noise| Observation::new(0.0, Pose::default(), value, noise).expect("proper");
        let scaled = make(Matrix2::new(4.0, 1.5, 1.5, 9.0)).with_noise_scaled(0, 3.0);
        let direct = make(Matrix2::new(36.0, 4.5, 4.5, 9.0));
        assert!((scaled.noise() - direct.noise()).norm() < 1e-14);
        let residual = Vector2::new(0.3, 0.9);
        let error = scaled.log_density(&residual) - direct.log_density(&residual);
        assert_abs_diff_eq!(error, 0.0, epsilon = 1e-14);
        let scaled = scaled.without(0);
        let direct = direct.without(0);
        assert_abs_diff_eq!(
            scaled.log_density(&residual),
            direct.log_density(&residual),
            epsilon = 1e-14
        );
    }

    #[test]
    fn a_missing_component_leaves_the_other_ones_density() {
        let noise = Matrix2::new(4.0, 1.5, 1.5, 9.0);
        let pair = Observation::new(0.0, Pose::default(), Vector2::zeros(), noise).expect("proper");
        let alone = Observation::new(0.0, Pose::default(), Vector1::zeros(), Matrix1::new(4.0));
        let alone = alone.expect("proper").log_density(&Vector1::new(1.0));
        let error = pair.without(1).log_density(&Vector2::new(1.0, 7.0)) - alone;
        assert_abs_diff_eq!(error, 0.0, epsilon = 1e-14);
        assert_abs_diff_eq!(
            pair.without(0).without(1).log_density(&Vector2::new(1.0, 7.0)),
            0.0,
            epsilon = 1e-14
        );
    }

    #[test]
    fn a_component_below_a_limit_is_missing_but_for_the_limit() {
        let noise = Matrix2::new(4.0, 1.5, 1.5, 9.0);
        let pair = Observation::new(0.0, Pose::default(), Vector2::new(-90.0, 1.0), noise);
        let pair = pair.expect("proper");
        let below = pair.below(0);
        assert_eq!((below.upper_limit(0), below.upper_limit(1)), (Some((-90.0, 2.0)), None));
        assert!(!below.has(0) && below.has(1) && below.is_censored() && below.len() == 1);
        let residual = Vector2::new(3.0, 2.0);
        let error = below.log_density(&residual) - pair.without(0).log_density(&residual);
        assert_abs_diff_eq!(error, 0.0, epsilon = 1e-15);
        assert_eq!(below.without(0), pair.without(0), "a missing component has no limit");
        assert_eq!((pair.upper_limit(0), pair.upper_limit(7)), (None, None));
    }

    #[test]
    fn a_marginal_is_made_of_the_same_parts() {
        let noise = nalgebra::Matrix3::new(4.0, 1.5, 0.3, 1.5, 9.0, 0.7, 0.3, 0.7, 2.0);
        let value = nalgebra::Vector3::new(1.0, 2.0, 3.0);
        let whole = Observation::new(5.0, Pose::at(1.0, 2.0, 3.0), value, noise).expect("proper");
        let part = Matrix2::new(9.0, 0.7, 0.7, 2.0);
        let pair = Observation::new(5.0, Pose::at(1.0, 2.0, 3.0), Vector2::new(2.0, 3.0), part);
        let pair = pair.expect("proper");
        assert_eq!(whole.marginal::<2>(1), pair);
        assert_eq!(whole.below(2).marginal::<2>(1), pair.below(1));
    }

    #[cfg(feature = "serde")]
    #[test]
    fn missing_components_are_kept_in_files() {
        use crate::BearingMode;

        let made = Observation::new(0.5, Pose::default(), Vector2::zeros(), Matrix2::identity());
        let whole = made.expect("proper");
        let mode = |angle| BearingMode { weight: 0.5, angle, sigma: 0.25 };
        let modes = BearingModes::new(&[mode(0.0), mode(1.0)]).expect("proper");
        for observation in [
            whole,
            whole.without(1),
            whole.below(0),
            whole.below(0).without(1),
            whole.with_bearing_modes(1, modes),
        ] {
            let text = serde_json::to_string(&observation).expect("plain data");
            assert_eq!(text.contains("below"), observation.is_censored(), "{text}");
            let back: Observation<2> = serde_json::from_str(&text).expect("what was written");
            assert_eq!(back, observation);
        }
        let text = serde_json::to_string(&whole.with_bearing_modes(1, modes)).expect("plain data");
        let nowhere = text.replace("\"modes\":[1,", "\"modes\":[2,");
        assert!(serde_json::from_str::<Observation<2>>(&nowhere).is_err(), "{nowhere}");
    }
}
