//! kfilter: its extended and its unscented filter.

use common::{Beacon, Call, Kalman, Measured};
use kfilter::{
    KalmanFilter, KalmanPredict, KalmanUpdate,
    kalman::Kalman as Extended,
    measurement::{LinearisableMeasurement, Measurement},
    system::LinearNoInputSystem,
    ukf::{UKFParameters, UnscentedKalman},
};
use nalgebra::{Matrix2, Vector2};

/// A level and a bearing, linearised where the filter is.
struct LevelBearing<'a> {
    beacon: &'a Beacon,
    receiver: &'a [f64; 3],
    z: Vector2<f64>,
    r: Matrix2<f64>,
    h: Matrix2<f64>,
    h_transposed: Matrix2<f64>,
}

impl<'a> LevelBearing<'a> {
    fn new(beacon: &'a Beacon, measured: &'a Measured, h: Matrix2<f64>) -> Self {
        let r = Matrix2::from_diagonal(&Vector2::from(beacon.r()));
        let z = Vector2::from(measured.z);
        let h_transposed = h.transpose();
        Self { beacon, receiver: &measured.receiver, z, r, h, h_transposed }
    }
}

impl Measurement<f64, 2, 2> for LevelBearing<'_> {
    fn covariance(&self) -> &Matrix2<f64> {
        &self.r
    }
    fn measurement(&self) -> &Vector2<f64> {
        &self.z
    }
    fn set_measurement(&mut self, z: Vector2<f64>) {
        self.z = z;
    }
    fn predict(&self, x: &Vector2<f64>) -> Vector2<f64> {
        Vector2::from(self.beacon.expected(x.x, x.y, self.receiver))
    }
}

impl LinearisableMeasurement<f64, 2, 2> for LevelBearing<'_> {
    fn observation(&self) -> &Matrix2<f64> {
        &self.h
    }
    fn observation_transpose(&self) -> &Matrix2<f64> {
        &self.h_transposed
    }
}

type Still = LinearNoInputSystem<f64, 2>;

fn still(beacon: &Beacon) -> (Still, Matrix2<f64>) {
    let q = Matrix2::from_diagonal_element(beacon.q());
    let system = Still::new(Matrix2::identity(), q, Vector2::zeros());
    (system, Matrix2::from_diagonal_element(beacon.variance))
}

fn belief(filter: &impl KalmanFilter<f64, 2, Still>) -> ([f64; 2], [f64; 4]) {
    let p = filter.covariance();
    ((*filter.state()).into(), [p.m11, p.m12, p.m21, p.m22])
}

struct Ekf(Extended<f64, 2, 0, Still>);

impl Kalman for Ekf {
    fn step(&mut self, beacon: &Beacon, measured: &Measured) {
        self.0.predict().expect("it cannot fail");
        let x = self.0.state();
        let [a, b] = beacon.jacobian(x.x, x.y, &measured.receiver);
        let h = Matrix2::new(a[0], a[1], b[0], b[1]);
        self.0.update(&LevelBearing::new(beacon, measured, h)).expect("invertible");
    }
    fn belief(&self) -> ([f64; 2], [f64; 4]) {
        belief(&self.0)
    }
}

struct Ukf(UnscentedKalman<f64, 2, 0, 5, Still>);

impl Kalman for Ukf {
    fn step(&mut self, beacon: &Beacon, measured: &Measured) {
        self.0.predict().expect("positive definite");
        let measurement = LevelBearing::new(beacon, measured, Matrix2::zeros());
        self.0.update(&measurement).expect("positive definite");
    }
    fn belief(&self) -> ([f64; 2], [f64; 4]) {
        belief(&self.0)
    }
}

fn main() {
    let call = Call::read();
    match call.problem.as_str() {
        "ekf" => call.kalman(|beacon| {
            let (system, p) = still(beacon);
            Ekf(Extended::new_custom(system, p))
        }),
        "ukf" => call.kalman(|beacon| {
            let (system, p) = still(beacon);
            let scaling = UKFParameters::new(beacon.alpha, 2.0, 1.0).expect("in range");
            Ukf(UnscentedKalman::new_custom_with_params(system, p, scaling))
        }),
        _ => call.refuse(),
    }
}
