//! The exported laws over every measurement model, and their values at the singularities.

use approx::assert_abs_diff_eq;
use foxhunt_core::{MeasurementModel, Observation, Pose, State, laws};
use foxhunt_sensors::{
    BearingOnly, FreePathLossRssBearing, FreePowerRssBearing, Friis, LogDistance, ParameterError,
    Propagation, Rss, RssBearing,
};
use nalgebra::{Matrix1, Matrix2, Vector1, Vector2, Vector4};
use proptest::prelude::*;

/// A receiver between 2 and 60 m up, and a target 5 to 500 m away from it over ground. Nearer, the
/// law's finite differences err by more than it allows.
fn scene() -> impl Strategy<Value = (Pose, [f64; 2])> {
    let pose = (-200.0..200.0, -200.0..200.0, 2.0..60.0);
    (pose, 5.0..500.0, -4.0..4.0_f64).prop_map(|((east, north, up), range, at)| {
        (Pose::at(east, north, up), [east + range * at.cos(), north + range * at.sin()])
    })
}

/// An observation with correlated noise, any of whose components may be missing.
fn pair(receiver: Pose, z: (f64, f64), rho: f64, missing: u8) -> Observation<2> {
    let coupling = rho * 6.0 * 0.4;
    let noise = Matrix2::new(36.0, coupling, coupling, 0.16);
    let whole = Observation::new(3.0, receiver, Vector2::new(z.0, z.1), noise).expect("proper");
    (0..2).filter(|i| missing >> i & 1 == 1).fold(whole, Observation::without)
}

fn single(receiver: Pose, z: f64) -> Observation<1> {
    Observation::new(3.0, receiver, Vector1::new(z), Matrix1::new(0.3)).expect("proper")
}

proptest! {
    #[test]
    fn models_with_one_component_keep_the_laws(
        (receiver, [x, y]) in scene(), dbm in -100.0..-20.0, bearing in -3.2..3.2, up in -5.0..1.0,
    ) {
        let state = Vector2::new(x, y);
        let rss = Rss::new(LogDistance::pritzl2018_field()).with_target_up(up).expect("finite");
        laws::measurement_model::<2, 1>(&rss, &state, &single(receiver, dbm));
        let friis = Rss::new(Friis::new(0.0, 2.0, 8.0, 0.125).expect("proper"));
        laws::measurement_model::<2, 1>(&friis, &state, &single(receiver, dbm));
        let moving = Vector4::new(x, y, 1.0, -2.0);
        let z = single(receiver, bearing);
        laws::measurement_model::<2, 1>(&BearingOnly::new(), &state, &z);
        laws::measurement_model::<4, 1>(&BearingOnly::isaacs2014(), &moving, &z);
    }

    #[test]
    fn models_with_two_components_keep_the_laws(
        (receiver, [x, y]) in scene(), z in (-100.0..-20.0, -3.2..3.2), rho in -0.9..0.9,
        missing in 0_u8..4, power in -60.0..0.0, exponent in 1.5..4.0, up in -5.0..1.0,
    ) {
        let z = pair(receiver, z, rho, missing);
        let law = LogDistance::new(power, exponent).expect("in range");
        let model = RssBearing::new(law).with_target_up(up).expect("finite");
        laws::measurement_model::<2, 2>(&model, &Vector2::new(x, y), &z);
        laws::measurement_model::<4, 2>(&model, &Vector4::new(x, y, 1.0, -2.0), &z);
        let model = FreePowerRssBearing::new(exponent).expect("positive");
        let model = model.with_target_up(up).expect("finite");
        laws::measurement_model::<3, 2>(&model, &State::<3>::new(x, y, power), &z);
        let moving = State::<5>::from_column_slice(&[x, y, 1.0, -2.0, power]);
        laws::measurement_model::<5, 2>(&model, &moving, &z);
        let model = FreePathLossRssBearing::new().with_target_up(up).expect("finite");
        laws::measurement_model::<4, 2>(&model, &Vector4::new(x, y, power, exponent), &z);
    }

    /// The free models at the true law are the model that knows it.
    #[test]
    fn the_free_models_agree_with_the_calibrated_one(
        (receiver, [x, y]) in scene(), power in -60.0..0.0, exponent in 1.5..4.0,
    ) {
        let known = RssBearing::new(LogDistance::new(power, exponent).expect("in range"));
        let h = known.expected(&Vector2::new(x, y), &receiver);
        let free = FreePowerRssBearing::new(exponent).expect("positive");
        let one = free.expected(&State::<3>::new(x, y, power), &receiver);
        let two = FreePathLossRssBearing::new();
        let two = two.expected(&Vector4::new(x, y, power, exponent), &receiver);
        prop_assert!((one - h).amax() < 1e-12 && (two - h).amax() < 1e-12);
    }

    #[test]
    fn slopes_are_the_derivatives(range in 0.01..5000.0, wavelength in 0.01..3.0) {
        let friis = Friis::new(10.0, 1.0, 2.0, wavelength).expect("proper");
        let laws: [&dyn Propagation; 2] = [&friis, &LogDistance::pritzl2018_urban()];
        for law in laws {
            // Central differences over a hundred-thousandth of the range err by a part in 1e10.
            let step = 1e-5 * range;
            let numeric = (law.rss_dbm(range + step) - law.rss_dbm(range - step)) / (2.0 * step);
            prop_assert!((law.slope(range) / numeric - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn laws_are_finite_at_every_range_and_flat_where_they_are_cut_off() {
    let friis = Friis::new(0.0, 0.0, 0.0, 0.125).expect("proper");
    let laws: [&dyn Propagation; 2] = [&friis, &LogDistance::pritzl2018_field()];
    for law in laws {
        for range in [0.0, 1e-300, 1e-3, 1.0, 1e300, f64::MAX, f64::INFINITY] {
            assert!(law.rss_dbm(range).is_finite() && law.slope(range).is_finite(), "{range}");
        }
        assert_abs_diff_eq!(law.slope(0.0), 0.0, epsilon = 1e-300);
        assert_abs_diff_eq!(law.slope(f64::INFINITY), 0.0, epsilon = 1e-300);
        assert_abs_diff_eq!(law.rss_dbm(0.0), law.rss_dbm(1e-3), epsilon = 1e-12);
    }
}

/// The published figures, so that a preset cannot change unseen.
#[test]
fn presets_are_the_published_laws() {
    let (field, urban) = (LogDistance::pritzl2018_field(), LogDistance::pritzl2018_urban());
    assert_eq!(Ok(field), LogDistance::new(-29.06, 2.765));
    assert_eq!(Ok(urban), LogDistance::new(-33.96, 3.0));
    assert_abs_diff_eq!(urban.rss_dbm(10.0), -63.96, epsilon = 1e-12);
}

#[test]
fn overhead_a_bearing_gives_no_information_and_nothing_is_nan() {
    let model = RssBearing::new(LogDistance::pritzl2018_field());
    for up in [0.0, 4.0] {
        let receiver = Pose::at(3.0, -2.0, up);
        let above = Vector2::new(3.0, -2.0);
        let jacobian = model.jacobian(&above, &receiver);
        assert!(jacobian.amax() < 1e-300, "overhead the Jacobian is {jacobian}");
        assert!(model.expected(&above, &receiver).iter().all(|v| v.is_finite()));
        // A hand's breadth beside it, the bearing has its slope again: 1/r.
        let jacobian = model.jacobian(&Vector2::new(3.1, -2.0), &receiver);
        assert_abs_diff_eq!(jacobian[(1, 1)], 10.0, epsilon = 1e-9);
    }
}

#[test]
fn states_at_the_end_of_the_numbers_give_numbers() {
    let receiver = Pose::at(-1e308, 1e308, 5.0);
    let state = Vector4::new(1e308, -1e308, -30.0, 2.0);
    let (model, free) =
        (RssBearing::new(LogDistance::pritzl2018_field()), FreePathLossRssBearing::new());
    let models: [&dyn MeasurementModel<4, 2>; 2] = [&model, &free];
    for model in models {
        assert!(model.expected(&state, &receiver).iter().all(|v| v.is_finite()));
        assert!(model.jacobian(&state, &receiver).iter().all(|v| v.is_finite()));
    }
}

#[test]
fn what_is_out_of_range_is_refused_with_its_value() {
    for exponent in [0.0, -2.0, f64::INFINITY] {
        let refused =
            ParameterError { name: "exponent", value: exponent, requirement: "a positive number" };
        assert_eq!(LogDistance::new(-30.0, exponent), Err(refused));
        assert_eq!(FreePowerRssBearing::new(exponent), Err(refused));
    }
    assert!(LogDistance::new(f64::NAN, 2.0).is_err());
    assert!(BearingOnly::new().with_outliers(1.0).is_err());
    assert!(BearingOnly::new().with_bias(f64::INFINITY).is_err());
    assert!(Rss::new(LogDistance::pritzl2018_field()).with_target_up(f64::NAN).is_err());
}
