//! bayes_estimate: its unscented and extended filters, and its particles.

use bayes_estimate::{
    estimators::{
        sir::{Resampler, SampleState, Samples, standard_resampler, systematic_resampler},
        unscented::UnscentedState,
    },
    models::{
        ExtendedLinearObserver, ExtendedLinearPredictor, FunctionalObserver, FunctionalPredictor,
        KalmanState,
    },
    noise::CorrelatedNoise,
};
use common::{Beacon, Bearing, Bearings, Call, Cloud, Kalman, Measured, moments};
use nalgebra::{Const, Matrix2, Vector2, Vector4};
use rand::{Rng, RngCore, SeedableRng, rngs::SmallRng};
use rand_distr::StandardNormal;

fn noise(variances: [f64; 2]) -> CorrelatedNoise<f64, Const<2>> {
    CorrelatedNoise { Q: Matrix2::from_diagonal(&Vector2::from(variances)) }
}

fn prior(beacon: &Beacon) -> KalmanState<f64, Const<2>> {
    KalmanState { x: Vector2::zeros(), X: Matrix2::from_diagonal_element(beacon.variance) }
}

fn belief(state: &KalmanState<f64, Const<2>>) -> ([f64; 2], [f64; 4]) {
    (state.x.into(), [state.X.m11, state.X.m12, state.X.m21, state.X.m22])
}

struct Ekf(KalmanState<f64, Const<2>>);

impl Kalman for Ekf {
    fn step(&mut self, beacon: &Beacon, measured: &Measured) {
        let still = self.0.x;
        let q = noise([beacon.q(); 2]);
        ExtendedLinearPredictor::predict(&mut self.0, &still, &Matrix2::identity(), &q)
            .expect("it cannot fail");
        let x = self.0.x;
        let [a, b] = beacon.jacobian(x.x, x.y, &measured.receiver);
        let expected = Vector2::from(beacon.expected(x.x, x.y, &measured.receiver));
        let h = Matrix2::new(a[0], a[1], b[0], b[1]);
        self.0
            .observe_innovation(&(Vector2::from(measured.z) - expected), &h, &noise(beacon.r()))
            .expect("positive definite");
    }
    fn belief(&self) -> ([f64; 2], [f64; 4]) {
        belief(&self.0)
    }
}

struct Ukf(UnscentedState<f64, Const<2>>);

impl Kalman for Ukf {
    fn step(&mut self, beacon: &Beacon, measured: &Measured) {
        self.0.predict(|x| *x, &noise([beacon.q(); 2])).expect("positive definite");
        let h = |x: &Vector2<f64>| Vector2::from(beacon.expected(x.x, x.y, &measured.receiver));
        self.0
            .observe(&Vector2::from(measured.z), h, &noise(beacon.r()))
            .expect("positive definite");
    }
    fn belief(&self) -> ([f64; 2], [f64; 4]) {
        belief(&self.0.kalman)
    }
}

struct Particles {
    state: SampleState<f64, Const<4>>,
    rng: SmallRng,
    every_step: bool,
}

impl Particles {
    fn new(bearings: &Bearings, particles: usize, seed: u64, every_step: bool) -> Self {
        let mut rng = SmallRng::seed_from_u64(seed);
        let mut draw = |row: usize| {
            bearings.prior[row] + bearings.spread[row] * rng.sample::<f64, _>(StandardNormal)
        };
        let samples = (0..particles).map(|_| Vector4::from_fn(|row, _| draw(row))).collect();
        Self { state: SampleState::equal_likelihood_samples(samples), rng, every_step }
    }
}

impl Cloud for Particles {
    fn step(&mut self, bearings: &Bearings, bearing: &Bearing) -> [f64; 4] {
        let Self { state, rng, every_step } = self;
        let (sum, squares) = state.w.iter().fold((0.0, 0.0), |(sum, squares), w| {
            let w = f64::from(*w);
            (sum + w, squares + w * w)
        });
        if *every_step || sum * sum / squares < 0.5 * state.w.len() as f64 {
            let mut standard = standard_resampler;
            let mut systematic = systematic_resampler;
            let resampler: &mut Resampler =
                if *every_step { &mut standard } else { &mut systematic };
            // Without roughening.
            let mut as_they_are = |_: &mut Samples<f64, Const<4>>, _: &mut dyn RngCore| ();
            state.update_resample(resampler, &mut as_they_are, rng).expect("possible");
        }
        let moved = |x: &Vector4<f64>, rng: &mut dyn RngCore| {
            let mut noise = || bearings.noise * rng.sample::<f64, _>(StandardNormal);
            Vector4::new(x.x + x.z + noise(), x.y + x.w + noise(), x.z + noise(), x.w + noise())
        };
        state.predict_sampled(moved, rng);
        state.observe(|x| bearings.likelihood(x.x, x.y, bearing) as f32);
        // Its own moments take the samples for equally likely.
        let total: f64 = state.w.iter().map(|w| f64::from(*w)).sum();
        let weights = state.w.iter().map(|w| f64::from(*w) / total);
        moments(state.s.iter().map(Vector4::as_slice).zip(weights))
    }
}

fn main() {
    let call = Call::read();
    match call.problem.as_str() {
        "ekf" => call.kalman(|beacon| Ekf(prior(beacon))),
        "ukf" => call.kalman(|beacon| {
            let ukf = UnscentedState::from_kalman_state(prior(beacon), beacon.alpha, 2.0);
            let mut ukf = ukf.expect("of the right size");
            // κ = 3 − n, which its constructor takes for 0.
            let spread = 3.0 * beacon.alpha * beacon.alpha;
            ukf.w.nu = spread.sqrt();
            ukf.w.Wm0 = 1.0 - 2.0 / spread;
            ukf.w.Wc0 = ukf.w.Wm0 + 3.0 - beacon.alpha * beacon.alpha;
            ukf.w.W_ = 0.5 / spread;
            Ukf(ukf)
        }),
        "multinomial" => call.cloud(|b, particles, seed| Particles::new(b, particles, seed, true)),
        "systematic" => call.cloud(|b, particles, seed| Particles::new(b, particles, seed, false)),
        _ => call.refuse(),
    }
}
