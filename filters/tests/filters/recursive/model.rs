//! The measurement model of the reference, small: filters know no sensors.

use foxhunt_core::{
    MeasurementModel, Observation, Pose, Quantity, State,
    nalgebra::{Matrix2, Vector2},
};
use serde_json::Value;

use super::vectors::{number, vector};

/// RSS [dBm] and bearing [rad] of a beacon on the ground (Pritzl 2018, eq. 3.7).
#[derive(Clone, Copy, Debug)]
pub(super) struct RssBearing {
    pub(super) p0_dbm: f64,
    pub(super) exponent: f64,
}

/// The field calibration of Pritzl 2018, §7.1.
pub(super) const FIELD: RssBearing = RssBearing { p0_dbm: -29.06, exponent: 2.765 };

/// Nearer than this [m] a bearing has no derivative and a path no loss.
const LEAST: f64 = 1e-6;

impl RssBearing {
    pub(super) fn of(case: &Value) -> Self {
        Self { p0_dbm: number(&case["p0"]), exponent: number(&case["gamma"]) }
    }
}

impl MeasurementModel<2, 2> for RssBearing {
    fn quantities(&self) -> [Quantity; 2] {
        [Quantity::RSS, Quantity::BEARING]
    }

    fn expected(&self, beacon: &State<2>, receiver: &Pose) -> Vector2<f64> {
        let d = beacon - receiver.position.xy();
        let range = libm::hypot(d.norm(), receiver.position.z).max(LEAST);
        let rss_dbm = self.p0_dbm - 10.0 * self.exponent * libm::log10(range);
        Vector2::new(rss_dbm, libm::atan2(d.y, d.x))
    }

    fn jacobian(&self, beacon: &State<2>, receiver: &Pose) -> Matrix2<f64> {
        let d = beacon - receiver.position.xy();
        let flat = d.norm_squared();
        let up = receiver.position.z;
        if flat < LEAST * LEAST {
            return Matrix2::zeros();
        }
        let slope = -10.0 * self.exponent / core::f64::consts::LN_10 / (flat + up * up);
        Matrix2::new(slope * d.x, slope * d.y, -d.y / flat, d.x / flat)
    }
}

/// An observation of RSS and bearing with independent noise.
pub(super) fn observed(
    receiver: Pose,
    z: Vector2<f64>,
    sigma_rss_db: f64,
    sigma: f64,
) -> Observation<2> {
    let noise = Matrix2::from_diagonal(&Vector2::new(sigma_rss_db.powi(2), sigma.powi(2)));
    Observation::new(0.0, receiver, z, noise).expect("finite, of positive variance")
}

/// The observations of a sequence of vectors.
pub(super) fn observations(case: &Value) -> Vec<Observation<2>> {
    let steps = case["z"].as_array().expect("a list").len();
    let pose = |i: usize| {
        let at = &case["mav"][i];
        Pose::at(number(&at[0]), number(&at[1]), number(&at[2]))
    };
    (0..steps)
        .map(|i| {
            let rss = number(&case["sigma_rss"][i]);
            let bearing = number(&case["sigma_theta"][i]);
            observed(pose(i), vector(&case["z"][i]), rss, bearing)
        })
        .collect()
}
