//! smelly: its extended, unscented and particle filters of sizes known to the compiler.

use common::{Beacon, Bearing, Bearings, Call, Cloud, Kalman, Measured};
use nalgebra::{Const, Dyn, Matrix2, OMatrix, Vector2};
use rand::{Rng, SeedableRng, rngs::SmallRng};
use rand_distr::StandardNormal;
use smelly::{
    MerweScaledSigmaPoints, ParticleFilter, SExtendedKalmanFilter, SUnscentedKalmanFilter,
};

struct Ekf(SExtendedKalmanFilter<f64, 2, 2>);

impl Kalman for Ekf {
    fn step(&mut self, beacon: &Beacon, measured: &Measured) {
        let receiver = &measured.receiver;
        self.0.predict().expect("it cannot fail");
        self.0
            .update(
                &Vector2::from(measured.z),
                |x| Vector2::from(beacon.expected(x.x, x.y, receiver)),
                |x| {
                    let [a, b] = beacon.jacobian(x.x, x.y, receiver);
                    Matrix2::new(a[0], a[1], b[0], b[1])
                },
            )
            .expect("invertible");
    }
    fn belief(&self) -> ([f64; 2], [f64; 4]) {
        let p = self.0.covariance();
        ((*self.0.state()).into(), [p.m11, p.m12, p.m21, p.m22])
    }
}

struct Ukf(SUnscentedKalmanFilter<f64, 2, 2>);

impl Kalman for Ukf {
    fn step(&mut self, beacon: &Beacon, measured: &Measured) {
        self.0.predict(|x| *x).expect("positive definite");
        let h = |x: &Vector2<f64>| Vector2::from(beacon.expected(x.x, x.y, &measured.receiver));
        self.0.update(&Vector2::from(measured.z), h).expect("positive definite");
    }
    fn belief(&self) -> ([f64; 2], [f64; 4]) {
        let p = self.0.covariance();
        ((*self.0.state()).into(), [p.m11, p.m12, p.m21, p.m22])
    }
}

struct Particles {
    filter: ParticleFilter<f64, Const<4>, Dyn>,
    rng: SmallRng,
}

impl Particles {
    fn new(bearings: &Bearings, particles: usize, seed: u64) -> Self {
        let mut rng = SmallRng::seed_from_u64(seed);
        let drawn = OMatrix::<f64, Const<4>, Dyn>::from_fn(particles, |row, _| {
            bearings.prior[row] + bearings.spread[row] * rng.sample::<f64, _>(StandardNormal)
        });
        Self { filter: ParticleFilter::new(drawn).expect("some particles"), rng }
    }
}

impl Cloud for Particles {
    fn step(&mut self, bearings: &Bearings, bearing: &Bearing) -> [f64; 4] {
        let Self { filter, rng } = self;
        if filter.effective_sample_size() < 0.5 * filter.weights().len() as f64 {
            filter.resample(rng.random()).expect("an offset in range");
        }
        let moved = filter.predict(|x, moved| {
            let mut noise = || bearings.noise * rng.sample::<f64, _>(StandardNormal);
            for row in 0..2 {
                moved[row] = x[row] + x[row + 2] + noise();
                moved[row + 2] = x[row + 2] + noise();
            }
        });
        moved.expect("finite");
        filter.update(|x| bearings.likelihood(x[0], x[1], bearing)).expect("possible");
        std::hint::black_box(filter.covariance());
        filter.state().into()
    }
}

fn main() {
    let call = Call::read();
    match call.problem.as_str() {
        "ekf" => call.kalman(|beacon| {
            let mut ekf = SExtendedKalmanFilter::new();
            let r = Matrix2::from_diagonal(&Vector2::from(beacon.r()));
            ekf.set_covariance(Matrix2::from_diagonal_element(beacon.variance))
                .and_then(|()| ekf.set_process_noise(Matrix2::from_diagonal_element(beacon.q())))
                .and_then(|()| ekf.set_measurement_noise(r))
                .expect("of the right size");
            Ekf(ekf)
        }),
        "ukf" => call.kalman(|beacon| {
            let scaling = MerweScaledSigmaPoints::new(beacon.alpha, 2.0, 1.0);
            let mut ukf = SUnscentedKalmanFilter::new(scaling);
            let r = Matrix2::from_diagonal(&Vector2::from(beacon.r()));
            ukf.set_covariance(Matrix2::from_diagonal_element(beacon.variance))
                .and_then(|()| ukf.set_process_noise(Matrix2::from_diagonal_element(beacon.q())))
                .and_then(|()| ukf.set_measurement_noise(r))
                .expect("of the right size");
            Ukf(ukf)
        }),
        "systematic" => call.cloud(Particles::new),
        _ => call.refuse(),
    }
}
