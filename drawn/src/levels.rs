//! Levels of transmitters that stay where they are, received without mishaps.

use core::f64::consts::{LN_10, TAU};

use crate::{
    bound::Bound,
    radio::{self, Floor, Radio, Receiver, Step, Wall},
    random::Random,
    scene::{At, Class, LARGE_NAME, Scene},
};

/// Classes, in the order of tables.
pub const CLASSES: [Class; 22] = [
    Class::rows("lanes", "a field in lanes, shadowed", lanes),
    Class::rows("lanes-white", "a field in lanes, independent errors", white),
    Class::rows("lanes-long", "kilometres of lanes, independent errors", long),
    Class::rows("lanes-beside", "the transmitter beside the lanes", beside),
    Class::rows("lanes-far", "the transmitter 3 to 10 sides away", far),
    Class::rows("drive", "5 to 100 km on streets, whole dB, weak rows missing", drive),
    Class::rows("home", "a walk that ends at the transmitter, GNSS of 4 m", home),
    Class::rows("round", "a loop round the transmitter or past it", round),
    Class::rows("line", "one straight line", line),
    Class::rows("hover", "one place", hover),
    Class::rows("jitter", "one place, GNSS of 2 to 10 m", jitter),
    Class::rows("heights", "5 to 120 m above dipoles", heights),
    Class::rows("network", "5 to 50 receivers with gains of their own", network),
    Class::rows("few-nodes", "3 or 4 receivers", few_nodes),
    Class::rows("house", "nodes in a house of 1 to 3 storeys", house),
    Class::rows("reflected", "low flights with a ground reflection", reflected),
    Class::rows("exponents", "exponents of 1.2 to 8.5, σ that grows", exponents),
    Class::rows("floor", "30 to 80 % of rows at a stated floor", floor),
    Class::rows("floor-hidden", "a floor that nothing states", hidden_floor),
    Class::rows("ceiling", "5 to 40 % of rows at a ceiling", ceiling),
    Class::rows("coarse", "steps of 1 to 6 dB", coarse),
    Class::rows("attenuator", "an attenuator switched in", attenuator),
];

/// The class whose recordings are so large that it runs on request alone.
pub const LARGE: Class = Class::rows(LARGE_NAME, "100,000 to 2,000,000 rows", large);

/// Receives along a path with a receiver without faults.
fn received(random: &mut Random, path: &[Step], from: At, radio: &Radio) -> Scene {
    Scene::of(Receiver::default().receive(random, path, from, radio))
}

/// A place of a transmitter near the ground, by its shares of two sides.
fn within(random: &mut Random, [east_m, north_m]: [f64; 2]) -> At {
    [random.between(0.1, 0.9) * east_m, random.between(0.1, 0.9) * north_m, 0.0]
}

/// Bound of a single slope with independent errors, whose power and exponent are unknown.
fn bound(scene: &Scene, path: &[Step], from: At, radio: &Radio) -> Option<Bound> {
    let slopes = |step: &Step| {
        let way = [from[0] - step.at[0], from[1] - step.at[1], from[2] - step.at[2]];
        let square = way.iter().map(|part| part * part).sum::<f64>().max(0.09);
        let gain = -10.0 * radio.far / LN_10 / square;
        ([gain * way[0], gain * way[1], 1.0, -5.0 * square.log10()], radio.sigma_db(from, step.at))
    };
    if scene.rows.len() != path.len() {
        return None;
    }
    let rows: Vec<([f64; 4], f64)> = path.iter().map(slopes).collect();
    Bound::of(rows.iter().map(|(slopes, sigma_db)| (&slopes[..], *sigma_db)))
}

/// A small field in lanes, with a transmitter in it.
fn lanes(random: &mut Random) -> Scene {
    let side_m = random.between(120.0, 500.0);
    let lanes = random.count(4, 10);
    let path = radio::lanes(side_m, side_m, lanes, 10.0, 30.0);
    let from = within(random, [side_m, side_m]);
    let radio = Radio::usual(random);
    received(random, &path, from, &radio)
}

/// A field in lanes with independent errors.
fn white(random: &mut Random) -> Scene {
    let side_m = random.between(120.0, 500.0);
    let path = radio::lanes(side_m, side_m, random.count(4, 10), 20.0, 2.0);
    let from = within(random, [side_m, side_m]);
    let sigma_db = random.between(2.0, 6.0);
    let radio = Radio::white(random, sigma_db);
    let scene = received(random, &path, from, &radio);
    let bound = bound(&scene, &path, from, &radio);
    Scene { bound, ..scene }
}

/// Kilometres of lanes with independent errors.
fn long(random: &mut Random) -> Scene {
    let length_m = random.between(600.0, 1200.0);
    let lanes = random.count(15, 41);
    let width_m = f64::from(lanes) * random.between(15.0, 25.0);
    let path = radio::lanes(length_m, width_m, lanes, 20.0, 0.0);
    let from = within(random, [length_m, width_m]);
    let radio = Radio::white(random, 4.0);
    let scene = received(random, &path, from, &radio);
    let bound = bound(&scene, &path, from, &radio);
    Scene { bound, ..scene }
}

/// A field in lanes beside which the transmitter is.
fn beside(random: &mut Random) -> Scene {
    let side_m = random.between(120.0, 400.0);
    let path = radio::lanes(side_m, side_m, random.count(4, 8), 10.0, 30.0);
    let off_m = random.between(0.1, 1.0) * side_m;
    let from = [random.between(0.0, side_m), -off_m, 0.0];
    let radio = Radio::usual(random);
    received(random, &path, from, &radio)
}

/// A field in lanes with the transmitter ten of its sides away.
fn far(random: &mut Random) -> Scene {
    let side_m = random.between(100.0, 300.0);
    let path = radio::lanes(side_m, side_m, random.count(3, 6), 10.0, 30.0);
    let off_m = random.between(3.0, 10.0) * side_m;
    let angle = random.between(0.0, TAU);
    let from = [off_m * angle.cos(), off_m * angle.sin(), 0.0];
    let radio = Radio::usual(random);
    received(random, &path, from, &radio)
}

/// A drive on streets, past whatever stands along them.
fn drive(random: &mut Random) -> Scene {
    let length_m = random.log_between(5_000.0, 100_000.0);
    let step_m = (length_m / f64::from(random.count(150, 900))).max(20.0);
    let block_m = random.between(100.0, 400.0);
    let path = radio::streets(random, length_m, block_m, step_m);
    let near = path[random.index(path.len())].at;
    let off_m = random.log_between(20.0, 600.0);
    let angle = random.between(0.0, TAU);
    let from = [near[0] + off_m * angle.cos(), near[1] + off_m * angle.sin(), 2.0];
    let radio = Radio::usual(random);
    let receiver = Receiver { floor: Floor::Lost(-128.0), step_db: 1.0, ..Receiver::default() };
    Scene::of(receiver.receive(random, &path, from, &radio))
}

/// A loop round the transmitter, or past it.
fn round(random: &mut Random) -> Scene {
    let radius_m = random.between(50.0, 300.0);
    let path = radio::round([0.0, 0.0], radius_m, random.count(40, 150), 20.0);
    let off_m = random.between(0.0, 2.0) * radius_m;
    let angle = random.between(0.0, TAU);
    let from = [off_m * angle.cos(), off_m * angle.sin(), 0.0];
    let radio = Radio::usual(random);
    received(random, &path, from, &radio)
}

/// One straight line: either side of it fits alike.
fn line(random: &mut Random) -> Scene {
    let length_m = random.between(200.0, 1000.0);
    let path = radio::straight(length_m, random.count(40, 200), 20.0);
    let off_m = random.sign() * random.between(0.1, 0.5) * length_m;
    let from = [random.between(0.0, length_m), off_m, 0.0];
    let radio = Radio::usual(random);
    received(random, &path, from, &radio)
}

/// One place: levels from there leave all directions open.
fn hover(random: &mut Random) -> Scene {
    let up_m = random.between(2.0, 60.0);
    let path = radio::hover(random, [0.0, 0.0, up_m], 120, 0.0);
    let off_m = random.between(30.0, 400.0);
    let radio = Radio::usual(random);
    received(random, &path, [off_m, 0.0, 0.0], &radio)
}

/// A place held to within the errors of its GNSS.
fn jitter(random: &mut Random) -> Scene {
    let up_m = random.between(2.0, 60.0);
    let path = radio::hover(random, [0.0, 0.0, up_m], 240, 0.2);
    let off_m = random.between(30.0, 300.0);
    let radio = Radio::usual(random);
    let receiver = Receiver { gnss_m: random.between(2.0, 10.0), ..Receiver::default() };
    Scene::of(receiver.receive(random, &path, [off_m, 0.0, 0.0], &radio))
}

/// Flights at heights of 5 to 120 m over upright dipoles.
fn heights(random: &mut Random) -> Scene {
    let side_m = random.between(100.0, 300.0);
    let up_m = random.log_between(5.0, 120.0);
    let path = radio::lanes(side_m, side_m, random.count(4, 8), 8.0, up_m);
    let mut from = within(random, [side_m, side_m]);
    from[2] = random.between(0.3, 10.0);
    let mut radio = Radio::usual(random);
    radio.dipoles = true;
    received(random, &path, from, &radio)
}

/// A walk that ends at the transmitter, by the GNSS of a phone.
fn home(random: &mut Random) -> Scene {
    let length_m = random.between(150.0, 800.0);
    let angle = random.between(0.0, TAU);
    let from = [length_m * angle.cos(), length_m * angle.sin(), 1.0];
    let path = radio::home(random, [0.0, 0.0], [from[0], from[1]], 4.0);
    let radio = Radio::usual(random);
    let receiver = Receiver { gnss_m: 4.0, step_db: 1.0, ..Receiver::default() };
    let scene = Scene::of(receiver.receive(random, &path, from, &radio));
    scene.with_flag("--receiver-sigma-m", 4)
}

/// A network of receivers over some kilometres, each with a gain of its own.
fn network(random: &mut Random) -> Scene {
    let side_m = random.log_between(500.0, 8_000.0);
    let count = random.count(5, 50);
    let path = radio::nodes(random, count, side_m, 6);
    let from = within(random, [side_m, side_m]);
    let radio = Radio::usual(random);
    let receiver = Receiver { offset_db: 3.0, step_db: 1.0, ..Receiver::default() };
    Scene::of(receiver.receive(random, &path, from, &radio))
}

/// Three receivers, or four: hardly more than a network needs.
fn few_nodes(random: &mut Random) -> Scene {
    let side_m = random.log_between(300.0, 3_000.0);
    let count = random.count(3, 4);
    let path = radio::nodes(random, count, side_m, 20);
    let from = within(random, [side_m, side_m]);
    let radio = Radio::usual(random);
    received(random, &path, from, &radio)
}

/// A house of one to three floors with nodes in its rooms.
fn house(random: &mut Random) -> Scene {
    let long_m = random.between(8.0, 18.0);
    let wide_m = random.between(6.0, 12.0);
    let storeys = random.count(1, 3);
    let mut nodes: Vec<At> = Vec::new();
    for storey in 0..storeys {
        let up_m = 2.8 * f64::from(storey) + 1.0;
        for corner in [[0.0, 0.0], [long_m, 0.0], [0.0, wide_m], [long_m, wide_m]] {
            let [east, north]: [f64; 2] = corner;
            nodes.push([east + random.between(-0.3, 0.3), north + random.between(-0.3, 0.3), up_m]);
        }
    }
    let storey = random.count(1, storeys) - 1;
    let up_m = 2.8 * f64::from(storey) + 0.8;
    let from = [random.between(1.0, long_m - 1.0), random.between(1.0, wide_m - 1.0), up_m];
    let mut radio = Radio::white(random, 2.0);
    radio.power_dbm = random.between(-65.0, -55.0);
    let loss_db = random.between(2.0, 8.0);
    let middle_m = random.between(0.3, 0.7) * long_m;
    let across_m = random.between(0.3, 0.7) * wide_m;
    radio.walls = vec![
        Wall { from: [middle_m, -1.0], to: [middle_m, wide_m + 1.0], loss_db },
        Wall { from: [-1.0, across_m], to: [long_m + 1.0, across_m], loss_db },
    ];
    let path = radio::of_places(&nodes, 30, 1.0);
    let receiver = Receiver { step_db: 1.0, ..Receiver::default() };
    let scene = Scene::of(receiver.receive(random, &path, from, &radio));
    // The rooms are in metres: fences of hundreds of metres are of no use to anybody there.
    scene.with_flag("--margin-m", 10).with_flag("--target-up-m", format!("{up_m:.1}"))
}

/// Low flights with a reflection from the ground.
fn reflected(random: &mut Random) -> Scene {
    let side_m = random.between(100.0, 300.0);
    let up_m = random.between(5.0, 40.0);
    let path = radio::lanes(side_m, side_m, random.count(4, 8), 5.0, up_m);
    let mut from = within(random, [side_m, side_m]);
    from[2] = random.between(0.5, 2.0);
    let mut radio = Radio::white(random, 1.5);
    radio.near = 2.0;
    radio.far = 2.0;
    radio.reflection = Some(random.between(0.3, 0.9));
    received(random, &path, from, &radio)
}

/// Exponents of 1.2 to 8.5, and errors that grow with the distance.
fn exponents(random: &mut Random) -> Scene {
    let side_m = random.between(120.0, 500.0);
    let path = radio::lanes(side_m, side_m, random.count(4, 10), 10.0, 20.0);
    let from = within(random, [side_m, side_m]);
    let mut radio = Radio::usual(random);
    radio.near = random.between(1.2, 3.0);
    radio.far = random.log_between(1.2, 8.5);
    radio.growth_db = random.between(0.0, 4.0);
    received(random, &path, from, &radio)
}

/// A field in lanes whose far part lies below the noise, as the recording states.
fn floor(random: &mut Random) -> Scene {
    with_floor(random, Floor::Stated)
}

/// A field in lanes whose far part lies below a floor that nothing states.
fn hidden_floor(random: &mut Random) -> Scene {
    with_floor(random, Floor::Hidden)
}

fn with_floor(random: &mut Random, floor: fn(f64) -> Floor) -> Scene {
    let side_m = random.between(200.0, 800.0);
    let path = radio::lanes(side_m, side_m, random.count(5, 10), 10.0, 30.0);
    let from = within(random, [side_m, side_m]);
    let radio = Radio::usual(random);
    let share = random.between(0.3, 0.8);
    let receiver = Receiver { floor: floor(level_above(&path, from, &radio, share)), ..usual() };
    Scene::of(receiver.receive(random, &path, from, &radio))
}

/// A receiver that shows no more than its largest level, near the transmitter.
fn ceiling(random: &mut Random) -> Scene {
    let side_m = random.between(200.0, 600.0);
    let path = radio::lanes(side_m, side_m, random.count(8, 14), 20.0, 0.0);
    let from = within(random, [side_m, side_m]);
    let radio = Radio::white(random, 3.0);
    let share = random.between(0.6, 0.95);
    let ceiling_dbm = level_above(&path, from, &radio, share);
    let receiver = Receiver { ceiling_dbm, step_db: 0.25, ..usual() };
    Scene::of(receiver.receive(random, &path, from, &radio))
}

/// Whole decibels, or steps of 3, by a signal meter.
fn coarse(random: &mut Random) -> Scene {
    let side_m = random.between(120.0, 500.0);
    let path = radio::lanes(side_m, side_m, random.count(4, 10), 10.0, 30.0);
    let from = within(random, [side_m, side_m]);
    let radio = Radio::usual(random);
    let receiver = Receiver { step_db: f64::from(random.count(1, 6)), ..usual() };
    Scene::of(receiver.receive(random, &path, from, &radio))
}

/// An attenuator that is switched in as the level rises, in a column that nothing reads.
fn attenuator(random: &mut Random) -> Scene {
    let side_m = random.between(200.0, 600.0);
    let path = radio::lanes(side_m, side_m, random.count(6, 12), 10.0, 1.5);
    let from = within(random, [side_m, side_m]);
    let radio = Radio::usual(random);
    let step_db = f64::from(random.count(5, 20));
    let mut rows = usual().receive(random, &path, from, &radio);
    let full = level_above(&path, from, &radio, random.between(0.3, 0.7));
    for row in &mut rows {
        let level = row.get("rss_dbm").unwrap_or(full);
        let switched_db = ((level - full) / step_db).ceil().clamp(0.0, 3.0) * step_db;
        row.set("rss_dbm", level - switched_db);
        row.set("attenuation_db", switched_db);
    }
    Scene::of(rows)
}

/// More rows than most people have: up to two million.
fn large(random: &mut Random) -> Scene {
    let rows = random.log_between(100_000.0, 2_000_000.0);
    let side_m = random.between(1_000.0, 5_000.0);
    let lanes = random.count(20, 60);
    let step_m = side_m * f64::from(lanes) / rows;
    let path = radio::lanes(side_m, side_m, lanes, step_m, 50.0);
    let from = within(random, [side_m, side_m]);
    let radio = Radio::usual(random);
    received(random, &path, from, &radio)
}

fn usual() -> Receiver {
    Receiver::default()
}

/// Level below which a share of a path's levels lies.
fn level_above(path: &[Step], from: At, radio: &Radio, share: f64) -> f64 {
    let mut levels: Vec<f64> = path.iter().map(|step| radio.level(from, step.at)).collect();
    levels.sort_by(f64::total_cmp);
    let count = f64::from(u32::try_from(levels.len()).unwrap_or(u32::MAX));
    let rank = usize::try_from(radio::whole(share * count)).unwrap_or(0);
    levels.get(rank.min(levels.len().saturating_sub(1))).copied().unwrap_or(0.0)
}
