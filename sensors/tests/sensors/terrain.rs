//! Diffraction over terrain, and models with it. The losses expected come from a separate program
//! that follows ITU-R P.526-15, §4.1 and §4.5.1, in kilometres, with heights every 5 cm.

use approx::{abs_diff_eq, assert_abs_diff_eq};
use std::sync::Arc;

use foxhunt_core::{MeasurementModel, Observation, Pose, State, Terrain, laws, numeric_jacobian};
use foxhunt_sensors::{
    FreePowerRssBearing, HeightRaster, Hill, Hills, LogDistance, OverTerrain, Rss, RssBearing,
    TerrainLoss, fresnel_parameter, knife_edge_loss_db,
};
use nalgebra::{Matrix1, Matrix2, Vector1, Vector2, Vector3, Vector4};
use proptest::prelude::*;

/// Wavelength of 2.44 GHz, in metres.
const WAVELENGTH: f64 = 0.123;

fn law() -> LogDistance {
    LogDistance::pritzl2018_field()
}

fn hill(east_m: f64, north_m: f64, height_m: f64, radius_m: f64) -> Hill {
    Hill { east_m, north_m, height_m, radius_m }
}

fn one() -> Hills {
    Hills::new(vec![hill(100.0, 0.0, 20.0, 30.0)]).expect("in range")
}

fn two() -> Hills {
    let hills = vec![hill(60.0, 10.0, 12.0, 20.0), hill(150.0, -10.0, 18.0, 25.0)];
    Hills::new(hills).expect("in range")
}

fn loss<G: Terrain>(terrain: G, wavelength: f64) -> TerrainLoss<G> {
    TerrainLoss::new(terrain, wavelength).expect("in range")
}

#[test]
fn a_knife_edge_is_that_of_the_recommendation() {
    for (parameter, expected) in [
        (-5.0, 0.0),
        (-0.78, 0.0),
        (-0.5, 1.959_25),
        (0.0, 6.032_85),
        (1.0, 13.925_73),
        (2.4, 20.539_27),
        (5.0, 26.813_58),
    ] {
        let db = knife_edge_loss_db(parameter);
        assert!((db - expected).abs() < 1e-5, "J({parameter}) is {db}, not {expected} dB");
    }
    // 6 m above the line, 100 and 300 m off, at 3 m: √(2/3 (1/100 + 1/300)) is √(8/900).
    let parameter = fresnel_parameter(6.0, [100.0, 300.0], 3.0);
    assert_abs_diff_eq!(parameter, 6.0 * (8.0_f64 / 900.0).sqrt(), epsilon = 1e-12);
    assert!(knife_edge_loss_db(1e300).is_finite());
}

#[test]
fn hills_take_what_the_recommendation_takes() {
    let place = Vector3::new;
    for (terrain, from, to, wavelength, expected) in [
        (one(), place(0.0, 0.0, 4.0), place(200.0, 0.0, 1.0), 0.123, 42.980_96),
        (one(), place(0.0, 0.0, 4.0), place(200.0, 0.0, 0.0), 0.123, 30.897_3),
        (one(), place(0.0, 0.0, 30.0), place(200.0, 0.0, 1.0), 0.123, 31.311_79),
        (one(), place(0.0, 0.0, 40.0), place(200.0, 0.0, 1.0), 2.0, 12.242_89),
        (one(), place(0.0, 0.0, 4.0), place(110.0, 10.0, 1.0), 0.123, 33.715_46),
        (two(), place(0.0, 0.0, 4.0), place(220.0, 5.0, 1.5), 0.123, 40.982_23),
        (two(), place(0.0, 0.0, 4.0), place(220.0, 5.0, 1.5), 2.0, 21.212_09),
        (two(), place(20.0, -60.0, 10.0), place(130.0, 80.0, 2.0), 0.69, 18.858_44),
    ] {
        let db = loss(terrain, wavelength).loss_db(&from, &to);
        // Steps of an eighth of a radius miss a little of each top.
        assert!(abs_diff_eq!(db, expected, epsilon = 0.25), "{from} {to}: {db}, not {expected} dB");
    }
}

#[test]
fn ground_that_rises_evenly_takes_nothing() {
    #[derive(Debug)]
    struct Slope;
    impl Terrain for Slope {
        fn height(&self, place: &Vector2<f64>) -> Option<f64> {
            (place.x < 1000.0).then(|| 0.3 * place.x - 0.2 * place.y)
        }
        fn step_m(&self) -> f64 {
            5.0
        }
    }
    let slope = loss(Slope, WAVELENGTH);
    let none = loss(Hills::new(Vec::new()).expect("none"), WAVELENGTH);
    for up in [0.0, 0.3, 4.0] {
        let (from, to) = (Vector3::new(-50.0, 20.0, 4.0), Vector3::new(300.0, -80.0, up));
        assert!(slope.loss_db(&from, &to) < 1e-6);
        assert!(none.loss_db(&from, &to) < 1e-6);
    }
    // Beyond what is known, at the same place, and at the end of the numbers: nothing.
    for to in [[2000.0, 0.0, 1.0], [0.0, 0.0, 0.0], [1e308, -1e308, 1e308], [f64::NAN, 0.0, 0.0]] {
        assert_abs_diff_eq!(
            slope.loss_db(&Vector3::zeros(), &Vector3::from(to)),
            0.0,
            epsilon = 1e-9
        );
    }
}

#[test]
fn a_raster_is_the_terrain_up_to_its_reach() {
    let raster = HeightRaster::read(&two(), 300.0).expect("in range");
    assert_abs_diff_eq!(raster.step_m(), 2.5, epsilon = 1e-12);
    for (east, north) in [(0.0, 0.0), (61.3, 8.2), (150.0, -10.0), (-300.0, 300.0), (300.0, 300.0)]
    {
        let place = Vector2::new(east, north);
        let [off, height] =
            [raster.height(&place), two().height(&place)].map(|h| h.expect("known"));
        assert!((off - height).abs() < 0.1, "({east}, {north}): {off}, not {height} m");
    }
    for place in [Vector2::new(300.1, 0.0), Vector2::new(0.0, -301.0), Vector2::new(f64::NAN, 0.0)]
    {
        assert_eq!(raster.height(&place), None);
    }
    let (from, to) = (Vector3::new(0.0, 0.0, 4.0), Vector3::new(220.0, 5.0, 1.5));
    let [read, own] = [loss(raster, 2.0).loss_db(&from, &to), loss(two(), 2.0).loss_db(&from, &to)];
    assert_abs_diff_eq!(read, own, epsilon = 0.1);
    assert!(HeightRaster::read(&two(), f64::NAN).is_err());
}

#[test]
fn what_is_out_of_range_is_refused_by_name() {
    let refused = |hill: Hill| Hills::new(vec![hill]).expect_err("out of range").to_string();
    assert!(refused(hill(0.0, 0.0, 5.0, 0.0)).contains("radius_m is 0"));
    assert!(refused(hill(0.0, f64::NAN, 5.0, 1.0)).contains("north_m is NaN"));
    let error = TerrainLoss::new(one(), -1.0).expect_err("no wavelength").to_string();
    assert!(error.contains("wavelength is -1"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_loss_is_never_a_gain_and_changes_little_at_once(
        east in -50.0..300.0, north in -100.0..100.0, up in 0.0..3.0, wavelength in 0.1..4.0,
    ) {
        let loss = loss(two(), wavelength);
        let at = |east| loss.loss_db(&Vector3::new(0.0, 0.0, 4.0), &Vector3::new(east, north, up));
        prop_assert!(at(east) >= 0.0 && at(east) < 80.0);
        // At most a few dB a metre, whatever joins the profile.
        prop_assert!((at(east + 0.01) - at(east)).abs() < 0.3);
    }

    #[test]
    fn models_over_terrain_keep_the_laws(
        (east, north, height) in (-100.0..0.0, -100.0..100.0, 2.0..40.0),
        (place_east, place_north) in (20.0..250.0, -80.0..80.0),
        up in 0.5..2.0, level in -120.0..-20.0,
    ) {
        let (pose, place) = (Pose::at(east, north, height), Vector2::new(place_east, place_north));
        prop_assume!([up, 0.0].iter().all(|up| !bends_within_a_step(&pose, &place, *up)));
        let loss = loss(Arc::new(two()), WAVELENGTH);
        let rss = Rss::new(law()).with_target_up(up).expect("finite");
        let model = OverTerrain::new(rss, loss.clone()).with_target_up(up).expect("finite");
        let z = Observation::new(3.0, pose, Vector1::new(level), Matrix1::new(9.0));
        laws::measurement_model::<2, 1>(&model, &place, &z.expect("proper"));
        let noise = Matrix2::new(36.0, 0.5, 0.5, 0.16);
        let z = Observation::new(3.0, pose, Vector2::new(level, 0.3), noise).expect("proper");
        let model = OverTerrain::new(RssBearing::new(law()), loss);
        let moving = Vector4::new(place.x, place.y, 1.0, -2.0);
        laws::measurement_model::<4, 2>(&model, &moving, &z);
        let free = model.map(FreePowerRssBearing::from);
        laws::measurement_model::<3, 2>(&free, &State::<3>::new(place.x, place.y, -30.0), &z);
    }
}

/// Returns true if the slope of the loss changes more within a numeric derivative's step than the
/// law's quadrature can follow, as where a height of the profile comes to lie a few decimetres from
/// the target: one place in 2000.
fn bends_within_a_step(pose: &Pose, place: &Vector2<f64>, up: f64) -> bool {
    let loss = loss(two(), WAVELENGTH);
    let lost = |place: &Vector2<f64>| Vector1::new(loss.loss_db(&pose.position, &place.push(up)));
    let slope = |place: &Vector2<f64>| numeric_jacobian(place, lost, |a, b| a - b);
    (0..2).any(|i| {
        let mut step = Vector2::zeros();
        step[i] = f64::EPSILON.cbrt() * place[i].abs().max(1.0);
        let [low, here, high] = [place - step, *place, place + step].map(|x| slope(&x)[i]);
        (low - 2.0 * here + high).abs() > 5e-6
    })
}

#[test]
fn a_slope_bends_next_to_a_height_of_the_profile() {
    let pose = Pose::at(-29.238061143596696, 76.5323863872215, 26.370864287890004);
    let bend = Vector2::new(146.83210544369462, -18.44620177914951);
    assert!(bends_within_a_step(&pose, &bend, 0.0));
    assert!(!bends_within_a_step(&pose, &bend.add_scalar(0.5), 0.0));
}

#[test]
fn the_level_is_lower_by_the_loss_and_the_bearing_is_as_it_was() {
    let inside = RssBearing::new(law()).with_target_up(1.0).expect("finite");
    let over = loss(one(), WAVELENGTH);
    let model = OverTerrain::new(inside, over.clone()).with_target_up(1.0).expect("finite");
    let (pose, state) = (Pose::at(0.0, 0.0, 4.0), Vector2::new(200.0, 3.0));
    let [lower, plain]: [Vector2<f64>; 2] =
        [model.expected(&state, &pose), inside.expected(&state, &pose)];
    let db = over.loss_db(&pose.position, &state.push(1.0));
    assert!(db > 40.0 && abs_diff_eq!(plain[0] - lower[0], db, epsilon = 1e-9));
    assert_eq!(plain[1].to_bits(), lower[1].to_bits());
    assert!(model.with_target_up(f64::NAN).is_err());
}

#[test]
fn without_terrain_it_is_the_model_inside() {
    let inside = RssBearing::new(law());
    let model: OverTerrain<RssBearing<LogDistance>, Hills> = OverTerrain::from(inside);
    let (pose, state) = (Pose::at(1.0, 2.0, 40.0), Vector2::new(20.0, -3.0));
    assert_eq!(model.expected(&state, &pose), inside.expected(&state, &pose));
    assert_eq!(model.jacobian(&state, &pose), inside.jacobian(&state, &pose));
    assert!(model.loss().is_none() && model.model() == &inside);
    let noise = Matrix2::new(36.0, 0.5, 0.5, 0.16);
    let z = Observation::new(3.0, pose, Vector2::new(-70.0, 0.3), noise).expect("proper");
    assert_eq!(
        model.log_likelihood(&state, &z).to_bits(),
        inside.log_likelihood(&state, &z).to_bits()
    );
}

#[test]
fn nothing_is_nan_at_the_end_of_the_numbers() {
    let model = OverTerrain::new(RssBearing::new(law()), loss(two(), WAVELENGTH));
    for (pose, state) in [
        (Pose::at(3.0, -2.0, 4.0), Vector2::new(3.0, -2.0)),
        (Pose::at(3.0, -2.0, -9.0), Vector2::new(90.0, -2.0)),
        (Pose::at(-1e308, 1e308, 5.0), Vector2::new(1e308, -1e308)),
    ] {
        assert!(model.expected(&state, &pose).iter().all(|v| v.is_finite()));
        assert!(model.jacobian(&state, &pose).iter().all(|v| v.is_finite()));
    }
}
