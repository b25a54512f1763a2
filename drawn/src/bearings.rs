//! Ready-made bearings, turns of a directional antenna, and logs of a KrakenSDR, which have no
//! header.

use core::{
    f64::consts::{PI, TAU},
    fmt::Write as _,
};

use crate::{
    bound::Bound,
    geodesy::{Origin, azimuth_deg},
    radio::{self, Radio, Receiver},
    random::Random,
    scene::{At, Class, DrawnFile, DrawnRecording, Row, Scene},
};

/// Classes, in the order of tables.
pub const CLASSES: [Class; 15] = [
    Class::rows("bearings", "3 to 12 bearings", good),
    Class::rows("bearings-back", "1 or 2 of 5 to 10 point back", back),
    Class::rows("bearings-diverge", "two that point back", diverging),
    Class::rows("bearings-outlier", "one of 8 to 12 is wrong", outlier),
    Class::rows("bearings-common", "errors in common at each place", common),
    Class::rows("bearings-array", "errors by direction of arrival", deviation),
    Class::rows("bearings-sigma", "σ stated 0.3 to 3 times", misstated),
    Class::rows("bearings-modes", "a third are reflections", two_modes),
    Class::rows("bearings-far", "the transmitter 3 to 10 baselines away", far),
    Class::rows("bearings-place", "all from one place", one_place),
    Class::rows("bearings-north", "200 km at 52 to 66° N", north),
    Class::rows("groups", "15 to 30 animals, σ not stated", groups),
    Class::rows("groups-back", "two of them with back-bearings", groups_back),
    Class::rows("turns", "turns of an antenna, with an echo", turns),
    Class::files("kraken", "KrakenSDR: no fix, or a clock that steps back", kraken),
];

/// Column of bearings.
const BEARING: &str = "bearing_deg_compass";

/// Column of their σ.
const SIGMA: &str = "bearing_sigma_deg";

/// True direction from one place to another, in degrees clockwise from North.
fn direction_deg(from: At, to: At) -> f64 {
    (to[0] - from[0]).atan2(to[1] - from[1]).to_degrees()
}

/// True direction in the plane, in degrees clockwise from North.
fn compass_deg(from: [f64; 2], to: [f64; 2]) -> f64 {
    direction_deg([from[0], from[1], 0.0], [to[0], to[1], 0.0])
}

/// Wraps degrees to [0, 360), rounded to tenths.
fn compass(deg: f64) -> f64 {
    wrapped(deg, 10.0)
}

/// Wraps degrees to [0, 360), rounded to 1/`parts` of a degree.
fn wrapped(deg: f64, parts: f64) -> f64 {
    (deg.rem_euclid(360.0) * parts).round() / parts % 360.0
}

/// Observers about a transmitter, each of which takes one bearing.
fn about(random: &mut Random, least: u32, most: u32) -> (Vec<At>, At) {
    let side_m = random.log_between(200.0, 3_000.0);
    let from = [random.between(0.2, 0.8) * side_m, random.between(0.2, 0.8) * side_m, 0.0];
    let count = random.count(least, most);
    let places = (0..count).map(|_| {
        // Nearer than a tenth of the side one sees it.
        loop {
            let at = [random.between(0.0, side_m), random.between(0.0, side_m), 0.0];
            if (at[0] - from[0]).hypot(at[1] - from[1]) > 0.1 * side_m {
                break at;
            }
        }
    });
    (places.collect(), from)
}

/// Takes one bearing from each place, with a stated σ.
fn taken(random: &mut Random, places: &[At], from: At, sigma_deg: f64) -> Vec<Row> {
    let mut rows = Vec::new();
    let mut time_s = 0.0;
    for at in places {
        let bearing_deg = direction_deg(*at, from) + random.normal(sigma_deg);
        let row = Row::new(time_s, *at, from).with(BEARING, compass(bearing_deg));
        rows.push(row.with(SIGMA, sigma_deg));
        time_s += 60.0;
    }
    rows
}

/// Bound of bearings with independent errors.
fn bound(places: &[At], from: At, sigma_deg: f64) -> Option<Bound> {
    let slopes = |at: &At| {
        let east = from[0] - at[0];
        let north = from[1] - at[1];
        let square = (east * east + north * north).max(1e-6);
        [north / square, -east / square]
    };
    let rows: Vec<[f64; 2]> = places.iter().map(slopes).collect();
    Bound::of(rows.iter().map(|slopes| (&slopes[..], sigma_deg.to_radians())))
}

/// Bearings as they should be.
fn good(random: &mut Random) -> Scene {
    let (places, from) = about(random, 3, 12);
    let sigma_deg = random.between(2.0, 12.0).round();
    let rows = taken(random, &places, from, sigma_deg);
    Scene { bound: bound(&places, from, sigma_deg), ..Scene::of(rows) }
}

/// One or two of the bearings point back.
fn back(random: &mut Random) -> Scene {
    let (places, from) = about(random, 5, 10);
    let sigma_deg = random.between(2.0, 8.0).round();
    let mut rows = taken(random, &places, from, sigma_deg);
    let count = usize::try_from(random.count(1, 2)).unwrap_or(1);
    for row in random.some_of(count, rows.len()) {
        rows[row].change(BEARING, |deg| compass(deg + 180.0));
    }
    Scene::of(rows)
}

/// Two bearings that diverge, as both point back.
fn diverging(random: &mut Random) -> Scene {
    let apart_m = random.log_between(100.0, 2_000.0);
    let along_m = random.between(0.1, 0.9) * apart_m;
    let off_m = random.sign() * random.between(0.2, 1.0) * apart_m;
    let from = [along_m, off_m, 0.0];
    let places = [[0.0; 3], [apart_m, 0.0, 0.0]];
    let mut rows = taken(random, &places, from, 5.0);
    rows.iter_mut().for_each(|row| row.change(BEARING, |deg| compass(deg + 180.0)));
    Scene::of(rows)
}

/// One bearing in eight is turned by more than its σ can explain.
fn outlier(random: &mut Random) -> Scene {
    let (places, from) = about(random, 8, 12);
    let sigma_deg = random.between(2.0, 6.0).round();
    let mut rows = taken(random, &places, from, sigma_deg);
    let wrong = random.index(rows.len());
    let off_deg = random.sign() * random.between(40.0, 120.0);
    rows[wrong].change(BEARING, |deg| compass(deg + off_deg));
    Scene::of(rows)
}

/// Several bearings from each place, which err in common.
fn common(random: &mut Random) -> Scene {
    let (places, from) = about(random, 3, 6);
    let own_deg = 3.0;
    let mut time = 0_u32;
    let mut rows = Vec::new();
    for at in places {
        let common_deg = random.normal(9.0);
        let times = random.count(5, 20);
        let place = vec![at; usize::try_from(times).unwrap_or(1)];
        for mut row in taken(random, &place, from, own_deg) {
            row.change(BEARING, |deg| compass(deg + common_deg));
            row.time_s = 60.0 * f64::from(time);
            time += 1;
            rows.push(row);
        }
    }
    Scene::of(rows)
}

/// Fixed arrays whose errors follow from the direction of arrival.
fn deviation(random: &mut Random) -> Scene {
    let (places, from) = about(random, 2, 4);
    let mut time = 0_u32;
    let mut rows = Vec::new();
    for at in places {
        let amplitude_deg = random.between(4.0, 14.0);
        let phase = random.between(0.0, TAU);
        let place = vec![at; 12];
        for mut row in taken(random, &place, from, 2.0) {
            let arrival = direction_deg(at, from).to_radians();
            let off_deg = amplitude_deg * (2.0 * arrival + phase).sin();
            row.change(BEARING, |deg| compass(deg + off_deg));
            row.time_s = 60.0 * f64::from(time);
            time += 1;
            rows.push(row);
        }
    }
    Scene::of(rows)
}

/// σ that is stated 0.3 to 3 times as large as it is.
fn misstated(random: &mut Random) -> Scene {
    let (places, from) = about(random, 4, 12);
    let sigma_deg = random.between(3.0, 10.0);
    let stated_deg = (sigma_deg * random.log_between(0.3, 3.0)).max(0.5);
    let mut rows = taken(random, &places, from, sigma_deg);
    rows.iter_mut().for_each(|row| row.set(SIGMA, stated_deg));
    Scene::of(rows)
}

/// A third of the bearings point to a reflection, in another direction at each place.
fn two_modes(random: &mut Random) -> Scene {
    let (places, from) = about(random, 5, 12);
    let mut rows = taken(random, &places, from, 5.0);
    for row in &mut rows {
        if random.chance(0.33) {
            let off_deg = random.between(30.0, 330.0);
            row.change(BEARING, |deg| compass(deg + off_deg));
        }
    }
    Scene::of(rows)
}

/// A kilometre of places with the transmitter 3 to 10 km away.
fn far(random: &mut Random) -> Scene {
    let count = random.count(2, 5);
    let last = f64::from(count - 1);
    let places: Vec<At> =
        (0..count).map(|place| [1000.0 * f64::from(place) / last, 0.0, 0.0]).collect();
    let from = [500.0, random.sign() * random.between(3_000.0, 10_000.0), 0.0];
    let rows = taken(random, &places, from, 3.0);
    Scene { bound: bound(&places, from, 3.0), ..Scene::of(rows) }
}

/// All bearings are from one place.
fn one_place(random: &mut Random) -> Scene {
    let from = [random.between(100.0, 2_000.0), random.between(100.0, 2_000.0), 0.0];
    let places = vec![[0.0; 3]; usize::try_from(random.count(2, 6)).unwrap_or(2)];
    let sigma_deg = random.between(3.0, 15.0).round();
    let mut rows = taken(random, &places, from, sigma_deg);
    rows.iter_mut().for_each(|row| row.values.retain(|(name, _)| *name == BEARING));
    Scene::of(rows).in_degrees(42.03, -71.97)
}

/// Stations 50 to 200 km apart in the North, where meridians converge.
fn north(random: &mut Random) -> Scene {
    let lat_deg = random.between(52.0, 66.0);
    let spread_deg = random.between(0.3, 1.0);
    let place = |random: &mut Random, spread_deg: f64| {
        let north_deg = random.between(-spread_deg, spread_deg);
        [lat_deg + north_deg, 10.0 + 2.0 * random.between(-spread_deg, spread_deg)]
    };
    let transmitter = place(random, 0.3 * spread_deg);
    let mut scene = Scene::default().in_degrees(lat_deg, 10.0);
    let metres = |[north_deg, east_deg]: [f64; 2], scene: &Scene| {
        let Some(origin) = scene.origin else { return [0.0; 3] };
        let [north, east] = origin.degrees([1.0, 1.0]);
        let east_m = (east_deg - origin.lon_deg) / (east - origin.lon_deg);
        [east_m, (north_deg - origin.lat_deg) / (north - origin.lat_deg), 0.0]
    };
    let truth = metres(transmitter, &scene);
    let mut places = Vec::new();
    for station in 0..random.count(4, 6) {
        let at_deg = place(random, spread_deg);
        let bearing_deg = azimuth_deg(at_deg, transmitter) + random.normal(0.5);
        let at = metres(at_deg, &scene);
        places.push(at);
        let row = Row::new(f64::from(station), at, truth);
        scene.rows.push(row.with(BEARING, wrapped(bearing_deg, 1000.0)).with(SIGMA, 0.5));
    }
    scene.bound = bound(&places, truth, 0.5);
    scene
}

/// Animals with four bearings each, whose σ nothing states.
fn groups(random: &mut Random) -> Scene {
    animals(random, 0)
}

/// Animals of which two have bearings that point back.
fn groups_back(random: &mut Random) -> Scene {
    animals(random, 2)
}

fn animals(random: &mut Random, wrong: usize) -> Scene {
    let count = random.count(15, 30);
    let sigma_deg = random.between(2.0, 5.0);
    let back = random.some_of(wrong, usize::try_from(count).unwrap_or(0));
    let mut rows = Vec::new();
    for animal in 0..count {
        let from = [random.between(0.0, 1000.0), random.between(0.0, 1000.0), 0.0];
        let places: Vec<At> = (0..4)
            .map(|quarter| {
                let angle = 0.5 * PI * f64::from(quarter) + random.between(0.0, 1.2);
                let off_m = random.between(200.0, 1000.0);
                [from[0] + off_m * angle.cos(), from[1] + off_m * angle.sin(), 0.0]
            })
            .collect();
        for mut row in taken(random, &places, from, sigma_deg) {
            if back.contains(&usize::try_from(animal).unwrap_or(0)) {
                row.change(BEARING, |deg| deg + 180.0);
            }
            row.change(BEARING, |deg| deg.round().rem_euclid(360.0));
            row.values.retain(|(name, _)| *name == BEARING);
            row.beacon = Some(animal);
            rows.push(row);
        }
    }
    Scene::of(rows)
}

/// Turns of a directional antenna at some places, with a reflection in the pattern.
fn turns(random: &mut Random) -> Scene {
    let side_m = random.between(150.0, 500.0);
    let from = [random.between(0.2, 0.8) * side_m, random.between(0.2, 0.8) * side_m, 0.0];
    let radio = Radio::usual(random);
    let places = random.count(4, 10);
    let path = radio::nodes(random, places, side_m, 1);
    let reflected = random.between(0.1, 0.5);
    let mut rows = Vec::new();
    for (turn, row) in (0_u32..).zip(Receiver::default().receive(random, &path, from, &radio)) {
        let Some(level) = row.get("rss_dbm") else { continue };
        let arrival_deg = direction_deg(row.at, from);
        let echo_deg = random.between(0.0, 360.0);
        for look in 0..24_u32 {
            let boresight_deg = 15.0 * f64::from(look);
            // A cardioid with a floor, as amplitudes of the direct wave and of an echo.
            let gain = |from_deg: f64| 0.55 + 0.45 * (boresight_deg - from_deg).to_radians().cos();
            let amplitude = gain(arrival_deg).powi(2) + reflected * gain(echo_deg).powi(2);
            let shown = level + 20.0 * amplitude.max(0.03).log10() + random.normal(1.5);
            let time_s = 30.0 * f64::from(turn) + 0.5 * f64::from(look);
            let sample = Row::new(time_s, row.at, from).with("turn", f64::from(turn));
            let sample = sample.with("boresight_deg_compass", boresight_deg);
            rows.push(sample.with("rss_dbm", shown.round()));
        }
    }
    Scene::of(rows)
}

/// Draws a kraken with an array on the roof, with rows without a fix or a clock that steps back.
fn kraken(random: &mut Random) -> DrawnRecording {
    let origin = Origin { lat_deg: -36.85, lon_deg: 174.76 };
    let length_m = random.between(1_500.0, 6_000.0);
    let count = random.count(40, 120);
    let from = [random.between(0.1, 0.9) * length_m, random.sign() * 0.3 * length_m];
    let no_fix = random.chance(0.5);
    let back_at = if no_fix { count } else { random.count(1, count) };
    let back_ms = whole_ms(random.between(1_000.0, 60_000.0));
    let mut text = String::new();
    for row in 0..count {
        let east_m = length_m * f64::from(row) / f64::from(count);
        let bearing_deg = compass_deg([east_m, 0.0], from);
        let bearing_deg = bearing_deg + random.normal(4.0);
        let doa_deg = (bearing_deg - 90.0).rem_euclid(360.0).round();
        let distance_m = (from[0] - east_m).hypot(from[1]);
        let power_db = -5.0 - 25.0 * (distance_m / 100.0).log10() + random.normal(4.0);
        let mut at = origin.degrees([east_m, 0.0]);
        if no_fix && random.chance(0.05) {
            at = [0.0, 0.0];
        }
        let back = if row >= back_at { back_ms } else { 0 };
        let time_ms = 1_767_225_603_000 + 3000 * u64::from(row) - back;
        let confidence = random.between(2.0, 9.0);
        // Writing to a string does not fail.
        let _ = write!(
            text,
            "{time_ms}, {doa_deg}, {confidence:.2}, {power_db:.2}, 144500000, Circular, 350, KR1, \
             {:.7}, {:.7}, 90.0, 90.0, GPS, R, R, R, R",
            at[0], at[1],
        );
        text.push_str(&", -30.00".repeat(360));
        text.push('\n');
    }
    let [lat_deg, lon_deg] = origin.degrees(from);
    DrawnRecording {
        files: vec![DrawnFile { name: "kraken.csv".to_owned(), text }],
        flags: vec!["--format=krakensdr".to_owned(), format!("--truth={lat_deg:.7},{lon_deg:.7}")],
        header: 0,
        bound: None,
        is_empty: false,
    }
}

/// Converts positive milliseconds to whole ones.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a minute at most")]
fn whole_ms(value: f64) -> u64 {
    value as u64
}
