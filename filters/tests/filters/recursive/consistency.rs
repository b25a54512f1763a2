use approx::abs_diff_eq;
use foxhunt_core::{
    Estimate, Estimator, MeasurementModel, OutlierMixture, Pose, RandomWalk, State,
    nalgebra::{Vector2, Vector3},
};
use foxhunt_filters::{
    Ckf, Ekf, GridConfig, GridFilter, Handover, Iterations, ParticleFilter, Ukf,
    consistency::{ChiSquaredAverage, Verdict},
};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

use super::model::{FIELD, RssBearing, observed};

const RUNS: u32 = 400;

/// A hunt whose truth is drawn from the prior and drifts as the filter thinks.
struct Hunt {
    prior_sigma: f64,
    drift: f64,
    /// Distance of the flight from the prior mean, in metres.
    radius: f64,
    steps: u32,
    sigma_rss_db: f64,
    sigma_bearing: f64,
}

/// A good prior and a drone at a distance: next to linear over the prior, and nearly still.
const MILD: Hunt = Hunt {
    prior_sigma: 2.0,
    drift: 0.05,
    radius: 40.0,
    steps: 15,
    sigma_rss_db: 4.0,
    sigma_bearing: 0.1,
};

/// The reference's prior under a drone that flies through it: far from linear.
const WILD: Hunt =
    Hunt { prior_sigma: 8.4, radius: 8.0, steps: 20, sigma_bearing: 0.52, drift: 0.01, ..MILD };

/// A target that may be far beyond drones with sharp bearings: what one of them excludes all about
/// itself falls by hundreds of nats between two of the first cells.
const SHARP: Hunt = Hunt {
    prior_sigma: 50.0,
    radius: 15.0,
    steps: 4,
    sigma_rss_db: 8.0,
    sigma_bearing: 0.1,
    ..WILD
};

/// The NEES at the end of each run and the NIS there, run `i` from seed `i`.
fn normalised<E: Estimator<2, 2>>(
    hunt: &Hunt,
    make: impl Fn(RandomWalk<2>, RssBearing, Estimate<2>, u64) -> E,
) -> Vec<[f64; 2]> {
    let run = |seed: u64| {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut white = || -> State<2> { State::from_fn(|_, _| rng.sample(StandardNormal)) };
        let prior = Estimate::isotropic(Vector2::new(6.0, -3.0), hunt.prior_sigma);
        let mut truth = prior.mean + white() * hunt.prior_sigma;
        let mut filter = make(RandomWalk::uniform(hunt.drift), FIELD, prior, seed);
        let mut nis = f64::NAN;
        for step in 0..hunt.steps {
            truth += white() * hunt.drift;
            let around = 2.1 * f64::from(step);
            let place = prior.mean + Vector2::new(around.cos(), around.sin()) * hunt.radius;
            let receiver = Pose::at(place.x, place.y, 4.0);
            let noise = Vector2::new(hunt.sigma_rss_db, hunt.sigma_bearing).component_mul(&white());
            let z = FIELD.expected(&truth, &receiver) + noise;
            filter.predict(1.0).expect("a proper step");
            let observation = observed(receiver, z, hunt.sigma_rss_db, hunt.sigma_bearing);
            nis = filter.update(&observation).expect("possible").nis().expect("reported");
        }
        [filter.estimate().nees(&truth).expect("positive definite"), nis]
    };
    (0..u64::from(RUNS)).map(run).collect()
}

/// The average of each over the runs, at 99.9 %.
fn averages(normalised: &[[f64; 2]]) -> [ChiSquaredAverage; 2] {
    [0, 1].map(|i| {
        let mut average = ChiSquaredAverage::new(0.999).expect("in (0, 1)");
        average.extend(normalised.iter().map(|pair| (pair[i], 2)));
        average
    })
}

/// The averages lie in the interval that a consistent filter leaves once in 1000 times.
fn assert_consistent(name: &str, normalised: &[[f64; 2]]) {
    for (what, reported) in ["ANEES", "ANIS"].iter().zip(averages(normalised)) {
        let mean = reported.average();
        let interval = reported.interval();
        assert_eq!(
            reported.verdict(),
            Verdict::Consistent,
            "{name}: {what} {mean:?}, {interval:?}"
        );
    }
}

fn particles(
    motion: RandomWalk<2>,
    model: RssBearing,
    prior: Estimate<2>,
    seed: u64,
) -> ParticleFilter<RandomWalk<2>, RssBearing, Xoshiro256PlusPlus, 2, 2> {
    // Another stream than the truth's.
    let rng = Xoshiro256PlusPlus::seed_from_u64(seed + 1_000_000);
    ParticleFilter::new(motion, model, prior, 2000, rng).expect("a proper prior")
}

#[test]
fn every_estimator_is_consistent_where_the_model_is_nearly_linear() {
    let ekf = normalised(&MILD, |f, h, prior, _| Ekf::new(f, h, prior).expect("a proper prior"));
    assert_consistent("EKF", &ekf);
    let ukf = normalised(&MILD, |f, h, prior, _| Ukf::new(f, h, prior).expect("a proper prior"));
    assert_consistent("UKF", &ukf);
    assert_consistent("particle filter", &normalised(&MILD, particles));
}

#[test]
fn particles_and_cells_are_consistent_where_a_gaussian_is_not() {
    // E[NEES] = 2 for the exact posterior whatever its shape, but it is not χ²: the band is the
    // sample's own, 3.3 standard errors for a false alarm in 1000.
    let mean_and_error = |normalised: &[[f64; 2]]| {
        let [anees, _] = averages(normalised);
        (anees.average().expect("runs"), anees.standard_error().expect("runs"))
    };
    let (cloud, error) = mean_and_error(&normalised(&WILD, particles));
    assert!(abs_diff_eq!(cloud, 2.0, epsilon = 3.3 * error), "ANEES {cloud:.3} ± {error:.3}");
    let (grid, error) = mean_and_error(&normalised(&WILD, |f, h, prior, _| {
        GridFilter::new(f, h, prior, GridConfig::default()).expect("a proper prior")
    }));
    assert!(abs_diff_eq!(grid, 2.0, epsilon = 3.3 * error), "grid: ANEES {grid:.3} ± {error:.3}");
    let ekf = normalised(&WILD, |f, h, prior, _| Ekf::new(f, h, prior).expect("a proper prior"));
    let (linearised, _) = mean_and_error(&ekf);
    assert!(linearised > 2.5, "ANEES {linearised:.3}: this problem is too easy");
}

#[test]
fn cells_are_consistent_where_bearings_are_sharper_than_they() {
    let cells = |motion, model, prior, _| {
        GridFilter::new(motion, model, prior, GridConfig::default()).expect("a proper prior")
    };
    let [anees, _] = averages(&normalised(&SHARP, cells));
    let mean = anees.average().expect("runs");
    let error = anees.standard_error().expect("runs");
    // As above: not χ².
    assert!(abs_diff_eq!(mean, 2.0, epsilon = 3.3 * error), "ANEES {mean:.3} ± {error:.3}");
    // With a false peak beside one drone of 400 it is above 10.
    assert!(error < 0.5, "ANEES {mean:.3} ± {error:.3}");
}

#[test]
fn a_start_on_a_grid_repairs_what_a_wide_prior_costs() {
    // A prior four times as wide as the flight is.
    let far = Hunt { prior_sigma: 35.0, ..WILD };
    let iterations = Iterations::at_most(10).expect("at least one");
    let average =
        |normalised: &[[f64; 2]]| normalised.iter().map(|v| v[0]).sum::<f64>() / f64::from(RUNS);
    let alone = average(&normalised(&far, |f, h, prior, _| {
        Ckf::new(f, h, prior).expect("a proper prior").with_iterations(iterations)
    }));
    let started = average(&normalised(&far, |f, h, prior, _| {
        let grid = GridFilter::new(f, h, prior, GridConfig::default()).expect("a proper prior");
        Handover::new(grid, 8, move |first| Ok(Ckf::new(f, h, first)?.with_iterations(iterations)))
    }));
    // 6 standard errors of a χ²'s mean; what is left of the excess is linearisation after the
    // start.
    assert!(started < 2.0 + 6.0 * 2.0 / f64::from(RUNS).sqrt(), "ANEES {started:.3}");
    assert!(alone > 1.2 * started, "ANEES {alone:.3} against {started:.3}");
}

#[test]
fn a_receiver_that_errs_about_its_place_is_counted_in() {
    // GNSS of 2 m, flown 12 m from the target: as much as a bearing of 10° is off.
    let gnss = Vector3::new(2.0, 2.0, 0.0);
    let run = |reported: bool, kind: u8, seed: u64| {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut white = || -> f64 { rng.sample(StandardNormal) };
        let prior = Estimate::isotropic(Vector2::new(6.0, -3.0), 3.0);
        let truth = prior.mean + Vector2::new(white(), white()) * 3.0;
        let still = RandomWalk::uniform(0.0);
        let mut filter: Box<dyn Estimator<2, 2>> = match kind {
            0 => Box::new(Ckf::new(still, FIELD, prior).expect("a proper prior")),
            1 => Box::new(particles(still, FIELD, prior, seed)),
            _ => Box::new(
                GridFilter::new(still, FIELD, prior, GridConfig::default()).expect("proper"),
            ),
        };
        for step in 0..10 {
            let around = 2.1 * f64::from(step);
            let place = prior.mean + Vector2::new(around.cos(), around.sin()) * 12.0;
            let at = Pose::at(place.x, place.y, 4.0);
            let noise = Vector2::new(3.0 * white(), 0.05 * white());
            let z = FIELD.expected(&truth, &at) + noise;
            let mut believed = at;
            believed.position.x += gnss.x * white();
            believed.position.y += gnss.y * white();
            let mut observation = observed(believed, z, 3.0, 0.05);
            if reported {
                observation = observation.with_receiver_sigma(gnss).expect("not negative");
            }
            filter.predict(1.0).expect("a proper step");
            let _ = filter.update(&observation).expect("possible");
        }
        filter.estimate().nees(&truth).expect("positive definite")
    };
    let anees = |reported, kind, runs: u16| {
        let mut average = ChiSquaredAverage::new(0.999).expect("a probability");
        (0..runs).for_each(|seed| average.add(run(reported, kind, u64::from(seed)), 2));
        average
    };
    for (kind, runs) in [(0, 400), (1, 200), (2, 100)] {
        let counted = anees(true, kind, runs);
        let (average, [low, high]) = (counted.average(), counted.interval().expect("runs"));
        // To first order in the place's error, at 12 m: a tenth of room.
        let room = 0.9 * low..1.1 * high;
        assert!(room.contains(&average.expect("runs")), "{kind}: {average:?}, not in {room:?}");
    }
    let ignored = anees(false, 0, 400);
    assert!(ignored.average().expect("runs") > 4.0, "{ignored:?}: too little to matter");
}

#[test]
fn a_filter_that_knows_of_outliers_survives_them() {
    // One observation in five holds no information: any level within 100 dB, any bearing.
    let widths = [100.0, core::f64::consts::TAU];
    let outliers = OutlierMixture::new(0.2, widths).expect("a share and a volume");
    let anees = |robust: bool, share: f64| {
        let mut average = ChiSquaredAverage::new(0.999).expect("a probability");
        for seed in 0..u64::from(RUNS) {
            let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
            let prior = Estimate::isotropic(Vector2::new(6.0, -3.0), MILD.prior_sigma);
            let white = |rng: &mut Xoshiro256PlusPlus| rng.sample::<f64, _>(StandardNormal);
            let truth = prior.mean + Vector2::new(white(&mut rng), white(&mut rng)) * 2.0;
            let ckf = Ckf::new(RandomWalk::uniform(0.0), FIELD, prior).expect("a proper prior");
            let mut ckf = if robust { ckf.with_outliers(outliers) } else { ckf };
            for step in 0..15 {
                let around = 2.1 * f64::from(step);
                let place = prior.mean + Vector2::new(around.cos(), around.sin()) * 40.0;
                let at = Pose::at(place.x, place.y, 4.0);
                let expected = FIELD.expected(&truth, &at);
                let z = if rng.random::<f64>() < share {
                    let spread = Vector2::new(100.0, core::f64::consts::TAU);
                    expected + spread.map(|s| s * (rng.random::<f64>() - 0.5))
                } else {
                    expected + Vector2::new(4.0 * white(&mut rng), 0.1 * white(&mut rng))
                };
                let _ = ckf.update(&observed(at, z, 4.0, 0.1)).expect("possible");
            }
            average.add(ckf.estimate().nees(&truth).expect("positive definite"), 2);
        }
        average.average().expect("runs")
    };
    // Moments of a mixture: not exact, but a quarter off at most.
    let robust = anees(true, 0.2);
    assert!((1.5..2.5).contains(&robust), "ANEES {robust:.3}");
    assert!((1.5..2.5).contains(&anees(true, 0.0)), "without any outlier");
    assert!(anees(false, 0.2) > 20.0, "these outliers are too tame");
}
