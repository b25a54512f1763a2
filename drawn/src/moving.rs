//! Transmitters that move, received by stations that stay.

use core::f64::consts::TAU;

use crate::{
    radio::{Floor, Radio, Receiver, Step, nodes},
    random::Random,
    scene::{At, Class, Row, Scene},
};

/// Classes, in the order of tables.
pub const CLASSES: [Class; 3] = [
    Class::rows("track-network", "a tag among 4 to 8 towers, levels", network),
    Class::rows("track-towers", "a tag among 2 to 4 towers, bearings too", towers),
    Class::rows("track-one", "a tag and one tower", one_tower),
];

/// A walk of an animal: legs with a heading of their own, at 0.2 to 3 m/s.
fn walk(random: &mut Random, side_m: f64, seconds: u32, every_s: u32) -> Vec<(f64, At)> {
    let mut at = [random.between(0.2, 0.8) * side_m, random.between(0.2, 0.8) * side_m, 0.5];
    let speed_mps = random.log_between(0.2, 3.0);
    let mut heading = random.between(0.0, TAU);
    let mut way = Vec::new();
    for second in (0..seconds).step_by(usize::try_from(every_s).unwrap_or(1)) {
        way.push((f64::from(second), at));
        heading += random.normal(0.3);
        at[0] += speed_mps * f64::from(every_s) * heading.cos();
        at[1] += speed_mps * f64::from(every_s) * heading.sin();
    }
    way
}

/// Receives bursts at each of the stations that they reach.
fn bursts(random: &mut Random, stations: &[Step], way: &[(f64, At)], radio: &Radio) -> Vec<Row> {
    let receiver = Receiver { floor: Floor::Lost(-120.0), step_db: 1.0, ..Receiver::default() };
    let mut rows = Vec::new();
    for (time_s, at) in way {
        let now: Vec<Step> =
            stations.iter().map(|step| Step { time_s: *time_s, ..*step }).collect();
        rows.extend(receiver.receive(random, &now, *at, radio));
    }
    rows
}

/// A way to stations that receive most bursts from a kilometre away.
fn within_reach(random: &mut Random) -> Radio {
    Radio { power_dbm: random.between(-25.0, -5.0), ..Radio::usual(random) }
}

/// A network of towers that receives the levels of a tag.
fn network(random: &mut Random) -> Scene {
    let side_m = random.between(800.0, 3_000.0);
    let count = random.count(4, 8);
    let stations = nodes(random, count, side_m, 1);
    let seconds = random.count(900, 2400);
    let way = walk(random, side_m, seconds, 30);
    let radio = within_reach(random);
    tracked(bursts(random, &stations, &way, &radio))
}

/// Towers that have bearings besides the levels.
fn towers(random: &mut Random) -> Scene {
    let side_m = random.between(800.0, 3_000.0);
    let count = random.count(2, 4);
    let stations = nodes(random, count, side_m, 1);
    let seconds = random.count(900, 2400);
    let way = walk(random, side_m, seconds, 30);
    let radio = within_reach(random);
    let sigma_deg = random.between(4.0, 15.0).round();
    let mut rows = bursts(random, &stations, &way, &radio);
    for row in &mut rows {
        let [east, north] = row.truth.unwrap_or_default();
        let true_deg = (east - row.at[0]).atan2(north - row.at[1]).to_degrees();
        let bearing_deg = (true_deg + random.normal(sigma_deg)).rem_euclid(360.0);
        row.set("bearing_deg_compass", bearing_deg.min(359.9));
        row.set("bearing_sigma_deg", sigma_deg);
    }
    tracked(rows)
}

/// One tower with bearings: the range is hardly seen.
fn one_tower(random: &mut Random) -> Scene {
    let mut scene = towers(random);
    let of = |receiver: u32| scene.rows.iter().filter(|row| row.receiver == Some(receiver)).count();
    let most = (0..4).max_by_key(|receiver| of(*receiver));
    scene.rows.retain(|row| row.receiver == most);
    scene
}

fn tracked(rows: Vec<Row>) -> Scene {
    let mut scene = Scene::of(rows);
    scene.flags.push("--track".to_owned());
    scene
}
