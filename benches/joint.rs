//! Joint states of a size known at run time: a step beside that of the static filter at the same
//! size, beside one by hand over whole matrices, and the factorisations of nalgebra and faer.

use approx::assert_abs_diff_eq;
use criterion::{BatchSize, BenchmarkId, Criterion, criterion_group, criterion_main};
use faer::{
    Mat, MatRef, Side,
    linalg::solvers::{Llt, Qr},
};
use foxhunt_core::{
    ConstantVelocity, DynamicEstimate, DynamicObservation, Estimate, Estimator, MeasurementModel,
    MotionModel, Observation, On, Pose, Quantity, RandomWalk, State,
    nalgebra::{DMatrix, DVector, Matrix1, Matrix2, SMatrix, Vector1, Vector2},
};
use foxhunt_filters::{DynamicKalman, DynamicTransform, JointMotion, Kalman, Taylor, Unscented};

const DT: f64 = 0.5;

/// Range and bearing of a target whose state begins with its place.
#[derive(Clone, Copy)]
struct RangeBearing;

impl<const N: usize> MeasurementModel<N, 2> for RangeBearing {
    fn quantities(&self) -> [Quantity; 2] {
        [Quantity::RANGE, Quantity::BEARING]
    }

    fn expected(&self, state: &State<N>, receiver: &Pose) -> Vector2<f64> {
        let east = state[0] - receiver.position.x;
        let north = state[1] - receiver.position.y;
        Vector2::new(libm::hypot(east, north), libm::atan2(north, east))
    }

    fn jacobian(&self, state: &State<N>, receiver: &Pose) -> SMatrix<f64, 2, N> {
        let east = state[0] - receiver.position.x;
        let north = state[1] - receiver.position.y;
        let square = east * east + north * north;
        let range = libm::sqrt(square);
        let mut slope: SMatrix<f64, 2, N> = SMatrix::zeros();
        slope.fixed_view_mut::<2, 2>(0, 0).copy_from(&Matrix2::new(
            east / range,
            north / range,
            -north / square,
            east / square,
        ));
        slope
    }
}

/// A range with a station's own offset: x = (East, North, offset).
#[derive(Clone, Copy)]
struct OffsetRange;

impl MeasurementModel<3, 1> for OffsetRange {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::RANGE]
    }

    fn expected(&self, state: &State<3>, receiver: &Pose) -> Vector1<f64> {
        Vector1::new((state.xy() - receiver.position.xy()).norm() + state[2])
    }

    fn jacobian(&self, state: &State<3>, receiver: &Pose) -> SMatrix<f64, 1, 3> {
        let sight = (state.xy() - receiver.position.xy()).normalize();
        SMatrix::from([[sight.x], [sight.y], [1.0]])
    }
}

fn observed() -> Observation<2> {
    let noise = Matrix2::from_diagonal(&Vector2::new(4.0, 0.01));
    Observation::new(0.0, Pose::default(), Vector2::new(50.0, 0.8), noise).expect("proper")
}

/// A prediction and an update of one block, by the static filter and by the dynamic one.
fn one_target<T, F, const N: usize>(criterion: &mut Criterion, name: &str, motion: F)
where
    T: DynamicTransform + Default + Clone,
    F: MotionModel<N> + Clone + Send + Sync + 'static,
{
    let prior = Estimate::isotropic(State::<N>::repeat(30.0), 5.0);
    let observation = observed();
    let own: Kalman<T, F, _, N, 2> =
        Kalman::new(motion.clone(), RangeBearing, prior).expect("a proper prior");
    let joint = JointMotion::new().with::<N>(motion);
    let dynamic = DynamicKalman::<T>::new(joint, prior.into()).expect("a proper prior");
    let measurement = On::<_, N, 2>::new(RangeBearing, core::array::from_fn(|i| i));
    let step_own = |own: &mut Kalman<T, F, RangeBearing, N, 2>| {
        own.predict(DT).expect("a proper step");
        own.update(&observation).expect("possible").nis()
    };
    let z = DynamicObservation::from(observation);
    let step_dynamic = |dynamic: &mut DynamicKalman<T>| {
        dynamic.predict(DT).expect("a proper step");
        dynamic.update(&measurement, &z).expect("possible").nis()
    };
    let first = step_own(&mut own.clone()).expect("reported");
    let second = step_dynamic(&mut dynamic.clone()).expect("reported");
    assert_abs_diff_eq!(first, second, epsilon = 1e-9);
    let mut group = criterion.benchmark_group(name);
    group.sample_size(20);
    let mut filter = own;
    group.bench_function(BenchmarkId::new("static", N), |bencher| {
        bencher.iter(|| step_own(&mut filter));
    });
    let mut filter = dynamic;
    group.bench_function(BenchmarkId::new("dynamic", N), |bencher| {
        bencher.iter(|| step_dynamic(&mut filter));
    });
    group.finish();
}

/// A joint state of a moving target and an offset of each station.
fn stations(size: usize) -> (JointMotion, DynamicEstimate) {
    let straight = ConstantVelocity { spectral_density: 0.1 };
    let motion = JointMotion::new().with::<4>(straight);
    let motion = (4..size).fold(motion, |motion, _| motion.with::<1>(RandomWalk::uniform(0.01)));
    let place = Estimate::isotropic(State::<4>::repeat(30.0), 5.0);
    let offset = DynamicEstimate::from(Estimate::isotropic(Vector1::zeros(), 5.0));
    let parts = std::iter::once(place.into()).chain((4..size).map(|_| offset.clone()));
    (motion, DynamicEstimate::independent(parts))
}

/// An extended filter by hand over whole matrices, as one writes it with nalgebra.
struct ByHand {
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
    noise: DMatrix<f64>,
    transition: DMatrix<f64>,
}

impl ByHand {
    fn new(prior: DynamicEstimate) -> Self {
        let size = prior.mean.len();
        let mut transition = DMatrix::identity(size, size);
        transition[(0, 2)] = DT;
        transition[(1, 3)] = DT;
        let straight = ConstantVelocity { spectral_density: 0.1 };
        let factor = straight.noise_factor(&State::<4>::zeros(), DT);
        let mut noise = DMatrix::from_diagonal_element(size, size, 1e-4 * DT);
        noise.view_mut((0, 0), (4, 4)).copy_from(&(factor * factor.transpose()));
        Self { mean: prior.mean, covariance: prior.covariance, noise, transition }
    }

    fn step(&mut self, station: usize, z: f64, variance: f64) -> f64 {
        self.mean = &self.transition * &self.mean;
        self.covariance =
            &self.transition * &self.covariance * self.transition.transpose() + &self.noise;
        let own = State::<3>::new(self.mean[0], self.mean[1], self.mean[station]);
        let slope = OffsetRange.jacobian(&own, &Pose::default());
        let mut h = DMatrix::zeros(1, self.mean.len());
        [0, 1, station].into_iter().enumerate().for_each(|(i, at)| h[at] = slope[i]);
        let y = z - OffsetRange.expected(&own, &Pose::default())[0];
        let cross = &self.covariance * h.transpose();
        let s = (&h * &cross)[0] + variance;
        self.mean += &cross * (y / s);
        self.covariance -= &cross * cross.transpose() / s;
        y * y / s
    }
}

fn joint(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("stations");
    group.sample_size(20);
    for size in [8, 16, 32, 64, 128] {
        let (motion, prior) = stations(size);
        let z = Observation::new(0.0, Pose::default(), Vector1::new(42.0), Matrix1::new(1.0));
        let z = DynamicObservation::from(z.expect("proper"));
        let measurement = On::<_, 3, 1>::new(OffsetRange, [0, 1, size - 1]);
        let ekf = DynamicKalman::<Taylor>::new(motion, prior.clone()).expect("a proper prior");
        let step = |filter: &mut DynamicKalman<Taylor>| {
            filter.predict(DT).expect("a proper step");
            filter.update(&measurement, &z).expect("possible").nis().expect("reported")
        };
        let mut hand = ByHand::new(prior.clone());
        let mut filter = ekf.clone();
        for _ in 0..5 {
            let own = hand.step(size - 1, 42.0, 1.0);
            assert_abs_diff_eq!(own, step(&mut filter), epsilon = 1e-9);
        }
        // Each step starts from the prior: the one station alone would leave a thin belief at last.
        let small = BatchSize::SmallInput;
        group.bench_function(BenchmarkId::new("by hand", size), |bencher| {
            let step = |hand: &mut ByHand| hand.step(size - 1, 42.0, 1.0);
            bencher.iter_batched_ref(|| ByHand::new(prior.clone()), step, small);
        });
        group.bench_function(BenchmarkId::new("extended", size), |bencher| {
            bencher.iter_batched_ref(|| ekf.clone(), step, small);
        });
        let ukf = ekf.clone().with_transform(Unscented::default()).expect("it suits");
        group.bench_function(BenchmarkId::new("unscented", size), |bencher| {
            let step = |filter: &mut DynamicKalman<Unscented>| {
                filter.predict(DT).expect("a proper step");
                filter.update(&measurement, &z).expect("possible").nis()
            };
            bencher.iter_batched_ref(|| ukf.clone(), step, small);
        });
        let mut predicted = ekf.clone();
        predicted.predict(DT).expect("a proper step");
        group.bench_function(BenchmarkId::new("extended, update alone", size), |bencher| {
            let update = |filter: &mut DynamicKalman<Taylor>| {
                filter.update(&measurement, &z).expect("possible").nis()
            };
            bencher.iter_batched_ref(|| predicted.clone(), update, small);
        });
    }
    group.finish();
}

/// Factors as the filter has them: of a covariance, and of twice as many columns.
fn factors(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("factors");
    group.sample_size(20);
    for n in [8, 16, 24, 32, 48, 64, 128] {
        let covariance = DMatrix::from_fn(n, n, |i, j| {
            let apart = f64::from(u32::try_from(i.abs_diff(j)).expect("few"));
            if i == j { 1.1 } else { (-0.3 * apart).exp() }
        });
        let view = MatRef::from_column_major_slice(covariance.as_slice(), n, n);
        group.bench_function(BenchmarkId::new("nalgebra Cholesky", n), |bencher| {
            bencher.iter(|| covariance.clone().cholesky().expect("definite").unpack());
        });
        group.bench_function(BenchmarkId::new("faer Cholesky", n), |bencher| {
            bencher.iter(|| {
                let factor = Llt::new(view, Side::Lower).expect("definite");
                DMatrix::from_fn(n, n, |i, j| if i >= j { factor.L()[(i, j)] } else { 0.0 })
            });
        });
        let tall = DMatrix::from_fn(2 * n, n, |i, j| covariance[(i % n, j)]);
        group.bench_function(BenchmarkId::new("nalgebra QR", n), |bencher| {
            bencher.iter(|| tall.clone().qr().r());
        });
        group.bench_function(BenchmarkId::new("faer QR", n), |bencher| {
            bencher.iter(|| {
                let view = MatRef::from_column_major_slice(tall.as_slice(), 2 * n, n);
                let matrix: Mat<f64> = view.to_owned();
                let factor = Qr::new(matrix.as_ref());
                DMatrix::from_fn(n, n, |i, j| if i <= j { factor.thin_R()[(i, j)] } else { 0.0 })
            });
        });
    }
    group.finish();
}

fn measure(criterion: &mut Criterion) {
    let straight = ConstantVelocity { spectral_density: 0.1 };
    one_target::<Taylor, _, 2>(criterion, "extended", RandomWalk::uniform(0.1));
    one_target::<Taylor, _, 4>(criterion, "extended", straight);
    one_target::<Taylor, _, 6>(criterion, "extended", straight);
    one_target::<Unscented, _, 2>(criterion, "unscented", RandomWalk::uniform(0.1));
    one_target::<Unscented, _, 4>(criterion, "unscented", straight);
    one_target::<Unscented, _, 6>(criterion, "unscented", straight);
    joint(criterion);
    factors(criterion);
}

criterion_group!(benches, measure);
criterion_main!(benches);
