//! Differences of two receivers, stacked models and silence.

use approx::assert_abs_diff_eq;
use core::f64::consts::TAU;

use foxhunt_core::{Axis, MeasurementModel, Observation, Pose, Quantity, State, laws};
use foxhunt_sensors::{
    BearingOnly, Censored, DifferentialRss, Dipole, ElevationPattern, FreePathLossRssBearing,
    FreePowerRssBearing, LogDistance, ParameterError, RangeDifference, Rss, RssBearing, Stacked,
    WithElevationPattern,
};
use nalgebra::{Matrix1, Matrix2, Matrix3, Vector1, Vector2, Vector3};
use proptest::prelude::*;

/// A receiver between 2 and 60 m up, and a target 5 to 500 m away from it over ground.
fn scene() -> impl Strategy<Value = (Pose, [f64; 2])> {
    let pose = (-200.0..200.0, -200.0..200.0, 2.0..60.0);
    (pose, 5.0..500.0, -4.0..4.0_f64).prop_map(|((east, north, up), range, at)| {
        (Pose::at(east, north, up), [east + range * at.cos(), north + range * at.sin()])
    })
}

fn single(receiver: Pose, z: f64) -> Observation<1> {
    Observation::new(3.0, receiver, Vector1::new(z), Matrix1::new(0.3)).expect("proper")
}

fn pair(receiver: Pose, z: [f64; 2], coupling: f64) -> Observation<2> {
    let noise = Matrix2::new(36.0, coupling, coupling, 0.16);
    Observation::new(3.0, receiver, Vector2::from(z), noise).expect("proper")
}

proptest! {
    #[test]
    fn differences_keep_the_laws(
        (receiver, [x, y]) in scene(), z in -30.0..30.0, up in -5.0..1.0, exponent in 1.5..4.0,
    ) {
        let reference = Vector3::new(350.0, -620.0, 12.0);
        let (state, z) = (Vector2::new(x, y), single(receiver, z));
        let range = RangeDifference::new(reference).and_then(|m| m.with_target_up(up));
        laws::measurement_model::<2, 1>(&range.expect("finite"), &state, &z);
        let level = DifferentialRss::new(reference, exponent).and_then(|m| m.with_target_up(up));
        let moving = State::<4>::new(x, y, 1.0, -2.0);
        laws::measurement_model::<4, 1>(&level.expect("proper"), &moving, &z);
    }

    #[test]
    fn stacks_keep_the_laws(
        (receiver, [x, y]) in scene(), dbm in -100.0..-20.0, bearing in -3.2..3.2,
        difference in -200.0..200.0, missing in 0_u8..8, coupling in -1.0..1.0,
    ) {
        let level = Rss::new(LogDistance::pritzl2018_field());
        let range = RangeDifference::new(Vector3::new(9.0, 7.0, 2.0)).expect("finite");
        let pair = Stacked::<_, _, 1, 1>::new(level, BearingOnly::isaacs2014());
        let three = Stacked::<_, _, 2, 1>::new(pair, range);
        let noise = Matrix3::new(36.0, coupling, 0.0, coupling, 0.16, 0.0, 0.0, 0.0, 4.0);
        let value = Vector3::new(dbm, bearing, difference);
        let z = Observation::new(3.0, receiver, value, noise).expect("proper");
        let z = (0..3).filter(|i| missing >> i & 1 == 1).fold(z, Observation::without);
        laws::measurement_model::<2, 3>(&three, &Vector2::new(x, y), &z);
        let coupled = Matrix3::new(36.0, 0.0, 2.0, 0.0, 0.16, 0.0, 2.0, 0.0, 4.0);
        let z = Observation::new(3.0, receiver, value, coupled).expect("proper");
        laws::measurement_model::<2, 3>(&three, &Vector2::new(x, y), &z);
    }

    #[test]
    fn silence_keeps_the_laws(
        (receiver, [x, y]) in scene(), floor in -100.0..-40.0, bearing in -3.2..3.2,
        power in -60.0..0.0, silent in 0_u8..4,
    ) {
        let z = pair(receiver, [floor, bearing], 0.0);
        let z = (0..2).filter(|i| silent >> i & 1 == 1).fold(z, Observation::below);
        let known = Censored::new(RssBearing::new(LogDistance::pritzl2018_field()));
        laws::measurement_model::<2, 2>(&known, &Vector2::new(x, y), &z);
        let free = Censored::new(FreePowerRssBearing::new(2.5).expect("positive"));
        laws::measurement_model::<3, 2>(&free, &Vector3::new(x, y, power), &z);
    }

    /// A stack of level and bearing is the model of both.
    #[test]
    fn a_stack_is_the_model_of_both(
        (receiver, [x, y]) in scene(), z in (-100.0..-20.0, -3.2..3.2), coupling in -2.0..2.0,
        missing in 0_u8..4,
    ) {
        let law = LogDistance::pritzl2018_field();
        let stack = Stacked::<_, _, 1, 1>::new(Rss::new(law), BearingOnly::new());
        let (both, state) = (RssBearing::new(law), Vector2::new(x, y));
        for coupling in [0.0, coupling] {
            let z = pair(receiver, [z.0, z.1], coupling);
            let z = (0..2).filter(|i| missing >> i & 1 == 1).fold(z, Observation::without);
            let difference = stack.log_likelihood(&state, &z) - both.log_likelihood(&state, &z);
            prop_assert!(difference.abs() < 1e-9, "{difference}");
        }
        let slopes: Matrix2<f64> = stack.jacobian(&state, &receiver);
        prop_assert!((slopes - both.jacobian(&state, &receiver)).norm() < 1e-12);
    }

    /// A level that was received or not: the two probabilities sum to one.
    #[test]
    fn silence_and_sound_are_all_there_is(
        (receiver, [x, y]) in scene(), floor in -90.0..-50.0,
    ) {
        let model = Censored::new(Rss::new(LogDistance::pritzl2018_field()));
        let (state, sigma) = (Vector2::new(x, y), 6.0);
        let observe = |z: f64| {
            let noise = Matrix1::new(sigma * sigma);
            Observation::new(0.0, receiver, Vector1::new(z), noise).expect("proper")
        };
        let silent = model.log_likelihood(&state, &observe(floor).below(0)).exp();
        // Simpson's rule over all levels that can be received.
        let expected: Vector1<f64> = model.expected(&state, &receiver);
        let top = f64::max(floor, expected[0]) + 8.0 * sigma;
        let (steps, width) = (2000, (top - floor) / 2000.0);
        let received: f64 = (0..=steps).map(|i| {
            let weight = if i == 0 || i == steps { 1.0 } else { f64::from(2 + 2 * (i % 2)) };
            let z = observe(floor + width * f64::from(i));
            weight * model.log_likelihood(&state, &z).exp()
        }).sum();
        let whole = silent + received * width / 3.0;
        prop_assert!((whole - 1.0).abs() < 1e-6, "{whole}");
    }
}

#[test]
fn differences_are_those_of_two_receivers() {
    let (reference, receiver) = (Vector3::new(30.0, -40.0, 5.0), Pose::at(-10.0, 20.0, 8.0));
    let state = Vector2::new(70.0, 90.0);
    let range = |pose: &Pose| (pose.position - state.push(1.5)).norm();
    let other = Pose::at(30.0, -40.0, 5.0);
    let model = RangeDifference::new(reference).and_then(|m| m.with_target_up(1.5));
    let z: Vector1<f64> = model.expect("finite").expected(&state, &receiver);
    assert_abs_diff_eq!(z[0], range(&receiver) - range(&other), epsilon = 1e-12);
    // A light-microsecond is 300 m.
    assert_abs_diff_eq!(RangeDifference::SPEED_OF_LIGHT * 1e-6, 299.79, epsilon = 0.01);
    for power in [-60.0, 0.0] {
        let law = LogDistance::new(power, 2.5).expect("proper");
        let level = Rss::new(law).with_target_up(1.5).expect("finite");
        let [own, its]: [Vector1<f64>; 2] = [receiver, other].map(|r| level.expected(&state, &r));
        let model = DifferentialRss::new(reference, 2.5).and_then(|m| m.with_target_up(1.5));
        let z: Vector1<f64> = model.expect("proper").expected(&state, &receiver);
        assert!((z - (own - its)).norm() < 1e-12, "the power cancels out");
    }
    assert!(RangeDifference::new(Vector3::new(0.0, f64::NAN, 0.0)).is_err());
    let refused = DifferentialRss::new(reference, 0.0);
    assert!(matches!(refused, Err(ParameterError { name: "exponent", .. })));
    assert!(DifferentialRss::new(Vector3::repeat(f64::INFINITY), 2.0).is_err());
}

/// A stack keeps the outliers of its parts where the noise allows it.
#[test]
fn a_stack_keeps_its_parts_likelihoods() {
    let stack = Stacked::<_, _, 1, 1>::new(
        Rss::new(LogDistance::pritzl2018_field()),
        BearingOnly::isaacs2014(),
    );
    let (state, receiver) = (Vector2::new(100.0, 0.0), Pose::at(0.0, 0.0, 10.0));
    let expected: Vector2<f64> = stack.expected(&state, &receiver);
    let noise = Matrix2::new(36.0, 0.0, 0.0, 0.0025);
    let opposite = expected + Vector2::new(0.0, 3.0);
    let z = Observation::new(0.0, receiver, opposite, noise).expect("proper");
    let outlier = (0.19 / TAU).ln() - 0.5 * (TAU * 36.0).ln();
    assert_abs_diff_eq!(stack.log_likelihood(&state, &z), outlier, epsilon = 1e-9);
}

/// Models state the quantities that their data are checked against.
#[test]
fn models_name_what_they_measure() {
    fn of<const N: usize, const M: usize>(model: &impl MeasurementModel<N, M>) -> [Quantity; M] {
        model.quantities()
    }
    let law = LogDistance::pritzl2018_field();
    let reference = Vector3::new(50.0, 0.0, 2.0);
    let difference = RangeDifference::new(reference).expect("finite");
    let weaker = DifferentialRss::new(reference, 2.5).expect("in range");
    assert_eq!(of::<2, 1>(&Rss::new(law)), [Quantity::RSS]);
    assert_eq!(of::<2, 1>(&BearingOnly::new()), [Quantity::BEARING]);
    assert_eq!(of::<2, 1>(&difference), [Quantity::RANGE_DIFFERENCE]);
    assert_eq!(of::<2, 1>(&weaker), [Quantity::RSS_DIFFERENCE]);
    let pair = [Quantity::RSS, Quantity::BEARING];
    assert_eq!(of::<2, 2>(&RssBearing::new(law)), pair);
    assert_eq!(of::<3, 2>(&FreePowerRssBearing::new(2.0).expect("positive")), pair);
    assert_eq!(of::<4, 2>(&FreePathLossRssBearing::new()), pair);
    assert_eq!(of::<2, 2>(&Censored::new(RssBearing::new(law))), pair);
    let elevated = WithElevationPattern::new(RssBearing::new(law), ElevationPattern::of(&Dipole));
    assert_eq!(of::<2, 2>(&elevated), pair);
    let inner = Stacked::<_, _, 1, 1>::new(difference, BearingOnly::new());
    let stack = Stacked::<_, _, 1, 2>::new(weaker, inner);
    let all = [Quantity::RSS_DIFFERENCE, Quantity::RANGE_DIFFERENCE, Quantity::BEARING];
    assert_eq!(of::<2, 3>(&stack), all);
    assert_eq!(MeasurementModel::<2, 3>::axes(&stack)[2], Axis::Angle);
}
