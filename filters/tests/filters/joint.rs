//! Joint states of a size known at run time, against the static filters, exact sums and the laws.

use foxhunt_core::{
    Axis, ConstantVelocity, CoordinatedTurn, Correction, DynamicEstimate, DynamicMeasurement,
    DynamicMotion, DynamicObservation, Estimate, Estimator, EstimatorError, MeasurementModel,
    MotionModel, Observation, On, Pose, Quantity, RandomWalk, Role, State,
    laws::{self, Checks},
    nalgebra::{DMatrix, DVector, Matrix1, Matrix2, SMatrix, Vector1, Vector2, Vector3, Vector4},
};
use foxhunt_filters::{
    Cubature, DynamicEkf, DynamicKalman, DynamicTransform, DynamicUkf, Gate, JointMotion, Kalman,
    Taylor, Unscented,
};
use proptest::prelude::*;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

/// A wavy number and an angle, with slopes drawn at random, over a state of any size.
#[derive(Clone, Debug)]
struct Wavy<const N: usize> {
    slopes: SMatrix<f64, 2, N>,
    wave: f64,
}

impl<const N: usize> MeasurementModel<N, 2> for Wavy<N> {
    fn quantities(&self) -> [Quantity; 2] {
        [Quantity::linear("wavy_m"), Quantity::angle("phase_rad")]
    }

    fn expected(&self, state: &State<N>, receiver: &Pose) -> Vector2<f64> {
        let along = self.slopes * state;
        let bend = self.wave * libm::sin(along.x + 0.1 * receiver.position.x);
        Vector2::new(along.x + bend, foxhunt_core::angle::wrap(3.0 + 0.3 * along.y + 0.5 * bend))
    }

    fn jacobian(&self, state: &State<N>, receiver: &Pose) -> SMatrix<f64, 2, N> {
        let along = self.slopes * state;
        let bend = self.wave * libm::cos(along.x + 0.1 * receiver.position.x);
        Matrix2::new(1.0 + bend, 0.0, 0.5 * bend, 0.3) * self.slopes
    }
}

/// A motion of `N` components that bends, and whose last component is an angle.
#[derive(Clone, Debug)]
struct Bending<const N: usize>(f64);

impl<const N: usize> MotionModel<N> for Bending<N> {
    fn propagate(&self, state: &State<N>, dt: f64) -> State<N> {
        state.map(|x| x + self.0 * dt * libm::sin(x))
    }

    fn noise_factor(&self, _state: &State<N>, dt: f64) -> SMatrix<f64, N, N> {
        SMatrix::from_fn(|i, j| if j <= i { 0.1 * dt.sqrt() } else { 0.0 })
    }

    fn jacobian(&self, state: &State<N>, dt: f64) -> SMatrix<f64, N, N> {
        SMatrix::from_diagonal(&state.map(|x| 1.0 + self.0 * dt * libm::cos(x)))
    }

    fn axes(&self) -> [Axis; N] {
        core::array::from_fn(|i| if i + 1 == N { Axis::Angle } else { Axis::Linear })
    }
}

fn normal<const R: usize, const C: usize>(rng: &mut Xoshiro256PlusPlus) -> SMatrix<f64, R, C> {
    SMatrix::from_fn(|_, _| rng.sample(StandardNormal))
}

fn random_prior<const N: usize>(rng: &mut Xoshiro256PlusPlus) -> Estimate<N> {
    let root: SMatrix<f64, N, N> = normal(rng);
    let covariance = root * root.transpose() + SMatrix::identity() * 0.2;
    Estimate { mean: normal(rng), covariance }
}

fn random_observation(rng: &mut Xoshiro256PlusPlus, step: usize) -> Observation<2> {
    let root: Matrix2<f64> = normal(rng);
    let noise = root * root.transpose() * 0.1 + Matrix2::identity() * 0.05;
    let place: Vector3<f64> = normal(rng);
    let pose = Pose::at(place.x, place.y, place.z);
    let observation = Observation::new(0.0, pose, normal(rng), noise).expect("proper");
    match step % 4 {
        1 => observation.without(0),
        2 => observation.with_receiver_sigma(Vector3::new(0.5, 0.1, 0.0)).expect("proper"),
        3 => observation.without(1),
        _ => observation,
    }
}

/// Returns the largest difference of two estimates, in the units of the covariance's spread.
fn difference<const N: usize>(own: &Estimate<N>, dynamic: &Estimate<N>) -> f64 {
    let spread = own.covariance.trace();
    let mean = (own.mean - dynamic.mean).norm() / spread.sqrt();
    mean.max((own.covariance - dynamic.covariance).norm() / spread)
}

fn assert_same_correction(own: Correction, dynamic: Correction, room: f64) {
    let alike = |a: f64, b: f64| (a - b).abs() <= room * (1.0 + a.abs());
    let same = match (own, dynamic) {
        (
            Correction::Fused { nis: Some(a), log_evidence: ln_a, .. },
            Correction::Fused { nis: Some(b), log_evidence: ln_b, .. },
        ) => alike(a, b) && alike(ln_a, ln_b),
        (
            Correction::Rejected { nis: a, limit: limit_a },
            Correction::Rejected { nis: b, limit: limit_b },
        ) => alike(a, b) && alike(limit_a, limit_b),
        (Correction::Empty, Correction::Empty) => true,
        _ => false,
    };
    assert!(same, "{own:?} of the static filter, {dynamic:?} of the dynamic one");
}

/// Runs a static filter and a dynamic one over a random problem side by side.
fn same_run<T, F, const N: usize>(transform: T, motion: F, seed: u64, room: f64)
where
    T: DynamicTransform + Copy + Default,
    F: MotionModel<N> + Clone + Send + Sync + 'static,
{
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let prior = random_prior::<N>(&mut rng);
    let model = Wavy { slopes: normal(&mut rng), wave: 0.2 };
    let gate = Gate::probability(0.99).expect("in range");
    let own: Kalman<T, F, _, N, 2> =
        Kalman::new(motion.clone(), model.clone(), prior).expect("a proper prior");
    let mut own = own.with_transform(transform).expect("it suits").with_gate(gate);
    let joint = JointMotion::new().with::<N>(motion);
    let dynamic = DynamicKalman::<T>::new(joint, prior.into()).expect("a proper prior");
    let mut dynamic = dynamic.with_transform(transform).expect("it suits").with_gate(gate);
    let measurement = On::new(model, core::array::from_fn(|i| i));
    for step in 0..8 {
        own.predict(0.5).expect("a proper step");
        dynamic.predict(0.5).expect("a proper step");
        let observation = random_observation(&mut rng, step);
        let innovation = dynamic.innovation(&measurement, &observation.into()).expect("finite");
        let before = own.innovation(&observation).expect("finite");
        let off = (innovation.nis - before.nis).abs();
        assert!(off < 10.0 * room * (1.0 + before.nis), "step {step}: NIS off by {off:e}");
        let present = (0..2).filter(|i| observation.has(*i));
        for (i, own) in present.enumerate() {
            let off = (innovation.residual[i] - before.residual[own]).abs();
            assert!(off < room, "step {step}: residual {own} off by {off:e}");
            let variance = before.covariance[(own, own)];
            let off = (innovation.covariance[(i, i)] - variance).abs();
            assert!(off < room * variance, "step {step}: {off:e} of {variance:e}");
        }
        let correction = own.update(&observation).expect("possible");
        let other = dynamic.update(&measurement, &observation.into()).expect("possible");
        assert_same_correction(correction, other, 10.0 * room);
        let estimate = dynamic.estimate().at(core::array::from_fn(|i| i)).expect("all exist");
        let off = difference(&own.estimate(), &estimate);
        assert!(off < room, "step {step}: off by {off:e}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { max_shrink_iters: 1, ..Default::default() })]

    #[test]
    fn it_is_the_static_filter_at_every_size(seed in any::<u64>()) {
        const STRAIGHT: ConstantVelocity = ConstantVelocity { spectral_density: 0.1 };
        same_run::<_, _, 2>(Taylor, RandomWalk::uniform(0.1), seed, 1e-9);
        same_run::<_, _, 4>(Taylor, STRAIGHT, seed, 1e-9);
        same_run::<_, _, 6>(Taylor, Bending(0.3), seed, 1e-9);
        same_run::<_, _, 2>(Unscented::default(), Bending(0.3), seed, 1e-9);
        same_run::<_, _, 4>(Unscented::default(), Bending(0.3), seed, 1e-9);
        same_run::<_, _, 6>(Unscented::default(), STRAIGHT, seed, 1e-9);
        same_run::<_, _, 2>(Cubature, Bending(0.3), seed, 1e-9);
        same_run::<_, _, 6>(Cubature, Bending(0.3), seed, 1e-9);
        // Near points divide roundings by α² = 10⁻⁶.
        same_run::<_, _, 4>(Unscented::pritzl2018(), Bending(0.3), seed, 1e-4);
    }

    #[test]
    fn independent_blocks_are_as_many_static_filters(seed in any::<u64>(), blocks in 2..12_usize) {
        independent(Taylor, seed, blocks);
        independent(Unscented::default(), seed, blocks);
        independent(Cubature, seed, blocks);
    }

    /// A linear Gaussian problem has one posterior, whatever the order.
    #[test]
    fn updates_one_by_one_are_the_sum_of_information(seed in any::<u64>(), size in 2..50_usize) {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let prior = DMatrix::from_fn(size, size, |i, j| if i == j { 2.0 } else { 0.5 });
        let estimate = DynamicEstimate { mean: DVector::zeros(size), covariance: prior.clone() };
        let still = JointMotion::new().with_block(size, Still);
        let mut filter = DynamicEkf::new(still, estimate).expect("a proper prior");
        let mut information = prior.clone().try_inverse().expect("definite");
        let mut vector = DVector::zeros(size);
        let mut log_evidence = 0.0;
        let mut rows = Vec::new();
        let mut values = Vec::new();
        for _ in 0..6 {
            let row = DVector::from_fn(size, |_, _| rng.sample::<f64, _>(StandardNormal));
            let z: f64 = rng.sample(StandardNormal);
            information += &row * row.transpose() / 0.25;
            vector += &row * (z / 0.25);
            let value = DVector::from_element(1, z);
            let noise = DMatrix::from_element(1, 1, 0.25);
            let observation = DynamicObservation::new(0.0, Pose::default(), value, noise);
            let correction = filter.update(&Weighted(row.clone()), &observation.expect("proper"));
            let Ok(Correction::Fused { log_evidence: own, .. }) = correction else {
                panic!("{correction:?}")
            };
            log_evidence += own;
            rows.push(row);
            values.push(z);
        }
        let covariance = information.try_inverse().expect("definite");
        let off = (&filter.estimate().covariance - &covariance).norm();
        prop_assert!(off < 1e-10 * covariance.norm(), "covariance off by {off:e}");
        let off = (&filter.estimate().mean - &covariance * vector).norm();
        prop_assert!(off < 1e-9, "mean off by {off:e}");
        // All at once: z ~ N(0, H P Hᵀ + R).
        let all = DMatrix::from_columns(&rows).transpose();
        let s = &all * prior * all.transpose() + DMatrix::identity(6, 6) * 0.25;
        let z = DVector::from_vec(values);
        let root = s.clone().cholesky().expect("definite");
        let square = z.dot(&root.solve(&z));
        let exact = -0.5 * (square + s.determinant().ln() + 6.0 * core::f64::consts::TAU.ln());
        prop_assert!((log_evidence - exact).abs() < 1e-8, "{log_evidence}, not {exact}");
    }

    #[test]
    fn a_part_of_a_joint_state_keeps_the_laws(seed in any::<u64>()) {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let model = Wavy { slopes: normal::<2, 4>(&mut rng), wave: 0.2 };
        let prior = DynamicEstimate::independent([
            random_prior::<4>(&mut rng).into(),
            random_prior::<2>(&mut rng).into(),
        ]);
        let motion = JointMotion::new()
            .with::<4>(ConstantVelocity { spectral_density: 0.1 })
            .with::<2>(Bending(0.3));
        let observation = random_observation(&mut rng, 0);
        let checks = Checks::AT_ONE_OBSERVATION;
        let ekf = DynamicEkf::new(motion, prior).expect("a proper prior");
        // Over components of both blocks, of which one is shown.
        let part = |on: [usize; 4]| {
            let measurement = On::<_, 4, 2>::new(model.clone(), on);
            ekf.clone().part::<_, 2, 2>([0, 1], measurement).expect("they exist")
        };
        laws::estimator_with(|| part([0, 1, 2, 3]), &observation, checks);
        laws::estimator_with(|| part([5, 1, 0, 4]), &observation, checks);
        let ukf = ekf.clone().with_transform(Unscented::default()).expect("it suits");
        let part = || {
            let measurement = On::<_, 4, 2>::new(model.clone(), [5, 1, 0, 4]);
            ukf.clone().part::<_, 6, 2>([0, 1, 2, 3, 4, 5], measurement).expect("they exist")
        };
        laws::estimator_with(part, &observation, checks);
    }
}

/// Several targets, each with a motion and observations of its own.
fn independent<T: DynamicTransform + Copy + Default>(transform: T, seed: u64, blocks: usize) {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let turn = CoordinatedTurn { spectral_density: 0.1, turn_rate_drift: 0.02 };
    let priors: Vec<Estimate<5>> = (0..blocks).map(|_| random_prior(&mut rng)).collect();
    let model = Wavy { slopes: normal(&mut rng), wave: 0.2 };
    let mut own: Vec<Kalman<T, _, _, 5, 2>> = priors
        .iter()
        .map(|prior| Kalman::new(turn, model.clone(), *prior).expect("a proper prior"))
        .collect();
    let motion = (0..blocks).fold(JointMotion::new(), |motion, _| motion.with::<5>(turn));
    let prior = DynamicEstimate::independent(priors.into_iter().map(DynamicEstimate::from));
    let joint = DynamicKalman::<T>::new(motion, prior).expect("a proper prior");
    let mut joint = joint.with_transform(transform).expect("it suits");
    let of = |block: usize| core::array::from_fn(|i| 5 * block + i);
    for step in 0..4 {
        joint.predict(0.4).expect("a proper step");
        own.iter_mut().for_each(|own| own.predict(0.4).expect("a proper step"));
        let block = rng.random_range(0..blocks);
        let observation = random_observation(&mut rng, step);
        let correction = own[block].update(&observation).expect("possible");
        let measurement = On::new(model.clone(), of(block));
        let other = joint.update(&measurement, &observation.into()).expect("possible");
        assert_same_correction(correction, other, 1e-8);
        for (block, own) in own.iter().enumerate() {
            let estimate = joint.estimate().at(of(block)).expect("all exist");
            let off = difference(&own.estimate(), &estimate);
            assert!(off < 1e-9, "{blocks} blocks, step {step}, block {block}: off by {off:e}");
        }
    }
    let between = joint.estimate().covariance.view((0, 5), (5, 5)).norm();
    assert!(between <= 0.0, "independent blocks have a covariance of {between}");
}

/// A state of any size that stays.
struct Still;

impl DynamicMotion for Still {
    fn propagate(&self, state: &DVector<f64>, _dt: f64) -> DVector<f64> {
        state.clone()
    }

    fn noise_factor(&self, state: &DVector<f64>, _dt: f64) -> DMatrix<f64> {
        DMatrix::zeros(state.len(), 0)
    }
}

/// A weighted sum of all components.
struct Weighted(DVector<f64>);

impl DynamicMeasurement for Weighted {
    fn quantities(&self) -> Vec<Quantity> {
        vec![Quantity::linear("sum_m")]
    }

    fn expected(&self, state: &DVector<f64>, _receiver: &Pose) -> DVector<f64> {
        DVector::from_element(1, self.0.dot(state))
    }

    fn jacobian(&self, _state: &DVector<f64>, _receiver: &Pose) -> DMatrix<f64> {
        DMatrix::from_row_slice(1, self.0.len(), self.0.as_slice())
    }
}

fn weighted(z: f64, variance: f64) -> DynamicObservation {
    let value = DVector::from_element(1, z);
    let noise = DMatrix::from_element(1, 1, variance);
    DynamicObservation::new(0.0, Pose::default(), value, noise).expect("proper")
}

/// The sum of East and an offset.
#[derive(Clone, Copy, Debug)]
struct OffsetEast;

impl MeasurementModel<2, 1> for OffsetEast {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::linear("east_m")]
    }

    fn expected(&self, state: &State<2>, _receiver: &Pose) -> Vector1<f64> {
        Vector1::new(state[0] + state[1])
    }

    fn jacobian(&self, _state: &State<2>, _receiver: &Pose) -> SMatrix<f64, 1, 2> {
        SMatrix::repeat(1.0)
    }
}

#[test]
fn the_laws_of_the_predictive_density_hold() {
    let observation = Observation::new(1.0, Pose::default(), Vector1::new(0.4), Matrix1::new(0.3));
    let observation = observation.expect("proper");
    let mean = Vector4::new(0.5, -1.0, 0.2, 0.1);
    let motion = JointMotion::new().with::<4>(RandomWalk::uniform(0.3));
    let joint = DynamicEkf::new(motion, Estimate::isotropic(mean, 1.0).into()).expect("proper");
    let part = || {
        let measurement = On::<_, 2, 1>::new(OffsetEast, [0, 3]);
        joint.clone().part::<_, 4, 1>([0, 1, 2, 3], measurement).expect("they exist")
    };
    laws::estimator(part, &observation);
}

#[test]
fn sharp_measurements_leave_a_definite_covariance() {
    // A sum that is known to a billionth of its spread, again and again: over moments alone the
    // covariance would be indefinite.
    for size in [4, 40] {
        let motion = JointMotion::new().with_block(size, Still);
        let prior = DynamicEstimate {
            mean: DVector::zeros(size),
            covariance: DMatrix::identity(size, size) * 1e6,
        };
        let mut ekf = DynamicEkf::new(motion, prior).expect("a proper prior");
        let mut ukf = ekf.clone().with_transform(Unscented::default()).expect("it suits");
        for step in 0..2 * size {
            let model = Weighted(DVector::from_fn(size, |i, _| {
                libm::cos(0.7 * f64::from(u32::try_from(step * i).expect("few"))) + 1.1
            }));
            for correction in [
                ekf.update(&model, &weighted(1.0, 1e-12)).expect("possible"),
                ukf.update(&model, &weighted(1.0, 1e-12)).expect("possible"),
            ] {
                assert!(correction.nis().is_some_and(f64::is_finite));
            }
            ekf.predict(1.0).expect("a proper step");
            ukf.predict(1.0).expect("a proper step");
        }
        for estimate in [ekf.estimate(), ukf.estimate()] {
            assert!(estimate.covariance.clone().cholesky().is_some(), "{size}");
            let skew = (&estimate.covariance - estimate.covariance.transpose()).norm();
            assert!(skew <= 0.0, "{size}: skew {skew}");
        }
        let trace = ekf.estimate().covariance.trace();
        let off = (&ekf.estimate().covariance - &ukf.estimate().covariance).norm();
        assert!(off < 1e-3 * trace, "{size}: {off:e} of {trace:e}");
    }
}

#[test]
fn a_thin_belief_is_that_of_the_static_filter() {
    let model =
        Wavy { slopes: SMatrix::<f64, 2, 4>::from_fn(|i, j| [0.4, -1.0][(i + j) % 2]), wave: 0.0 };
    let prior = Estimate::isotropic(Vector4::new(0.1, 0.0, -0.2, 0.3), 100.0);
    let motion = ConstantVelocity { spectral_density: 1e-9 };
    let mut own: Kalman<Taylor, _, _, 4, 2> =
        Kalman::new(motion, model.clone(), prior).expect("a proper prior");
    let joint = JointMotion::new().with::<4>(motion);
    let mut dynamic = DynamicEkf::new(joint, prior.into()).expect("a proper prior");
    for step in 0..12 {
        own.predict(0.1).expect("a proper step");
        dynamic.predict(0.1).expect("a proper step");
        let noise = Matrix2::from_diagonal_element(1e-10);
        let z = Vector2::new(0.1, 3.0);
        let observation = Observation::new(0.0, Pose::default(), z, noise).expect("proper");
        let correction = own.update(&observation).expect("possible");
        let measurement = On::new(model.clone(), [0, 1, 2, 3]);
        let other = dynamic.update(&measurement, &observation.into()).expect("possible");
        // The numeric slopes of the model are good to ten digits.
        assert_same_correction(correction, other, 1e-4);
        let estimate = dynamic.estimate().at([0, 1, 2, 3]).expect("all exist");
        let off = difference(&own.estimate(), &estimate);
        assert!(off < 1e-6, "step {step}: off by {off:e}");
    }
}

#[test]
fn targets_come_and_go() {
    let first = Estimate::isotropic(Vector2::new(1.0, 2.0), 3.0);
    let second = Estimate::isotropic(Vector4::new(3.0, 4.0, 0.1, 0.2), 2.0);
    let walk = || JointMotion::new().with::<2>(RandomWalk::uniform(0.1));
    let straight = || JointMotion::new().with::<4>(ConstantVelocity { spectral_density: 0.1 });
    let mut filter = DynamicEkf::new(walk(), first.into()).expect("a proper prior");
    filter.append(straight(), second.into()).expect("a proper prior");
    assert_eq!(filter.motion().len(), 2);
    assert_eq!(filter.estimate().at([2, 3, 4, 5]), Some(second));
    // East of both in one observation makes them dependent.
    let both = On::<_, 2, 1>::new(OffsetEast, [0, 2]);
    let noise = Matrix1::new(0.01);
    let z = Observation::new(0.0, Pose::default(), Vector1::new(5.0), noise).expect("proper");
    assert!(filter.update(&both, &z.into()).expect("possible").nis().is_some());
    assert!(filter.estimate().covariance[(0, 2)] < -1.0);
    let second = filter.estimate().at::<4>([2, 3, 4, 5]);
    filter.remove(0).expect("it exists");
    assert_eq!(filter.estimate().at([0, 1, 2, 3]), second);
    assert_eq!(filter.motion().dimension(), 4);
    filter.predict(1.0).expect("a proper step");
    assert!(matches!(filter.remove(1), Err(EstimatorError::Parameter(_))));

    // Thin beliefs keep their factors.
    let sharp = Observation::new(0.0, Pose::default(), Vector1::new(5.0), Matrix1::new(1e-14));
    let sharp = sharp.expect("proper").into();
    let east = On::<_, 2, 1>::new(OffsetEast, [0, 1]);
    assert!(filter.update(&east, &sharp).expect("possible").nis().is_some());
    filter.append(walk(), first.into()).expect("a proper prior");
    assert_eq!(filter.estimate().at([4, 5]), Some(first));
    assert!(filter.update(&east, &sharp).expect("possible").nis().is_some());
    filter.remove(1).expect("it exists");
    assert_eq!(filter.estimate().mean.len(), 4);
    filter.predict(1.0).expect("a proper step");
}

/// A model whose results are of wrong sizes or not finite.
struct Broken {
    quantities: usize,
    expected: DVector<f64>,
}

impl DynamicMeasurement for Broken {
    fn quantities(&self) -> Vec<Quantity> {
        vec![Quantity::RANGE; self.quantities]
    }

    fn expected(&self, _state: &DVector<f64>, _receiver: &Pose) -> DVector<f64> {
        self.expected.clone()
    }
}

#[test]
fn improper_parts_are_refused_and_leave_the_belief() {
    let prior = || DynamicEstimate::from(Estimate::isotropic(Vector2::new(1.0, 2.0), 3.0));
    let walk = || JointMotion::new().with::<2>(RandomWalk::uniform(0.1));
    let parameter = |error: EstimatorError| matches!(error, EstimatorError::Parameter(_));
    let three = JointMotion::new().with::<3>(RandomWalk::uniform(0.1));
    assert!(parameter(DynamicEkf::new(three, prior()).expect_err("another size")));
    let flat = DynamicEstimate { covariance: DMatrix::zeros(2, 2), ..prior() };
    let indefinite = EstimatorError::NotPositiveDefinite { role: Role::Prior };
    assert_eq!(DynamicEkf::new(walk(), flat).err(), Some(indefinite));
    let narrow = DynamicEstimate { covariance: DMatrix::identity(2, 1), ..prior() };
    assert!(parameter(DynamicEkf::new(walk(), narrow).expect_err("another size")));

    let mut filter = DynamicEkf::new(walk(), prior()).expect("a proper prior");
    for dt in [-1.0, f64::NAN] {
        assert!(matches!(filter.predict(dt), Err(EstimatorError::TimeStep { .. })));
    }
    let z = weighted(1.0, 1.0);
    for components in [[0, 2], [1, 1]] {
        let refused = filter.update(&On::<_, 2, 1>::new(OffsetEast, components), &z);
        assert!(parameter(refused.expect_err("no such components")), "{components:?}");
    }
    for (quantities, length) in [(2, 1), (1, 2), (0, 0)] {
        let model = Broken { quantities, expected: DVector::zeros(length) };
        let refused = filter.update(&model, &z).expect_err("another size");
        assert!(parameter(refused), "{quantities} and {length}: {refused}");
    }
    let model = Broken { quantities: 1, expected: DVector::from_element(1, f64::NAN) };
    let refused = filter.update(&model, &z);
    assert_eq!(refused, Err(EstimatorError::NotFinite { role: Role::Expected }));
    assert_eq!(filter.estimate(), &prior());
    let part = filter.clone().part::<_, 2, 1>([0, 5], On::<_, 2, 1>::new(OffsetEast, [0, 1]));
    assert!(parameter(part.expect_err("no such component")));
    let near = Unscented::new(1.0, 0.0, -2.0).expect("in range");
    assert!(parameter(filter.with_transform(near).expect_err("n + κ = 0")));
}

#[test]
fn a_gate_keeps_outliers_out() {
    let walk = JointMotion::new().with::<2>(RandomWalk::uniform(0.1));
    let prior = Estimate::isotropic(Vector2::zeros(), 1.0);
    let filter = DynamicUkf::new(walk, prior.into()).expect("a proper prior");
    let mut filter = filter.with_gate(Gate::probability(0.99).expect("in range"));
    let before = filter.estimate().clone();
    let far = weighted(100.0, 1.0);
    let rejected = filter.update(&On::<_, 2, 1>::new(OffsetEast, [0, 1]), &far);
    assert!(rejected.is_ok_and(|correction| correction.is_rejected()));
    assert_eq!(filter.estimate(), &before);
}
