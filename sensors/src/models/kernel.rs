use core::f64::consts::TAU;

use foxhunt_core::{Observation, angle};
use nalgebra::RowVector2;

/// ln p(z | x) of [RSS, bearing] for whole columns of East and North; `rss_dbm` is given the
/// row and the slant range. The noise is read once instead of once per state.
pub(super) fn rss_bearing_log_likelihoods(
    [east, north]: [&[f64]; 2],
    target_up: f64,
    observation: &Observation<2>,
    rss_dbm: impl Fn(usize, f64) -> f64,
    out: &mut [f64],
) {
    let root = observation
        .noise()
        .cholesky()
        .expect("an observation is only made with a positive definite noise")
        .unpack();
    // A missing component is decoupled, of unit variance, and its residual is struck out.
    let present = observation.mask(RowVector2::repeat(1.0));
    let degrees = present.sum();
    let constant = -0.5 * degrees * libm::log(TAU) - libm::log(root[(0, 0)] * root[(1, 1)]);
    let (whiten_rss, whiten_bearing) = (present[0] / root[(0, 0)], present[1] / root[(1, 1)]);
    let coupling = root[(1, 0)];
    let (rss, bearing) = (observation.value()[0], observation.value()[1]);
    let receiver = observation.receiver().position;
    let up = target_up - receiver.z;

    for (i, ((out, east), north)) in out.iter_mut().zip(east).zip(north).enumerate() {
        let (x, y) = (east - receiver.x, north - receiver.y);
        let range = libm::sqrt(x * x + y * y + up * up);
        let first = (rss - rss_dbm(i, range)) * whiten_rss;
        let turned = angle::wrap(bearing - libm::atan2(y, x));
        let second = (turned - coupling * first) * whiten_bearing;
        *out = constant - 0.5 * (first * first + second * second);
    }
}
