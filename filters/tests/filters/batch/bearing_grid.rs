//! The posterior over bearings: its density, and whether it holds what it promises.

use foxhunt_filters::{BatchError, BearingGrid, BearingLine};
use nalgebra::Vector2;
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::{ChiSquared, Distribution, StandardNormal};

/// Four receivers about (500, 400); half the diagonal of their box is 500 m.
const RECEIVERS: [Vector2<f64>; 4] = [
    Vector2::new(200.0, 0.0),
    Vector2::new(800.0, 100.0),
    Vector2::new(250.0, 800.0),
    Vector2::new(700.0, 700.0),
];

/// The prior's density, written out anew.
fn prior(place: &Vector2<f64>) -> f64 {
    let beyond = |x: f64, low: f64, high: f64| (x - high).max(low - x).max(0.0);
    let (x, y) = (beyond(place.x, 200.0, 800.0), beyond(place.y, 0.0, 800.0));
    (1.0 + (x * x + y * y) / (500.0 * 500.0)).powf(-2.5)
}

/// Bearings of a target, off by N(0, σ²).
fn bearings(
    place: Vector2<f64>,
    sigma: f64,
    rng: &mut Xoshiro256PlusPlus,
) -> Vec<(BearingLine, f64)> {
    let taken = RECEIVERS.map(|receiver| {
        let way = place - receiver;
        let error: f64 = rng.sample(StandardNormal);
        let bearing = way.y.atan2(way.x) + sigma * error;
        (BearingLine { receiver, bearing }, SIGMA)
    });
    taken.to_vec()
}

/// The σ that bearings come with: 3°.
const SIGMA: f64 = 0.052;

#[test]
fn the_posterior_is_students() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(91);
    let taken = bearings(Vector2::new(600.0, 300.0), SIGMA, &mut rng);
    let fix = BearingGrid::default().locate(&taken).expect("a posterior");
    let density = |place: &Vector2<f64>| {
        let square: f64 = (taken.iter())
            .map(|(line, sigma)| {
                let way = place - line.receiver;
                (2.0 * (0.5 * (way.y.atan2(way.x) - line.bearing)).sin() / sigma).powi(2)
            })
            .sum();
        prior(place) * (2.0 + square).powi(-3)
    };
    let total: f64 = fix.map.cells().map(|(place, _)| density(&place)).sum();
    for (place, mass) in fix.map.cells() {
        let expected = density(&place) / total;
        assert!((mass - expected).abs() < 1e-12, "{mass} for {expected} at {place}");
    }
    assert!(fix.border_mass < 0.01 && fix.misfit < 20.0, "{fix:?}");
}

/// A place from the prior, by rejection from a square of six diagonals.
fn draw(rng: &mut Xoshiro256PlusPlus) -> Vector2<f64> {
    loop {
        let coordinate = |u: f64| 500.0 + 6000.0 * (2.0 * u - 1.0);
        let place = Vector2::new(coordinate(rng.random()), coordinate(rng.random()));
        if rng.random::<f64>() < prior(&place) {
            return place;
        }
    }
}

/// Truth and σ drawn from their priors, 600 runs, seed 92: the mass of cells less probable than the
/// truth's is uniform, to 3.29 standard deviations of its first two moments (0.1 % each). That von
/// Mises is drawn as a Gaussian makes no difference at 3°.
#[test]
fn the_posterior_is_calibrated() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(92);
    let freedom = 8.0;
    let grid = BearingGrid { freedom, ..BearingGrid::default() };
    let chi_squared = ChiSquared::new(freedom).expect("positive");
    let runs = 600_u16;
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..runs {
        let place = draw(&mut rng);
        let scale = (freedom / chi_squared.sample(&mut rng)).sqrt();
        let fix = grid.locate(&bearings(place, scale * SIGMA, &mut rng)).expect("a posterior");
        let half = 0.5 * fix.map.cell_m();
        let own = fix.map.cells().find(|(cell, _)| (cell - place).amax() <= half);
        let own = own.map_or(0.0, |(_, mass)| mass);
        let less: f64 = fix.map.mass().iter().filter(|mass| **mass < own).sum();
        let rank = less + own * rng.random::<f64>();
        sum += rank;
        squares += rank * rank;
    }
    let n = f64::from(runs);
    let z = [
        (sum / n - 0.5) / (1.0 / 12.0 / n).sqrt(),
        (squares / n - 1.0 / 3.0) / (4.0 / 45.0 / n).sqrt(),
    ];
    println!("{z:.2?}");
    assert!(z.iter().all(|z| z.abs() < 3.29), "{z:?}");
}

#[test]
fn bearings_that_do_not_meet_make_a_wide_region() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(93);
    let place = Vector2::new(600.0, 300.0);
    let area = |sigma: f64, rng: &mut Xoshiro256PlusPlus| {
        let fix = BearingGrid::default().locate(&bearings(place, sigma, rng)).expect("a posterior");
        fix.map.estimate().covariance.determinant().sqrt()
    };
    let (meeting, apart) = (area(0.001, &mut rng), area(0.3, &mut rng));
    assert!(apart > 4.0 * meeting, "{apart} and {meeting}");
}

#[test]
fn what_cannot_be_located_is_refused() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(94);
    let taken = bearings(Vector2::new(600.0, 300.0), SIGMA, &mut rng);
    let grid = BearingGrid::default();
    let few = grid.locate(&taken[..1]);
    assert!(matches!(few, Err(BatchError::TooFew { have: 1, need: 2, .. })), "{few:?}");
    let mut broken = taken.clone();
    broken[2].0.bearing = f64::NAN;
    assert!(matches!(grid.locate(&broken), Err(BatchError::Value { index: 2, .. })));
    let one_place: Vec<_> = taken
        .iter()
        .map(|(line, sigma)| (BearingLine { receiver: RECEIVERS[0], ..*line }, *sigma))
        .collect();
    assert!(matches!(grid.locate(&one_place), Err(BatchError::Flat { .. })));
    for grid in [
        BearingGrid { freedom: 0.0, ..grid },
        BearingGrid { margin_m: f64::NAN, ..grid },
        BearingGrid { max_cells: 99, ..grid },
    ] {
        assert!(matches!(grid.locate(&taken), Err(BatchError::Parameter(_))), "{grid:?}");
    }
}
