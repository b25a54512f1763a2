use alloc::{vec, vec::Vec};

use foxhunt_core::{
    Axis, Correction, DynamicEstimate, DynamicMeasurement, DynamicObservation, EstimatorError,
    Role,
    noise::{self, LogProduct},
    parameter::require,
};
use nalgebra::{DMatrix, DVector};

use super::{
    Belief, dense,
    image::{AtReceiver, Image, OverTime, Slope},
    joint::JointMotion,
    pivots_exceed, wrapped,
};
use crate::{
    Cubature, DynamicTransform, Gate, Taylor, TransformRule, Unscented, count::number,
    kalman::Record,
};

/// A Kalman filter of a joint state whose size is known at run time only: of several targets, or of
/// a target and the unknown offsets of all stations, with the covariances between them.
///
/// It is [`Kalman`](crate::Kalman) at any size: over the models and transforms of that filter, by
/// its gate, with its steps over moments where these keep their digits and over square roots
/// elsewhere. With one block and one model both are equal to rounding. Each update brings its own
/// model, over all components or over a few ([`On`](foxhunt_core::On)). The state may grow by
/// blocks and shrink ([`append`](Self::append), [`remove`](Self::remove)). There are no iterations
/// and no mixture of outliers.
///
/// The linearisation of a block's motion, and of a measurement of few components, is over the
/// marginal of these: sigma points are as many as they have components, not as many as the joint
/// state. The rest follows from P₂₁ P₁₁⁻¹, the regression of a Gaussian's parts on each
/// other (Särkkä 2013, lemma A.2), which is exact. A step of D components in blocks of b takes D² b
/// operations, and D³ / 3 more to check that the covariance is definite; an update by m numbers
/// takes D² m.
///
/// ```
/// use foxhunt_core::{Correction, DynamicEstimate, Estimate, MeasurementModel, Observation, On,
///     Pose, Quantity, RandomWalk, State, nalgebra::{Matrix1, Vector1, Vector2}};
/// use foxhunt_filters::{DynamicEkf, JointMotion};
///
/// /// The distance as a station measures it whose delay, in metres, is not known.
/// struct DelayedRange;
///
/// impl MeasurementModel<3, 1> for DelayedRange {
///     fn quantities(&self) -> [Quantity; 1] {
///         [Quantity::RANGE]
///     }
///     fn expected(&self, state: &State<3>, station: &Pose) -> Vector1<f64> {
///         let distance = (state.xy() - station.position.xy()).norm();
///         Vector1::new(distance + state[2])
///     }
/// }
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let stations = [Pose::at(0.0, 0.0, 0.0), Pose::at(100.0, 0.0, 0.0), Pose::at(0.0, 80.0, 0.0)];
/// let target = Estimate::isotropic(Vector2::new(40.0, 40.0), 20.0);
/// let delay = Estimate::isotropic(Vector1::new(0.0), 5.0);
/// let mut motion = JointMotion::new().with::<2>(RandomWalk::uniform(0.1));
/// let mut parts = vec![DynamicEstimate::from(target)];
/// for _ in &stations {
///     motion = motion.with::<1>(RandomWalk::uniform(0.0));
///     parts.push(delay.into());
/// }
/// let mut filter = DynamicEkf::new(motion, DynamicEstimate::independent(parts))?;
/// filter.predict(1.0)?;
/// for (i, station) in stations.iter().enumerate() {
///     let range = Vector1::new(60.0);
///     let observation = Observation::new(1.0, *station, range, Matrix1::new(1.0))?;
///     let by_station = On::new(DelayedRange, [0, 1, 2 + i]);
///     let correction = filter.update(&by_station, &observation.into())?;
///     assert!(matches!(correction, Correction::Fused { .. }));
/// }
/// // Delays and the place are known only together now.
/// assert!(filter.estimate().covariance[(0, 3)].abs() > 0.1);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct DynamicKalman<T> {
    transform: T,
    motion: JointMotion,
    axes: Vec<Axis>,
    belief: Belief,
    gate: Gate,
    record: Record,
}

/// The extended Kalman filter of a joint state.
pub type DynamicEkf = DynamicKalman<Taylor>;

/// The unscented Kalman filter of a joint state.
pub type DynamicUkf = DynamicKalman<Unscented>;

/// The cubature Kalman filter of a joint state.
pub type DynamicCkf = DynamicKalman<Cubature>;

/// Difference between an observation and its expectation, of the components that are present.
#[derive(Clone, Debug, PartialEq)]
pub struct DynamicInnovation {
    /// y = z ⊖ ẑ.
    pub residual: DVector<f64>,
    /// ẑ, in the measurement's units; its angles are not wrapped.
    pub expected: DVector<f64>,
    /// S = Pzz + R.
    pub covariance: DMatrix<f64>,
    /// yᵀ S⁻¹ y; χ² with as many degrees of freedom as components are present, if the filter
    /// is consistent (Bar-Shalom, Li & Kirubarajan 2001, §5.4.2).
    pub nis: f64,
}

/// An observation beside the image of the belief, of the components that are present.
struct Reading {
    /// The components of the state that the model is over.
    components: Vec<usize>,
    expected: DVector<f64>,
    residual: DVector<f64>,
    slope: Slope,
    unexplained: DMatrix<f64>,
    noise: DMatrix<f64>,
}

/// The belief after an observation, in the form in which it was reached.
enum Posterior {
    Plain(Belief),
    Factor(DVector<f64>, DMatrix<f64>),
}

/// The outcome of conditioning on an observation.
struct Conditioned {
    posterior: Posterior,
    nis: f64,
    /// ½ ln |S|.
    log_root: f64,
}

impl<T: DynamicTransform> DynamicKalman<T> {
    /// A filter that starts from `prior`, with the transform's defaults and an open gate.
    ///
    /// # Errors
    ///
    /// An error when the prior has not as many components as the motion, is not finite, or its
    /// covariance is not symmetric and positive definite.
    pub fn new(motion: JointMotion, prior: DynamicEstimate) -> Result<Self, EstimatorError>
    where
        T: Default,
    {
        let axes = checked_axes(&motion, &prior)?;
        let belief = Belief::new(prior, Role::Prior)?;
        let gate = Gate::open();
        let record = Record::default();
        Self { transform: T::default(), motion, axes, belief, gate, record }.checked()
    }

    /// Replaces the transform.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when the transform does not suit the blocks.
    pub fn with_transform<U: DynamicTransform>(
        self,
        transform: U,
    ) -> Result<DynamicKalman<U>, EstimatorError> {
        let Self { motion, axes, belief, gate, record, .. } = self;
        DynamicKalman { transform, motion, axes, belief, gate, record }.checked()
    }

    /// Sets the gate, which counts its steps from here.
    #[must_use]
    pub fn with_gate(self, gate: Gate) -> Self {
        Self { gate, record: Record::default(), ..self }
    }

    /// The belief's first two moments.
    #[must_use]
    pub fn estimate(&self) -> &DynamicEstimate {
        self.belief.estimate()
    }

    /// The motion, with the components of each block.
    #[must_use]
    pub fn motion(&self) -> &JointMotion {
        &self.motion
    }

    /// Adds blocks, such as a new target, at the end of the state. `prior` is their belief, which
    /// is independent of the present one.
    ///
    /// # Errors
    ///
    /// The errors of [`new`](Self::new). On any error the filter is left as it was.
    pub fn append(
        &mut self,
        motion: JointMotion,
        prior: DynamicEstimate,
    ) -> Result<(), EstimatorError> {
        let axes = checked_axes(&motion, &prior)?;
        for (range, _) in motion.blocks() {
            self.transform.check(range.len())?;
        }
        self.belief = self.belief.and(&Belief::new(prior, Role::Prior)?)?;
        self.axes.extend(axes);
        self.motion.append(motion);
        Ok(())
    }

    /// Removes a block; the belief of the others stays. The components behind it move forward.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when there is no such block.
    pub fn remove(&mut self, block: usize) -> Result<(), EstimatorError> {
        let gone = self.motion.range(block).unwrap_or_default();
        require(!gone.is_empty(), "the block", number(block), "one of the motion, from 0")?;
        let left: Vec<usize> = (0..self.axes.len()).filter(|i| !gone.contains(i)).collect();
        self.belief = self.belief.at(&left);
        self.axes.drain(gone);
        self.motion.remove(block);
        Ok(())
    }

    /// Carries the belief `dt` seconds forward.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::TimeStep`] for a `dt` that is negative or not finite;
    /// [`EstimatorError::NotFinite`] and [`EstimatorError::NotPositiveDefinite`] where the models
    /// lead there. On any error the belief is left as it was.
    pub fn predict(&mut self, dt: f64) -> Result<(), EstimatorError> {
        EstimatorError::check_time_step(dt)?;
        if dt <= 0.0 {
            return Ok(());
        }
        let plain = match self.belief.factor() {
            None => self.predicted_moments(dt)?,
            Some(_) => None,
        };
        self.belief = match plain {
            Some(belief) => belief,
            None => self.predicted_factors(dt)?,
        };
        Ok(())
    }

    /// Conditions the belief on an observation made now, by a model of it.
    ///
    /// # Errors
    ///
    /// [`EstimatorError::Parameter`] when the model names a component that does not exist, or one
    /// twice, or its sizes do not fit the observation. On any error the belief is left as it was.
    pub fn update(
        &mut self,
        measurement: &(impl DynamicMeasurement + ?Sized),
        observation: &DynamicObservation,
    ) -> Result<Correction, EstimatorError> {
        if observation.is_empty() {
            return Ok(Correction::Empty);
        }
        let reading = self.reading(measurement, observation)?;
        let Conditioned { posterior, nis, log_root } = self.conditioned(&reading)?;
        let dof = reading.residual.len();
        let (out, record) = self.record.judge(&self.gate, nis, dof);
        if let Some(limit) = out {
            self.record = record;
            return Ok(Correction::Rejected { nis, limit });
        }
        self.belief = match posterior {
            Posterior::Plain(belief) => belief,
            Posterior::Factor(mean, factor) => Belief::of_factor(mean, factor, &self.axes)?,
        };
        self.record = record;
        let log_evidence = noise::log_density(nis, log_root, dof);
        Ok(Correction::Fused { nis: Some(nis), log_evidence, effective_sample_size: None })
    }

    /// Returns the difference between an observation and its expectation, without fusing it.
    ///
    /// # Errors
    ///
    /// The errors of [`update`](Self::update).
    pub fn innovation(
        &self,
        measurement: &(impl DynamicMeasurement + ?Sized),
        observation: &DynamicObservation,
    ) -> Result<DynamicInnovation, EstimatorError> {
        let reading = self.reading(measurement, observation)?;
        let nis = self.conditioned(&reading)?.nis;
        let cross = self.cross(&reading);
        let Reading { residual, expected, .. } = reading;
        Ok(DynamicInnovation { residual, expected, covariance: cross.innovation, nis })
    }

    /// The filter if its transform suits each block.
    fn checked(self) -> Result<Self, EstimatorError> {
        self.motion.blocks().try_for_each(|(range, _)| self.transform.check(range.len()))?;
        Ok(self)
    }
}

/// Steps over moments, and where these would lose digits over square roots.
impl<T: DynamicTransform> DynamicKalman<T> {
    /// The belief after a motion over moments: each block's rows and columns by its own slope.
    fn predicted_moments(&self, dt: f64) -> Result<Option<Belief>, EstimatorError> {
        let DynamicEstimate { mut mean, mut covariance } = self.belief.estimate().clone();
        for moved in self.moved(dt) {
            let Moved { components, image, noise } = moved?;
            let begin = components[0];
            let size = components.len();
            mean.rows_mut(begin, size).copy_from(&image.mean);
            let transposed = image.slope.transposed();
            // What stays is not multiplied by zeros.
            if transposed != DMatrix::identity(size, size) {
                let rows = transposed.tr_mul(&covariance.rows(begin, size));
                covariance.rows_mut(begin, size).copy_from(&rows);
                let columns = covariance.columns(begin, size) * &transposed;
                covariance.columns_mut(begin, size).copy_from(&columns);
            }
            let mut own = covariance.view_mut((begin, begin), (size, size));
            own += &noise * noise.transpose();
            if image.unexplained.ncols() > 0 {
                own += &image.unexplained * image.unexplained.transpose();
            }
        }
        covariance.fill_upper_triangle_with_lower_triangle();
        let variances = covariance.diagonal();
        let mean = wrapped(mean, &self.axes);
        Ok(Belief::plain(DynamicEstimate { mean, covariance }, &variances))
    }

    /// The belief after a motion over factors, by one triangle:
    /// L⁺ L⁺ᵀ = A L Lᵀ Aᵀ + W Wᵀ + Q.
    fn predicted_factors(&self, dt: f64) -> Result<Belief, EstimatorError> {
        let root = self.belief.root()?;
        let size = root.nrows();
        let mut mean = self.belief.estimate().mean.clone();
        let mut all = DMatrix::zeros(size, size);
        for moved in self.moved(dt) {
            let Moved { components, image, noise } = moved?;
            let begin = components[0];
            mean.rows_mut(begin, components.len()).copy_from(&image.mean);
            let carried = image.slope.carried(root.select_rows(&components));
            all.view_mut((begin, 0), carried.shape()).copy_from(&carried);
            for added in [&noise, &image.unexplained] {
                let columns = all.ncols();
                all = all.resize_horizontally(columns + added.ncols(), 0.0);
                all.view_mut((begin, columns), added.shape()).copy_from(added);
            }
        }
        if !dense::is_finite(&all) {
            return Err(EstimatorError::NotFinite { role: Role::Posterior });
        }
        Belief::of_factor(mean, dense::lower_root(all), &self.axes)
    }

    /// Each block after its motion.
    fn moved(&self, dt: f64) -> impl Iterator<Item = Result<Moved, EstimatorError>> {
        let mean = &self.belief.estimate().mean;
        self.motion.blocks().filter(|(range, _)| !range.is_empty()).map(move |(range, motion)| {
            let size = range.len();
            let components: Vec<usize> = range.collect();
            let own = mean.select_rows(&components);
            let noise = motion.noise_factor(&own, dt);
            let rule = match motion.is_linear() {
                true => TransformRule::Slope,
                false => self.transform.rule(size),
            };
            let root = || self.belief.root_at(&components);
            let image = Image::new(rule, &own, root, &OverTime(motion, dt))?;
            let fits = image.fits(size, size) && noise.nrows() == size;
            require(fits, "the size of a block", number(size), "that of its motion's results")?;
            Ok(Moved { components, image, noise })
        })
    }

    /// An observation beside the image of the belief.
    fn reading(
        &self,
        measurement: &(impl DynamicMeasurement + ?Sized),
        observation: &DynamicObservation,
    ) -> Result<Reading, EstimatorError> {
        let all = self.axes.len();
        let components = match measurement.components() {
            Some(components) => distinct(components, all)?,
            None => (0..all).collect(),
        };
        let mean = self.belief.estimate().mean.select_rows(&components);
        let rule = self.transform.rule(components.len());
        self.transform.check(components.len())?;
        let root = || match measurement.components() {
            Some(_) => self.belief.root_at(&components),
            None => self.belief.root().map(|root| root.into_owned()),
        };
        let receiver = observation.receiver();
        let image = Image::new(rule, &mean, root, &AtReceiver(measurement, receiver))?;
        let size = observation.value().len();
        let fits = image.fits(size, components.len()) && measurement.quantities().len() == size;
        require(fits, "the size of the observation", number(size), "that of its model's results")?;

        let mut noise = observation.noise().clone();
        if let Some(sigma) = observation.receiver_sigma() {
            // To first order, by differences over one standard deviation, as for static models.
            for axis in 0..3 {
                let at = |step: f64| {
                    let mut receiver = *receiver;
                    receiver.position[axis] += step;
                    measurement.expected(&mean, &receiver)
                };
                let change = measurement.residual(&at(sigma[axis]), &at(-sigma[axis])) * 0.5;
                noise.ger(1.0, &change, &change, 1.0);
            }
        }
        let present = observation.present();
        let residual = measurement.residual(observation.value(), &image.mean);
        require(residual.len() == size, "the size of a residual", number(size), "the model's")?;
        let reading = Reading {
            components,
            expected: image.mean.select_rows(present),
            residual: residual.select_rows(present),
            slope: image.slope.of(present),
            unexplained: image.unexplained.select_rows(present),
            noise: noise.select_rows(present).select_columns(present),
        };
        let finite = dense::is_finite(&reading.residual) && dense::is_finite(&reading.noise);
        finite.then_some(reading).ok_or(EstimatorError::NotFinite { role: Role::Expected })
    }

    /// Pxz and S.
    fn cross(&self, reading: &Reading) -> Cross {
        let covariance = &self.belief.estimate().covariance;
        let slope = reading.slope.transposed();
        let cross = match reading.components.len() == covariance.ncols() {
            // All components, in their own order or another.
            true if reading.components.is_sorted() => covariance * &slope,
            _ => covariance.select_columns(&reading.components) * &slope,
        };
        let explained = match &reading.slope {
            Slope::Direct(slope) => slope * cross.select_rows(&reading.components),
            Slope::Whitened { cross, .. } => cross.tr_mul(cross),
        };
        let left = &reading.unexplained * reading.unexplained.transpose() + &reading.noise;
        let mut innovation = explained + &left;
        innovation.fill_upper_triangle_with_lower_triangle();
        Cross { cross, innovation, left }
    }

    fn conditioned(&self, reading: &Reading) -> Result<Conditioned, EstimatorError> {
        let plain = match self.belief.factor() {
            None => self.conditioned_moments(reading),
            Some(_) => None,
        };
        match plain {
            Some(conditioned) => Ok(conditioned),
            None => self.conditioned_factors(reading),
        }
    }

    /// P⁺ = P − H Hᵀ and x̂⁺ = x̂ + H w, with G Gᵀ = S, H = Pxz G⁻ᵀ and w = G⁻¹ y; `None`
    /// where that would lose digits.
    fn conditioned_moments(&self, reading: &Reading) -> Option<Conditioned> {
        let DynamicEstimate { mean, covariance } = self.belief.estimate();
        let Cross { cross, innovation, left } = self.cross(reading);
        let root = dense::cholesky(&innovation)?;
        if !pivots_exceed(&root, &innovation.diagonal()) {
            return None;
        }
        let half = dense::solve_lower(&root, cross.transpose()).transpose();
        let white = whitened(&root, &reading.residual);
        let mut covariance = covariance.clone();
        dense::subtract_square(&mut covariance, &half);
        let mean = wrapped(mean + &half * &white, &self.axes);
        // P⁺ is L (I − V S⁻¹ Vᵀ) Lᵀ, whose middle has no eigenvalue below those of
        // G⁻¹ (R + W Wᵀ) G⁻ᵀ, but for 1.
        let halved = dense::solve_lower(&root, left).transpose();
        let kept = dense::solve_lower(&root, halved).symmetric_eigenvalues().min().min(1.0);
        let finite = dense::is_finite(&half);
        let belief = self.belief.updated(DynamicEstimate { mean, covariance }, kept);
        let belief = belief.filter(|_| finite)?;
        let nis = white.norm_squared();
        let posterior = Posterior::Plain(belief);
        nis.is_finite().then(|| Conditioned { posterior, nis, log_root: log_root(&root) })
    }

    /// The update over factors, by one triangle (Kailath, Sayed & Hassibi 2000, §12.3): with
    /// N Nᵀ = R,
    ///
    /// \[N W A L; 0 0 L\] U = \[G 0; H L⁺\], U orthogonal.
    ///
    /// No square is formed and none is subtracted.
    fn conditioned_factors(&self, reading: &Reading) -> Result<Conditioned, EstimatorError> {
        let root = self.belief.root()?;
        let size = root.nrows();
        let measured = reading.residual.len();
        let indefinite = EstimatorError::NotPositiveDefinite { role: Role::Innovation };
        let noise = dense::cholesky(&reading.noise).ok_or(indefinite)?;
        let own = reading.slope.carried(root.select_rows(&reading.components));
        let left = reading.unexplained.ncols();
        let mut array = DMatrix::zeros(measured + size, measured + left + size);
        array.view_mut((0, 0), noise.shape()).copy_from(&noise);
        array.view_mut((0, measured), (measured, left)).copy_from(&reading.unexplained);
        array.view_mut((0, measured + left), (measured, size)).copy_from(&own);
        array.view_mut((measured, measured + left), (size, size)).copy_from(&*root);
        if !dense::is_finite(&array) {
            return Err(EstimatorError::NotFinite { role: Role::Expected });
        }
        let array = dense::lower_root(array);
        let innovation = array.view((0, 0), (measured, measured)).into_owned();
        let half = array.view((measured, 0), (size, measured));
        let factor = array.view((measured, measured), (size, size)).into_owned();
        let white = whitened(&innovation, &reading.residual);
        if innovation.diagonal().iter().any(|d| *d <= 0.0) {
            return Err(indefinite);
        }
        let mean = &self.belief.estimate().mean + half * &white;
        let posterior = Posterior::Factor(mean, factor);
        let nis = white.norm_squared();
        Ok(Conditioned { posterior, nis, log_root: log_root(&innovation) })
    }
}

/// A block after its motion.
struct Moved {
    components: Vec<usize>,
    image: Image,
    noise: DMatrix<f64>,
}

/// Pxz and S of the moments, and R + W Wᵀ in S.
struct Cross {
    cross: DMatrix<f64>,
    innovation: DMatrix<f64>,
    left: DMatrix<f64>,
}

/// G⁻¹ y.
#[inline]
fn whitened(root: &DMatrix<f64>, residual: &DVector<f64>) -> DVector<f64> {
    let column = DMatrix::from_column_slice(residual.len(), 1, residual.as_slice());
    dense::solve_lower(root, column).column(0).into_owned()
}

/// ½ ln |G Gᵀ|.
#[inline]
fn log_root(root: &DMatrix<f64>) -> f64 {
    let mut product = LogProduct::default();
    root.diagonal().iter().for_each(|diagonal| product.multiply(*diagonal));
    product.log()
}

/// The geometry of the components, if the prior has as many as the motion.
#[inline]
fn checked_axes(
    motion: &JointMotion,
    prior: &DynamicEstimate,
) -> Result<Vec<Axis>, EstimatorError> {
    let axes = motion.axes();
    let size = motion.dimension();
    let given = prior.mean.len();
    require(size == given, "the prior's components", number(given), "as many as the motion's")?;
    require(axes.len() == size, "the motion's axes", number(axes.len()), "one for each component")?;
    Ok(axes)
}

/// The components, if each is one of `all` and none comes twice.
#[inline]
fn distinct(components: &[usize], all: usize) -> Result<Vec<usize>, EstimatorError> {
    let mut taken = vec![false; all];
    for component in components {
        let free = taken.get(*component).is_some_and(|taken| !taken);
        let requirement = "one of the state that the model does not name twice";
        require(free, "a model's component", number(*component), requirement)?;
        taken[*component] = true;
    }
    Ok(components.to_vec())
}
