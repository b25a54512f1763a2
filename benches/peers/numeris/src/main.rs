//! numeris: its extended and its unscented filter.

use common::{Beacon, Call, Kalman, Measured};
use numeris::{
    Matrix, Vector,
    estimate::{Ekf, Ukf},
};

fn diagonal(entries: [f64; 2]) -> Matrix<f64, 2, 2> {
    Matrix::new([[entries[0], 0.0], [0.0, entries[1]]])
}

fn belief(x: &Vector<f64, 2>, p: &Matrix<f64, 2, 2>) -> ([f64; 2], [f64; 4]) {
    ([x[0], x[1]], [p[(0, 0)], p[(0, 1)], p[(1, 0)], p[(1, 1)]])
}

struct Extended(Ekf<f64, 2, 2>);

impl Kalman for Extended {
    fn step(&mut self, beacon: &Beacon, measured: &Measured) {
        let q = diagonal([beacon.q(); 2]);
        self.0.predict(|x| *x, |_| Matrix::eye(), Some(&q));
        let receiver = &measured.receiver;
        self.0
            .update(
                &Vector::from_array(measured.z),
                |x| Vector::from_array(beacon.expected(x[0], x[1], receiver)),
                |x| Matrix::new(beacon.jacobian(x[0], x[1], receiver)),
                &diagonal(beacon.r()),
            )
            .expect("invertible");
    }
    fn belief(&self) -> ([f64; 2], [f64; 4]) {
        belief(&self.0.x, &self.0.p)
    }
}

struct Unscented(Ukf<f64, 2, 2>);

impl Kalman for Unscented {
    fn step(&mut self, beacon: &Beacon, measured: &Measured) {
        let q = diagonal([beacon.q(); 2]);
        self.0.predict(|x| *x, Some(&q)).expect("positive definite");
        self.0
            .update(
                &Vector::from_array(measured.z),
                |x| Vector::from_array(beacon.expected(x[0], x[1], &measured.receiver)),
                &diagonal(beacon.r()),
            )
            .expect("positive definite");
    }
    fn belief(&self) -> ([f64; 2], [f64; 4]) {
        belief(&self.0.x, &self.0.p)
    }
}

fn main() {
    let call = Call::read();
    let prior = |beacon: &Beacon| (Vector::zeros(), diagonal([beacon.variance; 2]));
    match call.problem.as_str() {
        "ekf" => call.kalman(|beacon| {
            let (x, p) = prior(beacon);
            Extended(Ekf::new(x, p))
        }),
        "ukf" => call.kalman(|beacon| {
            let (x, p) = prior(beacon);
            Unscented(Ukf::with_params(x, p, beacon.alpha, 2.0, 1.0))
        }),
        _ => call.refuse(),
    }
}
