//! A magnetic dipole of unknown moment under receivers of three axes.

use std::f64::consts::PI;

use foxhunt_core::{Correction, Estimate, Estimator, Observation, Pose, Quantity, laws};
use foxhunt_filters::MomentGrid;
use nalgebra::{Matrix3, Vector2, Vector3};
use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::{Distribution, StandardNormal};

const QUANTITIES: [Quantity; 3] =
    [Quantity::linear("x"), Quantity::linear("y"), Quantity::linear("z")];
/// Milliampere square metres.
const MOMENT_SIGMA: f64 = 12.0;
const PRIOR_SIGMA_M: f64 = 20.0;

/// H = (3 (m·d) d − m) / (4π r³), axis by axis.
fn field(place: &Vector2<f64>, receiver: &Pose) -> Matrix3<f64> {
    let [x, y, z] = (receiver.position - place.push(0.0)).into();
    let square = x * x + y * y + z * z;
    let scale = 1e3 / (4.0 * PI * square.powf(1.5));
    let own = |a: f64| 3.0 * a * a / square - 1.0;
    let mixed = |a: f64, b: f64| 3.0 * a * b / square;
    Matrix3::new(
        own(x),
        mixed(x, y),
        mixed(x, z),
        mixed(x, y),
        own(y),
        mixed(y, z),
        mixed(x, z),
        mixed(y, z),
        own(z),
    ) * scale
}

type Grid = MomentGrid<fn(&Vector2<f64>, &Pose) -> Matrix3<f64>>;

fn grid() -> Grid {
    let prior = Estimate::isotropic(Vector2::new(3.0, -2.0), PRIOR_SIGMA_M);
    MomentGrid::new(prior, MOMENT_SIGMA, QUANTITIES, field as fn(&_, &_) -> _).expect("proper")
}

struct Drawn {
    truth: Vector2<f64>,
    observations: Vec<Observation<3>>,
}

/// A beacon drawn from the prior, its moment, and what receivers at these places measure: noise of
/// 5 % of the field and 1 nA/m on each axis, each with a sign by chance.
fn drawn(rng: &mut Xoshiro256PlusPlus, places: &[[f64; 3]]) -> Drawn {
    let mut normal = || -> f64 { StandardNormal.sample(rng) };
    let truth = Vector2::new(3.0, -2.0) + Vector2::new(normal(), normal()) * PRIOR_SIGMA_M;
    let moment = Vector3::new(normal(), normal(), normal()) * MOMENT_SIGMA;
    let observations = places.iter().zip(0_u32..).map(|([x, y, z], n)| {
        let pose = Pose::at(*x, *y, *z);
        let field = field(&truth, &pose) * moment;
        let sigma = (0.05 * field.norm()).hypot(1e-3);
        let noise = Vector3::new(normal(), normal(), normal()) * sigma;
        let sign = if normal() < 0.0 { -1.0 } else { 1.0 };
        let z = (field + noise) * sign;
        Observation::new(f64::from(n), pose, z, Matrix3::identity() * sigma * sigma)
            .expect("proper")
    });
    Drawn { truth, observations: observations.collect() }
}

fn fused(grid: &mut Grid, observations: &[Observation<3>]) {
    for observation in observations {
        let correction = grid.update(observation).expect("proper");
        assert!(
            matches!(correction, Correction::Fused { log_evidence, .. } if log_evidence.is_finite())
        );
    }
}

/// A field that is the same at all places tells nothing of the place. A cell's own variance is a
/// part in 200 of the prior's.
#[test]
fn a_field_that_does_not_depend_on_the_place_leaves_the_prior() {
    let prior = Estimate::isotropic(Vector2::new(3.0, -2.0), PRIOR_SIGMA_M);
    let same = |_: &Vector2<f64>, _: &Pose| Matrix3::identity();
    let mut grid = MomentGrid::new(prior, MOMENT_SIGMA, QUANTITIES, same).expect("proper");
    let z = Vector3::new(1.0, -2.0, 3.0);
    let observation = Observation::new(0.0, Pose::default(), z, Matrix3::identity());
    let _ = grid.update(&observation.expect("proper")).expect("proper");
    let belief = grid.estimate();
    assert!((belief.mean - prior.mean).norm() < 1e-3 * PRIOR_SIGMA_M, "{}", belief.mean);
    let ratio = belief.covariance / (PRIOR_SIGMA_M * PRIOR_SIGMA_M);
    assert!((ratio - nalgebra::Matrix2::identity()).amax() < 0.02, "{ratio:?}");
}

/// Three receivers, 12 m up, that measure at three places each: 40 beacons drawn from the prior.
/// The sum of NEES has 80 degrees of freedom, its mean 1.28 to 2.91 (99 %).
/// After each reception 34 ellipses or more of 40 hold the beacon (99.6 %): the next move is
/// planned by each of them.
#[test]
fn a_dipole_of_unknown_moment_is_found_with_an_honest_ellipse() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(31);
    let mut places = Vec::new();
    for step in 0..3 {
        for drone in 0..3 {
            let angle = 2.0 * PI * f64::from(drone) / 3.0 + 0.4 * f64::from(step);
            let radius = 6.0 + 6.0 * f64::from(step);
            places.push([radius * angle.cos(), radius * angle.sin(), 12.0]);
        }
    }
    let mut nees = 0.0;
    let mut held = [0; 9];
    let mut errors = Vec::new();
    for _ in 0..40 {
        let Drawn { truth, observations } = drawn(&mut rng, &places);
        let mut grid = grid();
        for (observation, held) in observations.iter().zip(&mut held) {
            fused(&mut grid, std::slice::from_ref(observation));
            *held += u32::from(grid.estimate().nees(&truth).expect("definite") < 5.99);
        }
        let estimate = grid.estimate();
        nees += estimate.nees(&truth).expect("definite") / 40.0;
        errors.push((estimate.mean - truth).norm());
    }
    errors.sort_by(f64::total_cmp);
    assert!((1.28..2.91).contains(&nees), "ANEES {nees}");
    assert!(held.iter().all(|held| *held >= 34), "{held:?}");
    assert!(errors[20] < 1.0, "median {} m", errors[20]);
}

/// One reception holds a range of the plane and no place; its sign makes no difference, nor does
/// the order of receptions.
#[test]
fn signs_and_order_make_no_difference() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(5);
    let places = [[0.0, 0.0, 10.0], [9.0, 0.0, 11.0], [0.0, 9.0, 10.0], [-8.0, -5.0, 12.0]];
    let Drawn { observations, .. } = drawn(&mut rng, &places);
    let turned = observations.iter().rev().map(|observation| {
        let time = observation.time();
        let pose = *observation.receiver();
        Observation::new(time, pose, -observation.value(), observation.noise()).expect("proper")
    });
    let [mut one, mut other] = [grid(), grid()];
    fused(&mut one, &observations);
    fused(&mut other, &turned.collect::<Vec<_>>());
    let [a, b] = [one.estimate(), other.estimate()];
    assert!((a.mean - b.mean).norm() < 0.05 * a.covariance.trace().sqrt(), "{a:?} {b:?}");
    let mut first = grid();
    fused(&mut first, &observations[..1]);
    let spread = first.estimate().covariance.trace().sqrt();
    assert!(spread > 5.0 && spread > 3.0 * a.covariance.trace().sqrt(), "{spread}");
}

#[test]
fn it_keeps_the_laws_of_estimators() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(8);
    let Drawn { observations, .. } = drawn(&mut rng, &[[5.0, 3.0, 8.0]]);
    laws::estimator_with(grid, &observations[0], laws::Checks::AT_ONE_OBSERVATION);
}
