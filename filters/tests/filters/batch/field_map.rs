//! Fields drawn from the model, fields of a law, and recorded flights.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use foxhunt_core::{Belief, Pose};
use foxhunt_filters::{BatchError, FieldMap, FieldMapConfig};
use nalgebra::{DMatrix, DVector, Vector2};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::recorded_flights::flights;

fn white(rng: &mut Xoshiro256PlusPlus) -> f64 {
    rng.sample(StandardNormal)
}

/// Parameters that a field is drawn with; the chosen hyperparameters are these.
const LENGTH_M: f64 = 60.0;
const NOISE_SHARE: f64 = 0.1;
const SIGMA_DB: f64 = 8.0;

fn known() -> FieldMapConfig {
    FieldMapConfig {
        lengths_m: vec![LENGTH_M],
        noise_shares: vec![NOISE_SHARE],
        segment_m: 0.0,
        margin_m: 0.0,
        cell_m: 20.0,
        max_cells: 144,
        samples: 400,
        ..FieldMapConfig::default()
    }
}

/// A field of the model over some places, written out again.
fn draw(rng: &mut Xoshiro256PlusPlus, places: &[Vector2<f64>]) -> DVector<f64> {
    let n = places.len();
    let covariance = DMatrix::from_fn(n, n, |i, j| {
        let scaled = 3.0_f64.sqrt() * (places[i] - places[j]).norm() / LENGTH_M;
        let jitter = if i == j { 1e-9 } else { 0.0 };
        SIGMA_DB.powi(2) * (1.0 - NOISE_SHARE) * ((1.0 + scaled) * (-scaled).exp() + jitter)
    });
    let factor = covariance.cholesky().expect("definite").unpack();
    factor * DVector::from_fn(n, |_, _| white(rng))
}

/// The cells of the map below, and 150 places at random among them where the level is read.
fn scene(rng: &mut Xoshiro256PlusPlus) -> (Vec<Vector2<f64>>, Vec<Vector2<f64>>) {
    let cell = |i: u16| Vector2::new(f64::from(i % 12), f64::from(i / 12)) * 20.0;
    let cells: Vec<_> = (0..144).map(|i| cell(i) + Vector2::repeat(10.0)).collect();
    let mut read: Vec<_> =
        (0..148).map(|_| Vector2::new(rng.random::<f64>(), rng.random::<f64>()) * 240.0).collect();
    // So that the bounding box is that of the cells.
    read.extend([Vector2::zeros(), Vector2::repeat(240.0)]);
    (cells, read)
}

/// Seed 41, 150 fields. Levels at one cell of each field are χ² of 150 degrees; the mass of cells
/// less likely than the true maximum's is uniform. False alarms below 1 in 1000 each; that σ is
/// plugged in costs 150 readings next to nothing.
#[test]
fn levels_and_maxima_are_calibrated() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(41);
    let runs = 150_u16;
    let mut squares = 0.0;
    let mut rank = 0.0;
    let mut sigmas = 0.0;
    for _ in 0..runs {
        let (cells, read) = scene(&mut rng);
        let all: Vec<_> = cells.iter().chain(&read).copied().collect();
        let field = draw(&mut rng, &all);
        let offset = 50.0 * white(&mut rng);
        let noise = SIGMA_DB * NOISE_SHARE.sqrt();
        let readings: Vec<_> = read
            .iter()
            .zip(field.iter().skip(cells.len()))
            .map(|(p, f)| (Pose::at(p.x, p.y, 30.0), offset + f + noise * white(&mut rng)))
            .collect();
        let map = FieldMap::fit(&readings, &known()).expect("a map");
        sigmas += map.model().sigma / SIGMA_DB / f64::from(runs);
        let (level, sd) = map.level(&cells[70]);
        squares += ((field[70] + offset - level) / sd).powi(2);
        let maximum = map.maximum(&mut rng).expect("a maximum");
        assert_eq!((maximum.map.columns(), maximum.map.rows()), (12, 12));
        let best = (0..144).max_by(|a, b| field[*a].total_cmp(&field[*b])).expect("cells");
        let mass = maximum.map.mass();
        let less: f64 = mass.iter().filter(|m| **m < mass[best]).sum();
        let alike: f64 = mass.iter().filter(|m| (**m - mass[best]).abs() < 1e-12).sum();
        rank += less + alike * rng.random::<f64>();
        let mut total = 0.0;
        maximum.visit_positions(&mut |_, w| total += w);
        assert_abs_diff_eq!(total, 1.0, epsilon = 1e-9);
    }
    let n = f64::from(runs);
    let law = ChiSquared::new(n).expect("positive");
    let [low, high] = [0.0005, 0.9995].map(|p| law.inverse_cdf(p));
    println!("levels {:.3}, rank {:.3}, sigma {sigmas:.3}", squares / n, rank / n);
    assert!((low..high).contains(&squares), "{squares} is not in {low}..{high}");
    assert_abs_diff_eq!(rank / n, 0.5, epsilon = 3.29 * (1.0 / 12.0 / n).sqrt());
    assert_abs_diff_eq!(sigmas, 1.0, epsilon = 0.05);
}

/// Universal kriging written out again: the weights are best and unbiased whatever the mean.
#[test]
fn levels_are_those_of_kriging() {
    let places = [(0.0, 0.0), (90.0, 15.0), (40.0, -70.0), (10.0, 160.0), (155.0, 41.0)];
    let values = [3.0, -1.0, 4.0, 1.5, -5.0];
    let readings: Vec<_> =
        places.iter().zip(values).map(|((x, y), v)| (Pose::at(*x, *y, 30.0), v)).collect();
    let map = FieldMap::fit(&readings, &known()).expect("a map");
    let correlation = |a: (f64, f64), b: (f64, f64)| {
        let scaled = 3.0_f64.sqrt() * (a.0 - b.0).hypot(a.1 - b.1) / LENGTH_M;
        (1.0 - NOISE_SHARE) * (1.0 + scaled) * (-scaled).exp()
    };
    // C w + μ 1 = c, 1ᵀ w = 1 (Cressie 1993, §3.4).
    let augmented = DMatrix::from_fn(6, 6, |i, j| match (i, j) {
        (5, 5) => 0.0,
        (5, _) | (_, 5) => 1.0,
        _ => correlation(places[i], places[j]) + if i == j { NOISE_SHARE } else { 0.0 },
    });
    let solve = |right: &DVector<f64>| augmented.clone().lu().solve(right).expect("regular");
    let values = DVector::from_fn(6, |i, _| if i < 5 { values[i] } else { 0.0 });
    let sigma = (values.dot(&solve(&values)) / 4.0).sqrt();
    assert!(abs_diff_eq!(map.model().sigma, sigma, epsilon = 1e-9), "{:?} {sigma}", map.model());
    for at in [(20.0, 20.0), (90.0, 15.0), (400.0, 300.0)] {
        let right =
            DVector::from_fn(6, |i, _| if i < 5 { correlation(places[i], at) } else { 1.0 });
        let weights = solve(&right);
        let sd = sigma * (1.0 - NOISE_SHARE - weights.dot(&right)).sqrt();
        let level = map.level(&Vector2::new(at.0, at.1));
        assert!(abs_diff_eq!(level.0, weights.dot(&values), epsilon = 1e-9), "{level:?} at {at:?}");
        assert!(abs_diff_eq!(level.1, sd, epsilon = 1e-9), "{level:?}, not {sd} at {at:?}");
    }
}

/// Levels of a law with noise on a lawn-mower track, seed 42: the maximum is near the transmitter,
/// and the same seed gives the same map.
#[test]
fn a_transmitter_within_the_track_is_found() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(42);
    let truth = Vector2::new(130.0, 95.0);
    let mut readings = Vec::new();
    for leg in 0..6_u8 {
        for step in 0..25_u8 {
            let along = if leg.is_multiple_of(2) { step } else { 24 - step };
            let pose = Pose::at(10.0 * f64::from(along), 40.0 * f64::from(leg), 30.0);
            let range = (pose.position - truth.push(1.0)).norm();
            readings.push((pose, -30.0 - 25.0 * range.log10() + 2.0 * white(&mut rng)));
        }
    }
    let map = FieldMap::fit(&readings, &FieldMapConfig::default()).expect("a map");
    let maximum = map.maximum(&mut rng.clone()).expect("a maximum");
    let error_m = (maximum.position.mean - truth).norm();
    println!("{error_m:.1} m, {:?}", map.model());
    assert!(error_m < 25.0 && (maximum.highest_mean - truth).norm() < 30.0);
    assert!(maximum.position.nees(&truth).expect("definite") < 13.8, "0.1 % of χ²₂");
    let again = map.maximum(&mut rng).expect("a maximum");
    assert_eq!(again, maximum);
}

/// The baseline on recorded flights: two of three places are hard to miss, the third lies outside
/// of where was flown. The strongest reading alone has a median of 46 m.
#[test]
fn recorded_flights_are_mapped() {
    let flights = match flights() {
        Ok(flights) => flights,
        Err(path) => return println!("skipped: no vectors at {}", path.display()),
    };
    let mut errors_m = Vec::new();
    for flight in &flights {
        let map = FieldMap::fit(&flight.readings, &FieldMapConfig::default()).expect("a map");
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(43);
        let maximum = map.maximum(&mut rng).expect("a maximum");
        let error_m = (maximum.position.mean - flight.truth).norm();
        let nees = maximum.position.nees(&flight.truth).expect("definite");
        let highest_m = (maximum.highest_mean - flight.truth).norm();
        println!("{error_m:.1} m, highest {highest_m:.1} m, NEES {nees:.2}, {:?}", map.model());
        assert!(nees < 9.21, "the 99 % ellipse misses the truth: {nees}");
        errors_m.push(error_m);
    }
    errors_m.sort_by(f64::total_cmp);
    assert!(errors_m[2] < 80.0, "{errors_m:?}");
}

#[test]
fn improper_readings_are_refused() {
    let reading = |east: f64, level: f64| (Pose::at(east, 0.0, 30.0), level);
    let good: Vec<_> = (0..6_u8).map(f64::from).map(|i| reading(15.0 * i, i * i)).collect();
    let fit = |readings: &[(Pose, f64)]| FieldMap::fit(readings, &FieldMapConfig::default());
    assert!(fit(&good).is_ok());
    assert!(matches!(fit(&good[..3]), Err(BatchError::TooFew { need: 4, .. })));
    let mut bad = good.clone();
    bad[4].1 = f64::NAN;
    assert!(matches!(fit(&bad), Err(BatchError::Value { index: 4, .. })));
    bad[2].0.position.x = f64::INFINITY;
    assert!(matches!(fit(&bad), Err(BatchError::Value { index: 2, .. })));
    let one_place = [reading(0.0, 1.0); 5];
    assert!(matches!(fit(&one_place), Err(BatchError::Flat { .. })));
    let even: Vec<_> = good.iter().map(|(pose, _)| (*pose, 0.0)).collect();
    assert!(matches!(fit(&even), Err(BatchError::Flat { .. })));
    let config = |lengths_m, noise_shares| FieldMapConfig {
        lengths_m,
        noise_shares,
        ..FieldMapConfig::default()
    };
    for config in [
        config(vec![], vec![0.1]),
        config(vec![10.0], vec![]),
        config(vec![-1.0], vec![0.1]),
        config(vec![10.0], vec![0.0]),
        config(vec![10.0], vec![1.5]),
        FieldMapConfig { segment_m: f64::NAN, ..FieldMapConfig::default() },
        FieldMapConfig { max_segments: 3, ..FieldMapConfig::default() },
        FieldMapConfig { margin_m: -1.0, ..FieldMapConfig::default() },
        FieldMapConfig { cell_m: 0.0, ..FieldMapConfig::default() },
        FieldMapConfig { max_cells: 15, ..FieldMapConfig::default() },
        FieldMapConfig { samples: 0, ..FieldMapConfig::default() },
    ] {
        assert!(FieldMap::fit(&good, &config).is_err(), "{config:?}");
    }
}
