//! adskalman: its linear filter, given the Jacobian at the mean.

use adskalman::{
    CovarianceUpdateMethod, ObservationModel, StateAndCovariance, TransitionModelLinearNoControl,
};
use common::{Beacon, Call, Kalman, Measured};
use nalgebra::{Const, Matrix2, Vector2};

struct Linearised {
    h: Matrix2<f64>,
    h_transposed: Matrix2<f64>,
    r: Matrix2<f64>,
    expected: Vector2<f64>,
}

impl ObservationModel<f64, Const<2>, Const<2>> for Linearised {
    fn predict_observation(&self, _: &Vector2<f64>) -> Vector2<f64> {
        self.expected
    }
    fn H(&self) -> &Matrix2<f64> {
        &self.h
    }
    fn HT(&self) -> &Matrix2<f64> {
        &self.h_transposed
    }
    fn R(&self) -> &Matrix2<f64> {
        &self.r
    }
}

struct Still {
    f: Matrix2<f64>,
    q: Matrix2<f64>,
}

impl TransitionModelLinearNoControl<f64, Const<2>> for Still {
    fn F(&self) -> &Matrix2<f64> {
        &self.f
    }
    fn FT(&self) -> &Matrix2<f64> {
        &self.f
    }
    fn Q(&self) -> &Matrix2<f64> {
        &self.q
    }
}

struct Ekf {
    still: Still,
    belief: StateAndCovariance<f64, Const<2>>,
}

impl Kalman for Ekf {
    fn step(&mut self, beacon: &Beacon, measured: &Measured) {
        let predicted = self.still.predict(&self.belief);
        let x = predicted.state();
        let [a, b] = beacon.jacobian(x.x, x.y, &measured.receiver);
        let h = Matrix2::new(a[0], a[1], b[0], b[1]);
        let linearised = Linearised {
            h,
            h_transposed: h.transpose(),
            r: Matrix2::from_diagonal(&Vector2::from(beacon.r())),
            expected: Vector2::from(beacon.expected(x.x, x.y, &measured.receiver)),
        };
        let z = Vector2::from(measured.z);
        self.belief = linearised
            .update(&predicted, &z, CovarianceUpdateMethod::OptimalKalman)
            .expect("positive definite");
    }
    fn belief(&self) -> ([f64; 2], [f64; 4]) {
        let p = self.belief.covariance();
        ((*self.belief.state()).into(), [p.m11, p.m12, p.m21, p.m22])
    }
}

fn main() {
    let call = Call::read();
    match call.problem.as_str() {
        "ekf" => call.kalman(|beacon| Ekf {
            still: Still { f: Matrix2::identity(), q: Matrix2::from_diagonal_element(beacon.q()) },
            belief: StateAndCovariance::new(
                Vector2::zeros(),
                Matrix2::from_diagonal_element(beacon.variance),
            ),
        }),
        _ => call.refuse(),
    }
}
