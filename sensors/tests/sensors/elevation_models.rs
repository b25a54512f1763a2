//! Models with the antenna's vertical pattern: the laws, and the pattern's gain.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use core::f64::consts::{FRAC_PI_2, FRAC_PI_4};

use foxhunt_core::{MeasurementModel, Observation, Pose, State, laws};
use foxhunt_sensors::{
    Antenna, Dipole, ElevationPattern, FreePowerRssBearing, LogDistance, Patch, Rss, RssBearing,
    WithElevationPattern,
};
use nalgebra::{Matrix1, Matrix2, Vector1, Vector2, Vector4};
use proptest::prelude::*;

fn law() -> LogDistance {
    LogDistance::pritzl2018_field()
}

fn patch() -> Patch {
    Patch::new(1.2, 1.2, 17.0).expect("in range")
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn they_keep_the_laws_however_the_body_leans(
        (east, north, height) in (-200.0..200.0, -200.0..200.0, 2.0..60.0),
        range in 5.0..500.0, at in -4.0..4.0_f64, heading in -3.0..3.0,
        pitch in -0.5..0.5, roll in -0.5..0.5, up in -5.0..1.0, level in -100.0..-20.0,
    ) {
        let pose = Pose { heading, pitch, roll, ..Pose::at(east, north, height) };
        let place = Vector2::new(east + range * at.cos(), north + range * at.sin());
        let rss = Rss::new(law()).with_target_up(up).expect("finite");
        let pattern = ElevationPattern::of(&Dipole);
        let model = WithElevationPattern::new(rss, pattern).with_target_up(up).expect("finite");
        let z = Observation::new(3.0, pose, Vector1::new(level), Matrix1::new(9.0));
        laws::measurement_model::<2, 1>(&model, &place, &z.expect("proper"));
        let noise = Matrix2::new(36.0, 0.5, 0.5, 0.16);
        let z = Observation::new(3.0, pose, Vector2::new(level, 0.3), noise).expect("proper");
        let model = WithElevationPattern::new(RssBearing::new(law()), ElevationPattern::of(&Dipole));
        let moving = Vector4::new(place.x, place.y, 1.0, -2.0);
        laws::measurement_model::<4, 2>(&model, &moving, &z);
        let free = FreePowerRssBearing::new(2.5).expect("positive");
        let model = WithElevationPattern::new(free, ElevationPattern::of(&Dipole));
        laws::measurement_model::<3, 2>(&model, &State::<3>::new(place.x, place.y, -30.0), &z);
    }
}

#[test]
fn the_pattern_is_the_mean_over_the_turn() {
    let patch = patch();
    let pattern = ElevationPattern::of(&patch);
    for degree in -90_i8..=90 {
        let elevation = f64::from(degree).to_radians();
        let gain = patch.mean_gain_db(elevation) - patch.mean_gain_db(0.0);
        assert!(abs_diff_eq!(pattern.gain_db(elevation), gain, epsilon = 1e-9), "at {degree}°");
        let step = 1e-5;
        let numeric = (pattern.gain_db(elevation * 0.99 + step)
            - pattern.gain_db(elevation * 0.99 - step))
            / (2.0 * step);
        assert_abs_diff_eq!(
            pattern.slope(elevation * 0.99),
            numeric,
            epsilon = 1e-4 * (1.0 + numeric.abs())
        );
    }
    assert!(abs_diff_eq!(pattern.slope(FRAC_PI_2), 0.0, epsilon = 1e-6), "flat over the pole");
}

#[test]
fn a_body_that_leans_receives_off_its_horizon() {
    let model = WithElevationPattern::new(Rss::new(law()), ElevationPattern::of(&Dipole));
    let level = |pose: &Pose| -> f64 {
        let expected: Vector1<f64> = model.expected(&Vector2::new(40.0, 0.0), pose);
        expected[0]
    };
    let pose = Pose::at(0.0, 0.0, 40.0);
    let at_45 = Dipole.gain_dbi(0.0, FRAC_PI_4) - Dipole.gain_dbi(0.0, 0.0);
    let flat: Vector1<f64> = Rss::new(law()).expected(&Vector2::new(40.0, 0.0), &pose);
    assert_abs_diff_eq!(level(&pose) - flat[0], at_45, epsilon = 1e-6);
    // Nose down by 45°, the beacon is on the body's horizon.
    assert_abs_diff_eq!(level(&Pose { pitch: -FRAC_PI_4, ..pose }), flat[0], epsilon = 1e-9);
}

#[test]
fn nothing_is_nan_overhead_or_at_the_end_of_the_numbers() {
    let model = WithElevationPattern::new(RssBearing::new(law()), ElevationPattern::of(&patch()));
    for (pose, state) in [
        (Pose::at(3.0, -2.0, 4.0), Vector2::new(3.0, -2.0)),
        (Pose::at(3.0, -2.0, 0.0), Vector2::new(3.0, -2.0)),
        (Pose::at(-1e308, 1e308, 5.0), Vector2::new(1e308, -1e308)),
    ] {
        assert!(model.expected(&state, &pose).iter().all(|v| v.is_finite()));
        assert!(model.jacobian(&state, &pose).iter().all(|v| v.is_finite()));
    }
    let rss = Rss::new(law());
    let model = WithElevationPattern::new(rss, ElevationPattern::of(&Dipole));
    assert!(model.with_target_up(f64::NAN).is_err());
}

#[test]
fn without_a_pattern_it_is_the_model_inside() {
    let inside = RssBearing::new(law());
    let model = WithElevationPattern::from(inside);
    let (pose, state) = (Pose::at(1.0, 2.0, 40.0), Vector2::new(20.0, -3.0));
    assert_eq!(model.expected(&state, &pose), inside.expected(&state, &pose));
    assert_eq!(model.jacobian(&state, &pose), inside.jacobian(&state, &pose));
    let noise = Matrix2::new(36.0, 0.5, 0.5, 0.16);
    let z = Observation::new(3.0, pose, Vector2::new(-70.0, 0.3), noise).expect("proper");
    laws::measurement_model::<2, 2>(&model, &state, &z);
    assert_abs_diff_eq!(
        model.log_likelihood(&state, &z),
        inside.log_likelihood(&state, &z),
        epsilon = 1e-12
    );
    let free = model.map(FreePowerRssBearing::from);
    assert_eq!(free.model(), &FreePowerRssBearing::from(inside));
}
