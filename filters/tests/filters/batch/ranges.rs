//! Ranges and range differences against the Cramér-Rao bound.

use foxhunt_core::{MeasurementModel, Observation, Pose, Quantity, State, numeric_jacobian};
use foxhunt_filters::{
    BatchError, BatchSolver, SlantRange, SlantRangeDifference, multilaterate,
    spherical_intersection,
};
use nalgebra::{Matrix1, Matrix2, Matrix3, Vector1, Vector2, Vector3};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;

use super::model::round;

const UP: f64 = 1.5;

fn white(rng: &mut Xoshiro256PlusPlus) -> f64 {
    rng.sample(StandardNormal)
}

/// A place in and about the receivers' rectangle.
fn place(rng: &mut Xoshiro256PlusPlus) -> Vector2<f64> {
    Vector2::new(-40.0 + 280.0 * rng.random::<f64>(), -30.0 + 180.0 * rng.random::<f64>())
}

/// The trace of the inverse of Σ ∇h ∇hᵀ / σ².
fn bound(truth: &State<2>, slopes: impl Iterator<Item = (Vector2<f64>, f64)>) -> f64 {
    let mut information = Matrix2::zeros();
    for (slope, sigma) in slopes {
        information += slope * slope.transpose() / (sigma * sigma);
    }
    let inverse = information.cholesky().unwrap_or_else(|| panic!("flat at {truth}")).inverse();
    inverse.trace()
}

/// Seed 31, 400 runs of 12 ranges with σ = 2 … 6 m: the squared error's sum over the bound's has a
/// standard error of about 1/√400 = 5 %.
#[test]
fn ranges_reach_the_bound() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(31);
    let mut error = 0.0;
    let mut limit = 0.0;
    for _ in 0..400 {
        let truth = place(&mut rng);
        let ranges: Vec<_> = round(12)
            .iter()
            .map(|r| {
                let sigma = 2.0 + 4.0 * rng.random::<f64>();
                let range = (truth.push(UP) - r.position).norm() + sigma * white(&mut rng);
                SlantRange { receiver: r.position, range, sigma }
            })
            .collect();
        let fix = multilaterate(&ranges, &[], UP).expect("a fix");
        error += (fix.estimate.mean - truth).norm_squared();
        limit += bound(
            &truth,
            ranges.iter().map(|r| {
                let way = truth.push(UP) - r.receiver;
                (way.xy() / way.norm(), r.sigma)
            }),
        );
    }
    println!("root mean square over the bound {:.3}", (error / limit).sqrt());
    assert!((error / limit).sqrt() < 1.15, "{error} over {limit}");
}

#[test]
fn receivers_on_a_line_see_two_places_alike() {
    let truth = Vector2::new(60.0, 45.0);
    let ranges: Vec<_> = (0..6)
        .map(|i| Vector3::new(20.0 * f64::from(i), 0.0, 30.0))
        .map(|receiver| SlantRange {
            receiver,
            range: (truth.push(UP) - receiver).norm(),
            sigma: 2.0,
        })
        .collect();
    let fix = multilaterate(&ranges, &[], UP).expect("a fix");
    let [(rival, behind)] = fix.rivals[..] else { panic!("{:?}", fix.rivals) };
    assert!((fix.estimate.mean.abs() - truth).norm() < 1e-6, "{fix:?}");
    assert!((rival.abs() - truth).norm() < 1e-6 && behind.abs() < 1e-9);
    assert!((rival - fix.estimate.mean).norm() > 89.0);
}

#[test]
fn improper_ranges_are_refused() {
    let good = |east: f64, north: f64| SlantRange {
        receiver: Vector3::new(east, north, 30.0),
        range: 80.0,
        sigma: 2.0,
    };
    let three = [good(0.0, 0.0), good(50.0, 0.0), good(0.0, 50.0)];
    assert!(multilaterate(&three, &[], UP).is_ok());
    assert!(matches!(multilaterate(&three[..2], &[], UP), Err(BatchError::TooFew { need: 3, .. })));
    assert!(matches!(multilaterate(&three, &[], f64::NAN), Err(BatchError::Parameter(_))));
    let one_place = [good(7.0, 7.0); 3];
    assert!(matches!(multilaterate(&one_place, &[], UP), Err(BatchError::Flat { .. })));
    for value in [0.0, f64::NAN, 1e-200] {
        let bad = [three[0], three[1], SlantRange { sigma: value, ..three[2] }];
        assert!(matches!(multilaterate(&bad, &[], UP), Err(BatchError::Value { index: 2, .. })));
    }
    let bad = [three[0], SlantRange { range: f64::INFINITY, ..three[1] }, three[2]];
    assert!(matches!(multilaterate(&bad, &[], UP), Err(BatchError::Value { index: 1, .. })));
}

/// z = d − d₀.
#[derive(Clone, Copy)]
struct Difference {
    reference: Vector3<f64>,
}

impl MeasurementModel<2, 1> for Difference {
    fn quantities(&self) -> [Quantity; 1] {
        [Quantity::RANGE_DIFFERENCE]
    }
    fn expected(&self, target: &State<2>, receiver: &Pose) -> Vector1<f64> {
        let range = |from: &Vector3<f64>| (target.push(UP) - from).norm();
        Vector1::new(range(&receiver.position) - range(&self.reference))
    }
}

/// Each emission is observed by the reference and a receiver that goes round.
fn differences(
    rng: &mut Xoshiro256PlusPlus,
    model: Difference,
    truth: &State<2>,
    sigma: f64,
) -> Vec<SlantRangeDifference> {
    let observe = |r: &Pose| {
        let difference = model.expected(truth, r)[0] + sigma * white(rng);
        SlantRangeDifference { receiver: r.position, difference, sigma: sigma.max(1.0) }
    };
    round(10).iter().map(observe).collect()
}

fn observation(d: &SlantRangeDifference) -> Observation<1> {
    let receiver = Pose::at(d.receiver.x, d.receiver.y, d.receiver.z);
    let noise = Matrix1::new(d.sigma * d.sigma);
    Observation::new(0.0, receiver, Vector1::new(d.difference), noise).expect("proper")
}

/// Seed 32, 400 runs, ten places of the second receiver, σ = 3 m (10 ns): within 1.15 of the bound.
#[test]
fn range_differences_reach_the_bound() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(32);
    let model = Difference { reference: Vector3::new(90.0, 50.0, 10.0) };
    let mut error = 0.0;
    let mut limit = 0.0;
    let mut astray = 0;
    for _ in 0..400 {
        let truth = place(&mut rng);
        let observed = differences(&mut rng, model, &truth, 3.0);
        let starts = spherical_intersection(model.reference, &observed, UP).expect("starts");
        astray += u32::from((starts[0] - truth).norm() > 30.0);
        let observations: Vec<_> = observed.iter().map(observation).collect();
        let fix = BatchSolver::new(model).solve(&observations, &starts).expect("an optimum");
        error += (fix.estimate.mean - truth).norm_squared();
        limit += bound(
            &truth,
            observations.iter().map(|o| {
                let h = |x: &State<2>| model.expected(x, o.receiver());
                (numeric_jacobian(&truth, h, |a, b| a - b).transpose(), 3.0)
            }),
        );
    }
    println!("root mean square over the bound {:.3}, {astray} starts", (error / limit).sqrt());
    // The closed form alone is poor near the reference.
    assert!(astray < 10, "{astray} of 400 starts are more than 30 m off");
    assert!((error / limit).sqrt() < 1.15, "{error} over {limit}");
}

#[test]
fn exact_differences_give_the_place_in_closed_form() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(33);
    let model = Difference { reference: Vector3::new(90.0, 50.0, 10.0) };
    for _ in 0..100 {
        let truth = place(&mut rng);
        let exact = differences(&mut rng, model, &truth, 0.0);
        let starts = spherical_intersection(model.reference, &exact, UP).expect("starts");
        assert!((starts[0] - truth).norm() < 1e-6, "{starts:?} for {truth}");
        // Two differences are enough, but for a second place.
        let two = spherical_intersection(model.reference, &exact[1..3], UP).expect("starts");
        let nearest = two.iter().map(|s| (s - truth).norm()).fold(f64::INFINITY, f64::min);
        assert!(nearest < 1e-5, "{two:?} for {truth}");
    }
    let line: Vec<_> = (1..5)
        .map(|i| SlantRangeDifference {
            receiver: Vector3::new(90.0 + 10.0 * f64::from(i), 50.0, 10.0),
            difference: 1.0,
            sigma: 1.0,
        })
        .collect();
    let refused = spherical_intersection(model.reference, &line, UP);
    assert!(matches!(refused, Err(BatchError::Flat { .. })), "{refused:?}");
    let few = spherical_intersection(model.reference, &line[..1], UP);
    assert!(matches!(few, Err(BatchError::TooFew { need: 2, .. })));
    let bad = [line[0], SlantRangeDifference { sigma: -1.0, ..line[1] }];
    let bad = spherical_intersection(model.reference, &bad, UP);
    assert!(matches!(bad, Err(BatchError::Value { index: 1, .. })));
}

/// Five differences, two of them ten times less certain, and errors that fit no place: the place
/// that takes the reference's range for an unknown of its own is the weighted solution of the
/// linear equations 2 (p · x + d r₀) = |p|² + h² − u² − d², written out here as A x = b.
#[test]
fn differences_weigh_by_their_inverse_variance() {
    let reference = Vector3::new(10.0, -5.0, 30.0);
    let truth = Vector3::new(70.0, 45.0, UP);
    let range = |from: &Vector3<f64>| (truth - from).norm();
    let receivers = [[0.0, 0.0], [200.0, 0.0], [200.0, 120.0], [0.0, 120.0], [100.0, 150.0]];
    let errors = [0.4, -12.0, 0.6, 9.0, -0.8];
    let differences: Vec<_> = receivers
        .iter()
        .zip(errors)
        .map(|([east, north], error): (_, f64)| {
            let receiver = Vector3::new(*east, *north, 30.0);
            let difference = range(&receiver) - range(&reference) + error;
            let sigma = if error.abs() > 1.0 { 10.0 } else { 1.0 };
            SlantRangeDifference { receiver, difference, sigma }
        })
        .collect();
    // Rows and right-hand sides in units of their σ; the normal equations by hand.
    let mut square = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for d in &differences {
        let p = d.receiver - reference;
        let above = UP - d.receiver.z;
        let row = Vector3::new(p.x, p.y, d.difference) / d.sigma;
        let known = p.xy().norm_squared() + above * above - (UP - reference.z).powi(2);
        let known = 0.5 * (known - d.difference * d.difference) / d.sigma;
        square += row * row.transpose();
        right += row * known;
    }
    let solved = square.lu().solve(&right).expect("regular");
    let expected = reference.xy() + solved.xy();
    let places = spherical_intersection(reference, &differences, UP).expect("places");
    let nearest = places.iter().map(|p| (p - expected).norm()).fold(f64::INFINITY, f64::min);
    assert!(nearest < 1e-6, "{places:?} without {expected}");
}
