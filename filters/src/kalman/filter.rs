//! The Kalman filters, and the two of Pritzl 2018.

use foxhunt_core::{
    Axis, Correction, Estimate, Estimator, EstimatorError, MeasurementModel, MotionModel,
    Observation, OutlierMixture, Quantity, RandomWalk, Role, Smooth, State, absorb_receiver_noise,
};
use nalgebra::SMatrix;

use super::{
    AtReceiver, Iterations, Linearisation, OverTime,
    belief::{Belief, Conditioned, is_plain, mix},
    gate::{Gate, Record},
};
use crate::{
    Cubature, Gaussian, Innovation, Moments, Passage, Passing, Taylor, Transform, Unscented,
    triangle,
};

/// The root of the process noise per step, in metres (Pritzl 2018, §4.4).
const DRIFT: f64 = 0.1957;

/// A Kalman filter over any [`Transform`]: holds an `N`-Gaussian and allocates nothing.
///
/// The covariance is updated by a difference only where that leaves ten digits of it; elsewhere its
/// factor is, by sums of squares, so that no measurement makes it indefinite. The transform is
/// applied afresh for every update: several updates after one `predict` are the textbook's.
///
/// ```
/// use foxhunt_core::{Correction, Estimate, Estimator, MeasurementModel, Observation, Pose,
///     Quantity, RandomWalk, State, nalgebra::{Matrix1, Vector1, Vector2}};
/// use foxhunt_filters::{Gate, Ukf};
///
/// /// The bearing of the target, in radians counter-clockwise from East.
/// struct BearingOnly;
///
/// impl MeasurementModel<2, 1> for BearingOnly {
///     fn quantities(&self) -> [Quantity; 1] {
///         [Quantity::BEARING]
///     }
///     fn expected(&self, target: &State<2>, receiver: &Pose) -> Vector1<f64> {
///         let (east, north) = (target.x - receiver.position.x, target.y - receiver.position.y);
///         Vector1::new(f64::atan2(north, east))
///     }
/// }
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let prior = Estimate::isotropic(Vector2::new(50.0, 0.0), 20.0);
/// let mut ukf = Ukf::new(RandomWalk::uniform(0.1), BearingOnly, prior)?
///     .with_gate(Gate::probability(0.999)?);
/// ukf.predict(1.0)?;
/// let (receiver, bearing, variance) = (Pose::default(), Vector1::new(0.3), Matrix1::new(0.01));
/// let correction = ukf.update(&Observation::new(1.0, receiver, bearing, variance)?)?;
/// assert!(matches!(correction, Correction::Fused { .. }));
/// assert!(ukf.estimate().mean.y > 10.0);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Kalman<T, F, H, const N: usize, const M: usize> {
    transform: T,
    motion: F,
    measurement: H,
    belief: Belief<N>,
    gate: Gate,
    iterations: Iterations,
    outliers: Option<OutlierMixture<M>>,
    record: Record,
}

/// The extended Kalman filter.
pub type Ekf<F, H, const N: usize, const M: usize> = Kalman<Taylor, F, H, N, M>;

/// The unscented Kalman filter.
pub type Ukf<F, H, const N: usize, const M: usize> = Kalman<Unscented, F, H, N, M>;

/// The cubature Kalman filter.
pub type Ckf<F, H, const N: usize, const M: usize> = Kalman<Cubature, F, H, N, M>;

impl<T, F, H, const N: usize, const M: usize> Kalman<T, F, H, N, M>
where
    T: Transform,
    F: MotionModel<N>,
    H: MeasurementModel<N, M>,
{
    /// A filter that starts from `prior`, with the transform's defaults and an open gate.
    ///
    /// # Errors
    ///
    /// An error when the prior is not finite or its covariance not symmetric and positive definite.
    pub fn new(motion: F, measurement: H, prior: Estimate<N>) -> Result<Self, EstimatorError>
    where
        T: Default,
    {
        let transform = T::default();
        let gate = Gate::open();
        let record = Record::default();
        transform.check(N)?;
        let belief = Gaussian::new(prior, Role::Prior)?.into();
        let iterations = Iterations::once();
        let outliers = None;
        Ok(Self { transform, motion, measurement, belief, gate, iterations, outliers, record })
    }

    /// Replaces the transform.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when the transform does not suit states of `N` components.
    pub fn with_transform<U: Transform>(
        self,
        transform: U,
    ) -> Result<Kalman<U, F, H, N, M>, EstimatorError> {
        transform.check(N)?;
        let Self { motion, measurement, belief, gate, iterations, outliers, record, .. } = self;
        Ok(Kalman { transform, motion, measurement, belief, gate, iterations, outliers, record })
    }

    /// Replaces the motion model.
    #[must_use]
    pub fn with_motion<G: MotionModel<N>>(self, motion: G) -> Kalman<T, G, H, N, M> {
        let Self { transform, measurement, belief, gate, iterations, outliers, record, .. } = self;
        Kalman { transform, motion, measurement, belief, gate, iterations, outliers, record }
    }

    /// Sets the gate, which counts its steps from here.
    #[must_use]
    pub fn with_gate(self, gate: Gate) -> Self {
        Self { gate, record: Record::default(), ..self }
    }

    /// Sets the iterations: each update is linearised afresh about its own posterior. Over
    /// [`Taylor`] this is the iterated extended filter (Bell & Cathey 1993), over sigma points
    /// iterated posterior linearisation (García-Fernández, Svensson, Morelande & Särkkä 2015).
    ///
    /// The linearisation about the prior gives the gate and the NIS. The last one gives the
    /// log-evidence, which with Taylor is Laplace's approximation.
    #[must_use]
    pub fn with_iterations(self, iterations: Iterations) -> Self {
        Self { iterations, ..self }
    }

    /// The filter for a share of outliers among the observations: each update keeps as much of the
    /// prior as the observation is likely to be an outlier, where a gate takes all or nothing.
    #[must_use]
    pub fn with_outliers(self, outliers: OutlierMixture<M>) -> Self {
        Self { outliers: Some(outliers), ..self }
    }

    /// Returns the difference between an observation and its expectation, without fusing it.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::NotFinite`] when the model's expectation is not.
    pub fn innovation(
        &self,
        observation: &Observation<M>,
    ) -> Result<Innovation<M>, EstimatorError> {
        let observation = &self.at_known_receiver(observation);
        let regression = self.linearisation(&self.gaussian()?, observation).about_prior();
        regression.check()?;
        let innovation = regression.innovation();
        // That of an update, to the bit.
        let nis = self.given_moments(observation).map_or(innovation.nis, |given| given.nis);
        Ok(Innovation { nis, ..innovation })
    }

    /// Returns the nonlinearity of the measurement over the belief: the variance of the observation
    /// that a regression on the state leaves unexplained, as a share of the noise's, summed over
    /// the components present. By the unscented transform, whatever the filter's own; below about
    /// 0.1 a linearised update is nearly the exact one.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::NotFinite`] when the model's expectation is not.
    pub fn nonlinearity(&self, observation: &Observation<M>) -> Result<f64, EstimatorError> {
        let observation = &self.at_known_receiver(observation);
        let map = AtReceiver(&self.measurement, observation.receiver());
        let image = Unscented::default().image(&self.gaussian()?, &map);
        let left = observation.strike(image.unexplained);
        let root = observation.noise_factor();
        let share = root.solve_lower_triangular_unchecked(&left).norm_squared();
        let unknown = EstimatorError::NotFinite { role: Role::Expected };
        share.is_finite().then_some(share).ok_or(unknown)
    }

    #[cfg(feature = "alloc")]
    pub(crate) fn measurement(&self) -> &H {
        &self.measurement
    }

    #[cfg(feature = "alloc")]
    pub(crate) fn motion(&self) -> &F {
        &self.motion
    }

    #[cfg(feature = "alloc")]
    pub(crate) fn replace(&mut self, belief: Gaussian<N>) {
        self.belief = belief.into();
    }

    /// The observation with the noise of an uncertain receiver in its own.
    #[inline(never)]
    fn at_known_receiver(&self, observation: &Observation<M>) -> Observation<M> {
        absorb_receiver_noise(&self.measurement, &self.belief.estimate().mean, observation)
    }

    /// The belief with its factor.
    fn gaussian(&self) -> Result<Gaussian<N>, EstimatorError> {
        let indefinite = EstimatorError::NotPositiveDefinite { role: Role::Prior };
        self.belief.gaussian().ok_or(indefinite)
    }

    fn linearisation<'a>(
        &'a self,
        prior: &'a Gaussian<N>,
        observation: &'a Observation<M>,
    ) -> Linearisation<'a, T, H, N, M> {
        let Self { transform, measurement, .. } = self;
        Linearisation { transform, measurement, axes: self.motion.axes(), prior, observation }
    }
}

/// The steps over moments, and where these would lose digits over factors.
impl<T, F, H, const N: usize, const M: usize> Kalman<T, F, H, N, M>
where
    T: Transform,
    F: MotionModel<N>,
    H: MeasurementModel<N, M>,
{
    #[inline(always)]
    fn predicted_moments(&self, dt: f64) -> Option<Estimate<N>> {
        let belief = self.belief.moments()?;
        let (mean, mut covariance) = if self.motion.is_linear() {
            let by: SMatrix<f64, N, N> = self.motion.jacobian(&belief.mean, dt);
            // What stays is not multiplied by zeros.
            let carried = match by == SMatrix::<f64, N, N>::identity() {
                true => belief.covariance,
                false => by * belief.covariance * by.transpose(),
            };
            (self.motion.propagate(&belief.mean, dt), carried)
        } else {
            let map = OverTime::new(&self.motion, dt);
            let Moments { mean, covariance, .. } = self.transform.moments(belief, &map)?;
            (mean, covariance)
        };
        let noise: SMatrix<f64, N, N> = self.motion.noise_factor(&belief.mean, dt);
        covariance += noise * noise.transpose();
        covariance.fill_upper_triangle_with_lower_triangle();
        let mean = Axis::difference(&self.motion.axes(), &mean, &State::zeros());
        let moments = Estimate { mean, covariance };
        is_plain(&moments, &covariance.diagonal()).then_some(moments)
    }

    #[cold]
    #[inline(never)]
    fn predicted(&self, dt: f64) -> Result<Gaussian<N>, EstimatorError> {
        let belief = self.gaussian()?;
        let map = OverTime::new(&self.motion, dt);
        let noise: SMatrix<f64, N, N> = self.motion.noise_factor(belief.mean(), dt);
        if !noise.iter().all(|entry| entry.is_finite()) {
            return Err(EstimatorError::NotFinite { role: Role::ProcessNoise });
        }
        let image = match self.motion.is_linear() {
            true => Taylor.image(&belief, &map),
            false => self.transform.image(&belief, &map),
        };
        let carried = image.whitened_cross.transpose();
        let factor = triangle::lower_root([carried, noise, image.unexplained]);
        Gaussian::from_factor(image.mean, factor, &self.motion.axes())
    }

    #[inline(always)]
    fn given_moments(&self, observation: &Observation<M>) -> Option<Conditioned<N>> {
        let plain = self.iterations.max() == 1 && self.outliers.is_none();
        let prior = self.belief.moments().filter(|_| plain)?;
        let map = AtReceiver(&self.measurement, observation.receiver());
        let moments = self.transform.moments(prior, &map)?;
        let residual = self.measurement.residual(observation.value(), &moments.mean);
        Conditioned::on(prior, &moments, residual, observation, &self.motion.axes())
    }

    #[cold]
    #[inline(never)]
    fn update_factors(
        &mut self,
        observation: &Observation<M>,
    ) -> Result<Correction, EstimatorError> {
        let prior = self.gaussian()?;
        let linearisation = self.linearisation(&prior, observation);
        let first = linearisation.about_prior();
        first.check()?;
        let nis = first.nis();
        let (out, record) = self.record.judge(&self.gate, nis, observation.len());
        if let Some(limit) = out {
            self.record = record;
            return Ok(Correction::Rejected { nis, limit });
        }
        let axes = self.motion.axes();
        let (mean, factor) = first.posterior(&prior);
        let mut log_evidence = first.log_evidence();
        let mut belief = Gaussian::from_factor(mean, factor, &axes)?;
        if self.iterations.max() > 1 {
            (belief, log_evidence) = linearisation.iterate(&first, belief, self.iterations)?;
        }
        if let Some(mixture) = &self.outliers {
            let parts = mixture.log_parts(log_evidence, observation);
            (belief, log_evidence) = mix(&prior, &belief, parts, &axes)?;
        }
        (self.belief, self.record) = (belief.into(), record);
        Ok(Correction::Fused { nis: Some(nis), log_evidence, effective_sample_size: None })
    }
}

impl<T, F, H, const N: usize, const M: usize> Estimator<N, M> for Kalman<T, F, H, N, M>
where
    T: Transform,
    F: MotionModel<N>,
    H: MeasurementModel<N, M>,
{
    fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        EstimatorError::check_time_step(dt)?;
        if dt <= 0.0 {
            return Ok(());
        }
        match self.predicted_moments(dt) {
            Some(moments) => self.belief.replace(&moments),
            None => self.belief = self.predicted(dt)?.into(),
        }
        Ok(())
    }

    fn update(&mut self, observation: &Observation<M>) -> Result<Correction, EstimatorError> {
        if observation.is_empty() {
            return Ok(Correction::Empty);
        }
        if observation.receiver_sigma().is_some() {
            return self.update(&self.at_known_receiver(observation));
        }
        let Some(conditioned) = self.given_moments(observation) else {
            return self.update_factors(observation);
        };
        let nis = conditioned.nis;
        let (out, record) = self.record.judge(&self.gate, nis, observation.len());
        self.record = record;
        if let Some(limit) = out {
            return Ok(Correction::Rejected { nis, limit });
        }
        self.belief.replace(&conditioned.posterior);
        let log_evidence = conditioned.log_evidence(observation.len());
        Ok(Correction::Fused { nis: Some(nis), log_evidence, effective_sample_size: None })
    }

    fn estimate(&self) -> Estimate<N> {
        *self.belief.estimate()
    }

    fn quantities(&self) -> [Quantity; M] {
        self.measurement.quantities()
    }
}

impl<T, F, H, const N: usize, const M: usize> Passing<N> for Kalman<T, F, H, N, M>
where
    F: MotionModel<N>,
{
    fn passage(&self, belief: &Estimate<N>, dt: f64) -> Result<Passage<N>, EstimatorError> {
        Passage::of(&self.motion, belief, dt)
    }
}

/// Rauch, Tung & Striebel 1965, linearised about the filtered mean (Särkkä 2013, eqs. 8.6, 9.2).
impl<T, F, H, const N: usize, const M: usize> Smooth<N, M> for Kalman<T, F, H, N, M>
where
    T: Transform,
    F: MotionModel<N>,
    H: MeasurementModel<N, M>,
{
    fn smooth(&mut self, later: &Self, dt: f64) -> Result<(), EstimatorError> {
        let belief = self.estimate();
        let axes = self.motion.axes();
        let back = self.passage(&belief, dt)?.back(&belief, &later.estimate(), &axes)?;
        self.belief = Gaussian::new(back, Role::Posterior)?.into();
        Ok(())
    }
}

impl<H: MeasurementModel<2, M>, const M: usize> Ekf<RandomWalk<2>, H, 2, M> {
    /// The reference's alternative (Pritzl 2018, §4.4): as `Ukf::pritzl2018`, linearised.
    ///
    /// # Errors
    ///
    /// An error when the prior is not finite or its covariance not symmetric and positive definite.
    pub fn pritzl2018(measurement: H, prior: Estimate<2>) -> Result<Self, EstimatorError> {
        let open: Self = Kalman::new(RandomWalk::uniform(DRIFT), measurement, prior)?;
        Ok(open.with_gate(Gate::pritzl2018()))
    }
}

impl<H: MeasurementModel<2, M>, const M: usize> Ukf<RandomWalk<2>, H, 2, M> {
    /// The reference's filter (Pritzl 2018, §4.4): α = 0.001, β = 2, κ = 3 − n; a still
    /// target with the process noise q = 0.1957 m per step; [`Gate::pritzl2018`].
    ///
    /// The filter's time counts steps: `predict(1.0)` before every update that is executed, the
    /// first included. The filter starts from P = 70 m² I about the centroid of the drones.
    ///
    /// The document prints q² as "0.19572", which is 0.1957² without its exponent, or a variance
    /// of 0.19572 m². This is the first reading; for the second, add
    /// `.with_motion(RandomWalk::uniform(0.19572_f64.sqrt()))`.
    ///
    /// # Errors
    ///
    /// An error when the prior is not finite or its covariance not symmetric and positive definite.
    pub fn pritzl2018(measurement: H, prior: Estimate<2>) -> Result<Self, EstimatorError> {
        let open: Self = Kalman::new(RandomWalk::uniform(DRIFT), measurement, prior)?;
        Ok(open.with_transform(Unscented::pritzl2018())?.with_gate(Gate::pritzl2018()))
    }
}
