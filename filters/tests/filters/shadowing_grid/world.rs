//! The model, written out again: fields drawn from it, and the level's regressor.

use foxhunt_core::Pose;
use foxhunt_filters::{PlacePrior, ShadowingGridConfig, Slope};
use nalgebra::{DMatrix, DVector, Vector2};
use rand::{RngExt, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

/// −10 log₁₀ of the distance to a target 1 m above the ground, and 20 log₁₀ of the cosine of its
/// elevation, not below −20 dB.
pub(super) fn level(cell: &Vector2<f64>, receiver: &Pose) -> [f64; 2] {
    let apart = receiver.position - nalgebra::Vector3::new(cell.x, cell.y, 1.0);
    let cosine = apart.xy().norm() / apart.norm();
    [-10.0 * apart.norm().log10(), 20.0 * cosine.max(0.1).log10()]
}

/// Few unknowns and every reading: no gain, an even place, three lengths, one nugget.
pub(super) fn simple() -> ShadowingGridConfig {
    ShadowingGridConfig {
        gain: Slope::Known(0.0),
        place: PlacePrior::Even,
        correlation_lengths_m: vec![15.0, 25.0, 40.0],
        nuggets: vec![0.2],
        max_cells: 40_000,
        segment_m: 0.0,
        segment_share: 0.0,
        quantile: 0.5,
        max_segments: 300,
        sigma_prior: (0.0, 0.0),
        ..ShadowingGridConfig::default()
    }
}

/// A lawn-mower track: `legs` legs of `count` receivers `step_m` apart, legs `apart_m` apart,
/// from (0, 0) to the north-east at a height of 30 m.
pub(super) fn lawn_mower(legs: u8, count: u8, step_m: f64, apart_m: f64) -> Vec<Pose> {
    let leg = |leg: u8| {
        (0..count).map(move |i| {
            let along = if leg.is_multiple_of(2) { i } else { count - 1 - i };
            Pose::at(step_m * f64::from(along), apart_m * f64::from(leg), 30.0)
        })
    };
    (0..legs).flat_map(leg).collect()
}

/// Parameters that a field is drawn with.
#[derive(Clone, Copy, Debug)]
pub(super) struct Truth {
    pub(super) place: Vector2<f64>,
    pub(super) intercept: f64,
    pub(super) slope: f64,
    pub(super) gain: f64,
    pub(super) sigma: f64,
    pub(super) length_m: f64,
    pub(super) nugget: f64,
}

/// The correlation matrix of the model.
pub(super) fn correlation(receivers: &[Pose], length_m: f64, nugget: f64) -> DMatrix<f64> {
    let n = receivers.len();
    DMatrix::from_fn(n, n, |i, j| {
        let a = receivers[i].position;
        let b = receivers[j].position;
        let own = if i == j { nugget } else { 0.0 };
        (1.0 - nugget) * (-(a.x - b.x).hypot(a.y - b.y) / length_m).exp() + own
    })
}

/// Readings a + b x + e, e ~ N(0, σ² C).
pub(super) fn readings(
    receivers: &[Pose],
    truth: &Truth,
    rng: &mut Xoshiro256PlusPlus,
) -> Vec<(Pose, f64)> {
    let factor = correlation(receivers, truth.length_m, truth.nugget).cholesky();
    let factor = factor.expect("a nugget makes it positive definite").unpack();
    let white = DVector::from_fn(receivers.len(), |_, _| rng.sample::<f64, _>(StandardNormal));
    let field = factor * white * truth.sigma;
    let expected = |r: &Pose| {
        let [x, g] = level(&truth.place, r);
        truth.intercept + truth.slope * x + truth.gain * g
    };
    receivers.iter().zip(&field).map(|(r, e)| (*r, expected(r) + e)).collect()
}
