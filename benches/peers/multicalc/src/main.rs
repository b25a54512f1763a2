//! multicalc: its extended filter, whose Jacobians come from automatic differentiation, and its
//! particles. Its unscented filter draws no new points after a prediction: another filter.

use common::{Beacon, Bearing, Bearings, Call, Cloud, Kalman, Measured, moments};
use multicalc::{
    estimation::{ExtendedKalmanFilter, ParticleFilter, ResamplingScheme},
    linear_algebra::{Matrix, Vector},
    scalar::{Numeric, VectorFn},
};

fn diagonal<const N: usize>(entries: [f64; N]) -> Matrix<N, N> {
    Matrix::from_fn(|row, column| if row == column { entries[row] } else { 0.0 })
}

struct Still;

impl VectorFn<2, 2> for Still {
    fn eval<S: Numeric>(&self, x: &[S; 2]) -> [S; 2] {
        *x
    }
}

struct LevelBearing<'a>(&'a Beacon, &'a [f64; 3]);

impl VectorFn<2, 2> for LevelBearing<'_> {
    fn eval<S: Numeric>(&self, x: &[S; 2]) -> [S; 2] {
        let Self(beacon, receiver) = self;
        let [east, north, up] = receiver.map(S::from_f64);
        let (x, y) = (x[0] - east, x[1] - north);
        let range = (x * x + y * y + up * up).sqrt();
        let slope = S::from_f64(10.0 * beacon.exponent / std::f64::consts::LN_10);
        [S::from_f64(beacon.reference_dbm) - slope * range.ln(), y.atan2(x)]
    }
}

struct Ekf(ExtendedKalmanFilter<2, 2>);

impl Kalman for Ekf {
    fn step(&mut self, beacon: &Beacon, measured: &Measured) {
        self.0.predict(&Still).expect("finite");
        let model = LevelBearing(beacon, &measured.receiver);
        self.0.update(&model, Vector::new(measured.z)).expect("positive definite");
    }
    fn belief(&self) -> ([f64; 2], [f64; 4]) {
        let x = self.0.state();
        let p = self.0.covariance();
        ([x[0], x[1]], [p[(0, 0)], p[(0, 1)], p[(1, 0)], p[(1, 1)]])
    }
}

struct ConstantVelocity;

impl VectorFn<4, 4> for ConstantVelocity {
    fn eval<S: Numeric>(&self, x: &[S; 4]) -> [S; 4] {
        [x[0] + x[2], x[1] + x[3], x[2], x[3]]
    }
}

struct Particles(ParticleFilter<4, 1>);

impl Particles {
    fn new(bearings: &Bearings, particles: usize, seed: u64, scheme: ResamplingScheme) -> Self {
        let square = |sigma: f64| sigma * sigma;
        let filter = ParticleFilter::new(
            particles,
            Vector::new(bearings.prior),
            diagonal(bearings.spread.map(square)),
            diagonal([square(bearings.noise); 4]),
            seed,
        );
        Self(filter.expect("a proper prior").with_resampling(scheme))
    }
}

impl Cloud for Particles {
    fn step(&mut self, bearings: &Bearings, bearing: &Bearing) -> [f64; 4] {
        self.0.predict(&ConstantVelocity).expect("finite");
        let score = |x: &Vector<4>| bearings.likelihood(x[0], x[1], bearing).ln();
        self.0.update_with_log_weights(score).expect("possible");
        let states = self.0.particles().iter().map(|x| x.as_array().as_slice());
        moments(states.zip(self.0.weights().iter().copied()))
    }
}

fn main() {
    let call = Call::read();
    match call.problem.as_str() {
        "ekf" => call.kalman(|beacon| {
            let p = diagonal([beacon.variance; 2]);
            let q = diagonal([beacon.q(); 2]);
            Ekf(ExtendedKalmanFilter::new(Vector::zeros(), p, q, diagonal(beacon.r())))
        }),
        "systematic" => {
            call.cloud(|b, n, seed| Particles::new(b, n, seed, ResamplingScheme::Systematic));
        }
        _ => call.refuse(),
    }
}
