//! Tracks over a grid, judged by the smoother for linear Gaussian problems.

use approx::assert_abs_diff_eq;
use foxhunt_core::{Estimate, Pose, RandomWalk};
use foxhunt_filters::{BatchError, Places, TrackGrid, TrackModel, rauch_tung_striebel};
use nalgebra::{Matrix2, Vector2};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

/// The target walks by so much in a square root of a second, in metres.
const WALK: f64 = 4.0;

/// σ of a measured place, in metres.
const SIGMA: f64 = 25.0;

/// Places measured of a target that walks at random.
struct Measured {
    places: Vec<Vector2<f64>>,
}

impl TrackModel for Measured {
    fn add_log_likelihoods(&self, time: usize, places: &Places<'_>, out: &mut [f64]) {
        let z = self.places[time];
        let variance = SIGMA * SIGMA + places.variance_m2();
        for ((out, east), north) in out.iter_mut().zip(places.east).zip(places.north) {
            let off = (Vector2::new(*east, *north) - z).norm_squared();
            *out -= off / (2.0 * variance) + variance.ln();
        }
    }
}

/// The variance of a target that walks by `walk` in a square root of a second.
fn walking(walk: f64) -> impl Fn(f64) -> f64 {
    move |seconds| walk * walk * seconds
}

fn normal(rng: &mut Xoshiro256PlusPlus, sigma: f64) -> Vector2<f64> {
    Vector2::from_fn(|_, _| sigma * rng.sample::<f64, _>(StandardNormal))
}

/// Times, true places and measured ones.
fn walk(seed: u64) -> (Vec<f64>, Vec<Vector2<f64>>, Vec<Vector2<f64>>) {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut at = Vector2::new(40.0, -30.0);
    let mut time = 0.0;
    let mut times = Vec::new();
    let mut truths = Vec::new();
    let mut measured = Vec::new();
    for step in 0..25 {
        let dt = if step % 5 == 4 { 60.0 } else { 10.0 };
        (time, at) = (time + dt, at + normal(&mut rng, WALK * f64::sqrt(dt)));
        times.push(time);
        truths.push(at);
        measured.push(at + normal(&mut rng, SIGMA));
    }
    (times, truths, measured)
}

/// Receivers that do not measure: they only bound the search.
fn receivers() -> [Pose; 2] {
    [Pose::at(-250.0, -250.0, 0.0), Pose::at(250.0, 250.0, 0.0)]
}

fn nothing_in_common(_: usize, _: &Places<'_>, _: &mut [f64]) {}

#[test]
fn a_linear_gaussian_track_is_the_smoothers() {
    let (times, _, places) = walk(3);
    let filtered = {
        // A flat prior: after the first measurement that is what is believed.
        let mut estimates: Vec<(f64, Estimate<2>)> = Vec::new();
        for (time, z) in times.iter().zip(&places) {
            let updated = match estimates.last() {
                None => Estimate { mean: *z, covariance: Matrix2::identity() * SIGMA * SIGMA },
                Some((before, belief)) => {
                    let p = belief.covariance[(0, 0)] + WALK * WALK * (time - before);
                    let gain = p / (p + SIGMA * SIGMA);
                    let mean = belief.mean + gain * (z - belief.mean);
                    Estimate { mean, covariance: Matrix2::identity() * (1.0 - gain) * p }
                }
            };
            estimates.push((*time, updated));
        }
        estimates
    };
    let motion = RandomWalk::uniform(WALK);
    let expected = rauch_tung_striebel(&motion, &filtered).expect("times ascend");
    let model = Measured { places };
    let fix = TrackGrid { max_cells: 40_000, ..TrackGrid::default() }
        .smooth(&receivers(), &times, &[model], &[walking(WALK)], nothing_in_common)
        .expect("a track");
    for ((_, expected), map) in expected.iter().zip(&fix.maps) {
        let got = map.estimate();
        assert!(
            (got.mean - expected.mean).norm() < 0.06 * SIGMA,
            "{} for {}",
            got.mean,
            expected.mean
        );
        let ratio = got.covariance[(0, 0)] / expected.covariance[(0, 0)];
        assert!((ratio - 1.0).abs() < 0.08, "{ratio} at {} {}", expected.mean, got.covariance);
    }
    assert!(fix.border_mass < 0.01, "{}", fix.border_mass);
}

#[test]
fn walks_are_weighed_by_their_evidence_and_tracks_are_consistent() {
    const TRACKS: u32 = 40;
    let mut nees = 0.0;
    let mut count = 0.0;
    let mut right = 0.0;
    for seed in 0..TRACKS {
        let (times, truths, places) = walk(100 + u64::from(seed));
        let walks = [0.25, 1.0, 4.0].map(|factor| walking(WALK * factor));
        let fix = TrackGrid::default()
            .smooth(&receivers(), &times, &[Measured { places }], &walks, nothing_in_common)
            .expect("a track");
        right += fix.probabilities[1];
        for (truth, map) in truths.iter().zip(&fix.maps) {
            nees += map.estimate().nees(truth).expect("a covariance");
            count += 1.0;
        }
    }
    // 1000 places, of which a few in a row depend on each other: two standard errors of 0.1.
    let nees: f64 = nees / count;
    assert_abs_diff_eq!(nees, 2.0, epsilon = 0.4);
    assert!(right > 0.8 * f64::from(TRACKS), "the true walk has {right} of {TRACKS}");
}

#[test]
fn bad_input_is_named() {
    let model = || Measured { places: vec![Vector2::zeros(); 3] };
    let walks = [walking(1.0)];
    let grid = TrackGrid::default();
    let smooth = |times: &[f64]| {
        grid.smooth(&receivers(), times, &[model()], &walks, nothing_in_common)
            .expect_err("refused")
    };
    assert_eq!(smooth(&[0.0, 1.0, 1.0]), BatchError::Order { index: 2, seconds: 0.0 });
    assert!(smooth(&[0.0, f64::NAN]).to_string().contains("time 1: NaN s"));
    assert!(smooth(&[]).to_string().contains("0 times"));
    let none: [Measured; 0] = [];
    let error = grid.smooth(&receivers(), &[0.0], &none, &walks, nothing_in_common);
    let error = error.expect_err("no model");
    assert!(error.to_string().contains("0 models"), "{error}");
    let small = TrackGrid { max_cells: 10, ..grid };
    let error = small.smooth(&receivers(), &[0.0], &[model()], &walks, nothing_in_common);
    assert!(error.expect_err("too few").to_string().contains("max_cells"));
    let nowhere = |_: usize, _: &Places<'_>, out: &mut [f64]| out.fill(f64::NEG_INFINITY);
    let error =
        grid.smooth(&receivers(), &[0.0], &[model()], &walks, nowhere).expect_err("no place fits");
    assert_eq!(error, BatchError::Flat { rcond: 0.0 });
}
