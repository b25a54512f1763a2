//! Ranges, and differences of ranges to a reference receiver.

use super::{
    bound::Bound,
    random::Random,
    scene::{At, Class, Row, Scene},
};

/// Classes, in the order of tables.
pub const CLASSES: [Class; 8] = [
    Class::rows("ranges", "4 to 10 ranges", good),
    Class::rows("ranges-offset", "an offset and a scale in common", offset),
    Class::rows("ranges-corner", "a third go round a corner", cornered),
    Class::rows("ranges-line", "stations in a line", in_line),
    Class::rows("differences", "4 to 8 differences", good_differences),
    Class::rows("differences-common", "the reference's error is in all differences", common),
    Class::rows("differences-two", "two differences", two_differences),
    Class::rows("differences-corner", "a quarter go round a corner", cornered_differences),
];

fn distance_m(one: At, other: At) -> f64 {
    (one[0] - other[0]).hypot(one[1] - other[1]).hypot(one[2] - other[2])
}

/// Stations over a square with a transmitter among them.
fn stations(random: &mut Random, least: u32, most: u32) -> (Vec<At>, At) {
    let side_m = random.log_between(50.0, 3_000.0);
    let count = random.count(least, most);
    let places: Vec<At> = (0..count)
        .map(|_| [random.between(0.0, side_m), random.between(0.0, side_m), 3.0])
        .collect();
    let from = [random.between(0.1, 0.9) * side_m, random.between(0.1, 0.9) * side_m, 0.0];
    (places, from)
}

/// Measures the range from each place; `error` is added to the true one.
fn measured(places: &[At], from: At, sigma_m: f64, mut error: impl FnMut(f64) -> f64) -> Scene {
    let row = |(second, at): (f64, &At)| {
        let true_m = distance_m(*at, from);
        let range_m = (true_m + error(true_m)).max(0.1);
        let row = Row::new(second, *at, from).with("range_m", range_m);
        row.with("range_sigma_m", sigma_m)
    };
    let seconds = (0_u32..).map(f64::from);
    let scene = Scene::of(seconds.zip(places).map(row).collect());
    scene.with_flag("--estimator", "multilateration")
}

/// Direction of a transmitter in the plane, as a range changes with its place.
fn slopes(at: At, from: At) -> [f64; 2] {
    let distance_m = distance_m(at, from).max(1e-3);
    [(from[0] - at[0]) / distance_m, (from[1] - at[1]) / distance_m]
}

/// Ranges with independent errors.
fn good(random: &mut Random) -> Scene {
    let (places, from) = stations(random, 4, 10);
    let sigma_m = random.log_between(0.5, 15.0);
    let rows: Vec<[f64; 2]> = places.iter().map(|at| slopes(*at, from)).collect();
    let bound = Bound::of(rows.iter().map(|slopes| (&slopes[..], sigma_m)));
    Scene { bound, ..measured(&places, from, sigma_m, |_| random.normal(sigma_m)) }
}

/// Ranges with an offset and a scale that all have in common.
fn offset(random: &mut Random) -> Scene {
    let (places, from) = stations(random, 4, 10);
    let sigma_m = random.log_between(0.5, 5.0);
    let offset_m = random.between(2.0, 40.0);
    let scale = random.between(-0.15, 0.15);
    let error = |true_m: f64| offset_m + scale * true_m + random.normal(sigma_m);
    measured(&places, from, sigma_m, error)
}

/// A third of the ranges go round a corner.
fn cornered(random: &mut Random) -> Scene {
    let (places, from) = stations(random, 5, 10);
    let sigma_m = random.log_between(0.5, 5.0);
    let detour_m = 20.0 * sigma_m;
    let error = |_| {
        let detour_m = if random.chance(0.33) { random.between(0.2, 1.0) * detour_m } else { 0.0 };
        detour_m + random.normal(sigma_m)
    };
    measured(&places, from, sigma_m, error)
}

/// Stations along a line: either side of it fits alike.
fn in_line(random: &mut Random) -> Scene {
    let (mut places, from) = stations(random, 3, 6);
    places.iter_mut().for_each(|at| at[1] = 0.0);
    let sigma_m = random.log_between(0.5, 5.0);
    measured(&places, from, sigma_m, |_| random.normal(sigma_m))
}

/// Measures the differences to a reference at the origin.
fn differences(places: &[At], from: At, sigma_m: f64, mut error: impl FnMut() -> f64) -> Scene {
    let reference_m = distance_m([0.0; 3], from);
    let row = |(second, at): (f64, &At)| {
        let difference_m = distance_m(*at, from) - reference_m + error();
        let row = Row::new(second, *at, from).with("range_difference_m", difference_m);
        row.with("range_difference_sigma_m", sigma_m)
    };
    let seconds = (0_u32..).map(f64::from);
    let scene = Scene::of(seconds.zip(places).map(row).collect());
    let scene = scene.with_flag("--estimator", "range-differences");
    scene.with_flag("--reference-m", "0,0,0")
}

/// Differences with independent errors.
fn good_differences(random: &mut Random) -> Scene {
    let (places, from) = stations(random, 4, 8);
    let sigma_m = random.log_between(0.5, 10.0);
    let reference = slopes([0.0; 3], from);
    let slopes_of = |at: &At| {
        let own = slopes(*at, from);
        [own[0] - reference[0], own[1] - reference[1]]
    };
    let rows: Vec<[f64; 2]> = places.iter().map(slopes_of).collect();
    let bound = Bound::of(rows.iter().map(|slopes| (&slopes[..], sigma_m)));
    Scene { bound, ..differences(&places, from, sigma_m, || random.normal(sigma_m)) }
}

/// Differences to a reference whose arrival is measured no better than the others: each has its own
/// error, and all have the reference's.
fn common(random: &mut Random) -> Scene {
    let (places, from) = stations(random, 5, 9);
    let sigma_m = random.log_between(0.5, 10.0);
    let own_m = sigma_m / std::f64::consts::SQRT_2;
    let shared_m = random.normal(own_m);
    differences(&places, from, sigma_m, || shared_m + random.normal(own_m))
}

/// Two differences, whose hyperbolas meet twice as a rule.
fn two_differences(random: &mut Random) -> Scene {
    let side_m = random.log_between(200.0, 3_000.0);
    let places = [[side_m, 0.0, 0.0], [0.0, side_m, 0.0]];
    let from = [random.between(-0.5, 0.9) * side_m, random.between(-0.5, 0.9) * side_m, 0.0];
    let sigma_m = 0.003 * side_m;
    differences(&places, from, sigma_m, || random.normal(sigma_m))
}

/// Differences of which some go round a corner.
fn cornered_differences(random: &mut Random) -> Scene {
    let (places, from) = stations(random, 5, 8);
    let sigma_m = random.log_between(0.5, 5.0);
    let error = || {
        let detour_m = if random.chance(0.25) { random.between(5.0, 20.0) * sigma_m } else { 0.0 };
        detour_m + random.normal(sigma_m)
    };
    differences(&places, from, sigma_m, error)
}
