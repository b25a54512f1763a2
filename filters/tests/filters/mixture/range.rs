use foxhunt_core::{
    Estimate, Pose, State,
    nalgebra::{Matrix2, Vector2},
};
use foxhunt_filters::RangeParameterised;

#[test]
fn every_component_has_the_same_coefficient_of_variation() {
    let receiver = Pose::at(30.0, -20.0, 5.0);
    let bearing = 2.3;
    let sigma = 0.02;
    let row =
        RangeParameterised::new(&receiver, (bearing, sigma), (50.0, 3200.0), 6).expect("proper");
    let along = Vector2::new(bearing.cos(), bearing.sin());
    let mut ratios = Vec::new();
    let mut end = 50.0;
    for (weight, place) in row.places() {
        let d = place.mean - receiver.position.xy();
        // The intervals adjoin: each is twice as long as the one before.
        let range = 1.5 * end;
        end *= 2.0;
        // exp(−σ² / 2) shortens a mean by 2 in 10⁴.
        assert!((d.norm() / range - 1.0).abs() < 3e-4, "{} {range}", d.norm());
        assert!((d.dot(&along) - d.norm()).abs() < 1e-9);
        let spread = along.dot(&(place.covariance * along)).sqrt();
        let across = Vector2::new(-along.y, along.x);
        let fan = across.dot(&(place.covariance * across)).sqrt();
        // E r² is (1 + the squared coefficient of variation) of the mean's square.
        assert!((fan / (sigma * range * (1.0_f64 + 1.0 / 27.0).sqrt()) - 1.0).abs() < 1e-3);
        ratios.push(spread / range);
        assert!((weight - 1.0).abs() < 1e-15);
    }
    // (2 − 1) / (1.5 √12)
    assert!(ratios.iter().all(|r| (r - 0.19245).abs() < 1e-3), "{ratios:?}");
    assert!((end - 3200.0).abs() < 1e-9);
}

#[test]
fn a_prior_of_the_range_weighs_and_the_rest_of_the_state_stays() {
    let row = RangeParameterised::new(&Pose::default(), (0.0, 0.1), (1.0, 8.0), 3)
        .and_then(|row| row.with_prior(|a, b| b - a))
        .expect("proper");
    let mut rest = Estimate::isotropic(State::<4>::from([9.0, 9.0, 1.0, -2.0]), 7.0);
    rest.covariance.fixed_view_mut::<2, 2>(2, 2).copy_from(&Matrix2::new(2.0, 0.5, 0.5, 1.0));
    rest.covariance[(0, 3)] = 0.1;
    rest.covariance[(3, 0)] = 0.1;
    let states = row.states(&rest);
    let weights: Vec<f64> = states.iter().map(|s| s.0).collect();
    assert!(weights.iter().zip([1.0, 2.0, 4.0]).all(|(w, e)| (w - e).abs() < 1e-12), "{weights:?}");
    for ((_, state), (_, place)) in states.iter().zip(row.places()) {
        assert_eq!(state.position(), place);
        assert_eq!(state.mean.fixed_rows::<2>(2), rest.mean.fixed_rows::<2>(2));
        assert_eq!(
            state.covariance.fixed_view::<2, 2>(2, 2),
            rest.covariance.fixed_view::<2, 2>(2, 2)
        );
        assert!(state.covariance.fixed_view::<2, 2>(0, 2).norm() <= 0.0, "no correlation");
    }
}

#[test]
fn improper_rows_are_refused() {
    let make = |bearing, interval, parts| {
        RangeParameterised::new(&Pose::default(), bearing, interval, parts).is_ok()
    };
    let bearing = (0.1, 0.1);
    let interval = (1.0, 9.0);
    assert!(make(bearing, interval, 1));
    assert!(!make((f64::NAN, 0.1), interval, 1) && !make((0.1, 0.0), interval, 1));
    for bad in [(0.0, 9.0), (9.0, 9.0), (9.0, 1.0), (1.0, f64::INFINITY), (f64::NAN, 9.0)] {
        assert!(!make(bearing, bad, 3), "{bad:?}");
    }
    assert!(!make(bearing, interval, 0) && !make(bearing, interval, 1001));
    let row = RangeParameterised::new(&Pose::default(), bearing, interval, 3).expect("proper");
    assert!(row.clone().with_prior(|_, _| 0.0).is_err());
    assert!(row.with_prior(|_, _| f64::NAN).is_err());
}
