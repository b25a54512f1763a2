//! Whatever comes in: a proper estimate, or an error that leaves the belief as it was.

use foxhunt_core::{Estimate, Estimator, Pose, RandomWalk, State};
use foxhunt_filters::{
    BatchEstimator, BatchSolver, BearingLine, BearingWeights, Lenth1981, Loss, SlantRange,
    SlantRangeDifference, instrumental_variables, multilaterate, pseudolinear, repeated_median,
    spherical_intersection, stansfield,
};
use nalgebra::{Vector2, Vector3};
use proptest::prelude::*;

use super::model::{MODEL, observed};

fn assert_proper<const N: usize>(estimate: &Estimate<N>) {
    assert!(estimate.mean.iter().all(|c| c.is_finite()), "{estimate:?}");
    assert!(estimate.covariance.cholesky().is_some(), "{estimate:?}");
}

/// From a millionth to a million, either sign.
fn wide() -> impl Strategy<Value = f64> {
    (-6.0..6.0_f64, any::<bool>())
        .prop_map(|(exponent, sign)| 10_f64.powf(exponent) * if sign { 1.0 } else { -1.0 })
}

/// Whole metres of a small square, so that places coincide.
fn near() -> impl Strategy<Value = Vector3<f64>> {
    (-3..4_i8, -3..4_i8, 0..3_i8)
        .prop_map(|(x, y, z)| Vector3::new(f64::from(x), f64::from(y), f64::from(z)))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn the_recursive_face_stands_anything(
        steps in prop::collection::vec((near(), wide(), -4.0..4.0, wide(), wide(), 0_u8..4), 1..8),
        sigma in wide(), drift in wide(), loss in 0_u8..4,
    ) {
        let prior = Estimate::isotropic(Vector2::new(1.0, -2.0), sigma.abs());
        let loss = match loss {
            0 => Loss::Gaussian,
            1 => Loss::Huber { k: 1.3 },
            2 => Loss::Cauchy { c: 2.4 },
            _ => Loss::StudentT { degrees: 3.0 },
        };
        let mut estimator = BatchEstimator::new(RandomWalk::uniform(drift.abs()), MODEL, prior)
            .and_then(|estimator| estimator.with_loss(loss))
            .expect("proper");
        for (place, level, bearing, level_sigma, bearing_sigma, missing) in steps {
            let receiver = Pose::at(place.x, place.y, place.z);
            let sigmas = Vector2::new(level_sigma.abs(), bearing_sigma.abs());
            let whole = observed(receiver, Vector2::new(level, bearing), sigmas);
            let z = (0..2).filter(|i| missing >> i & 1 == 1).fold(whole, |z, i| z.without(i));
            let before = estimator.estimate();
            if estimator.predict(1.0).is_err() {
                prop_assert_eq!(estimator.estimate(), before);
            }
            let before = estimator.estimate();
            if estimator.update(&z).is_err() {
                prop_assert_eq!(estimator.estimate(), before);
            }
            assert_proper(&estimator.estimate());
        }
    }

    #[test]
    fn the_solver_reports_a_proper_place_or_why_not(
        received_of in prop::collection::vec((near(), -120.0..0.0, -4.0..4.0), 1..8),
        start in (wide(), wide(), wide()),
    ) {
        let observations: Vec<_> = received_of
            .iter()
            .map(|(place, level, bearing)| {
                let receiver = Pose::at(place.x, place.y, place.z);
                observed(receiver, Vector2::new(*level, *bearing), Vector2::new(3.0, 0.2))
            })
            .collect();
        let start = State::<3>::new(start.0, start.1, start.2);
        let solver = BatchSolver::new(MODEL).with_reach(1000.0).expect("positive");
        if let Ok(fix) = solver.solve(&observations, &[start]) {
            assert_proper(&fix.estimate);
            prop_assert!(fix.log_posterior.is_finite());
            prop_assert_eq!(fix.weights.len(), observations.len());
            let places = observations.iter().map(|o| o.receiver().position.xy());
            let count = u8::try_from(observations.len()).expect("few") + 1;
            let middle = (places.sum::<Vector2<f64>>() + start.xy()) / f64::from(count);
            prop_assert!((fix.estimate.mean.xy() - middle).norm() <= 1000.0);
        }
    }

    #[test]
    fn closed_forms_report_a_proper_place_or_why_not(
        received_of in prop::collection::vec((near(), -4.0..4.0, wide(), wide()), 0..8),
    ) {
        let line = |(place, bearing, ..): &(Vector3<f64>, f64, f64, f64)| {
            BearingLine { receiver: place.xy(), bearing: (bearing * 2.0).round() / 2.0 }
        };
        let lines: Vec<_> = received_of.iter().map(line).collect();
        let even = Lenth1981::maximum_likelihood();
        for weights in [
            BearingWeights::Even,
            BearingWeights::Huber { c: 1.5 },
            BearingWeights::Andrews { c: 1.5 },
        ] {
            if let Ok(fix) = even.with_weights(weights).expect("in range").locate(&lines) {
                assert_proper(&fix.position);
                prop_assert!(fix.kappa > 0.0);
            }
        }
        if let Ok(fix) = repeated_median(&lines) {
            assert_proper(&fix.position);
        }
        let with_sigma: Vec<_> =
            lines.iter().zip(&received_of).map(|(line, h)| (*line, h.2.abs())).collect();
        for closed_form in [pseudolinear, stansfield, instrumental_variables] {
            if let Ok(fix) = closed_form(&with_sigma) {
                assert_proper(&fix);
            }
        }
        let ranges: Vec<_> = received_of
            .iter()
            .map(|h| SlantRange { receiver: h.0, range: h.2.abs(), sigma: h.3.abs() })
            .collect();
        if let Ok(fix) = multilaterate(&ranges, &[], 0.0) {
            assert_proper(&fix.estimate);
        }
        let differences: Vec<_> = received_of
            .iter()
            .map(|h| SlantRangeDifference { receiver: h.0, difference: h.2, sigma: h.3.abs() })
            .collect();
        if let Ok(places) = spherical_intersection(Vector3::new(0.0, 1.0, 1.0), &differences, 0.0) {
            prop_assert!(!places.is_empty());
            prop_assert!(places.iter().all(|place| place.iter().all(|c| c.is_finite())));
        }
    }
}
