//! Levels of a field with something that went wrong on the way to the file.

use core::f64::consts::TAU;

use crate::{
    radio::{self, Floor, Radio, Receiver, Step},
    random::Random,
    scene::{At, Class, DrawnFile, Row, Scene, Spelling},
};

/// Classes, in the order of tables.
pub const CLASSES: [Class; 13] = [
    Class::rows("unsigned", "levels without their minus", unsigned),
    Class::rows("comma", "semicolons and decimal commas", comma),
    Class::rows("app", "an app's export with jumps, half with a preamble", app),
    Class::rows("jumps", "places that jump in 2 to 6 rows", jumps),
    Class::rows("no-fix", "0° N 0° E in 1 to 5 rows", no_fix),
    Class::rows("late", "levels 5 to 120 s off their places", late),
    Class::rows("clock-back", "a clock that steps back", steps_back),
    Class::rows("duplicates", "rows twice or swapped", duplicates),
    Class::rows("outliers", "one level in eight is any", outliers),
    Class::rows("another", "a second transmitter", another),
    Class::rows("moving", "a transmitter that moves", moving),
    Class::rows("switched-off", "a transmitter that is switched off", switched_off),
    Class::rows("never-there", "noise alone", silent),
];

/// A field that is well received.
struct Plain {
    rows: Vec<Row>,
    path: Vec<Step>,
    from: At,
    radio: Radio,
    side_m: f64,
}

impl Plain {
    fn draw(random: &mut Random) -> Self {
        let side_m = random.between(150.0, 500.0);
        let path = radio::lanes(side_m, side_m, random.count(5, 10), 12.0, 20.0);
        let from = [random.between(0.15, 0.85) * side_m, random.between(0.15, 0.85) * side_m, 0.0];
        let radio = Radio::usual(random);
        let rows = Receiver::default().receive(random, &path, from, &radio);
        Self { rows, path, from, radio, side_m }
    }
}

/// Levels without their minus.
fn unsigned(random: &mut Random) -> Scene {
    let mut rows = Plain::draw(random).rows;
    rows.iter_mut().for_each(|row| row.change("rss_dbm", |level| -level.round()));
    Scene::of(rows)
}

/// Semicolons between cells and commas in numbers.
fn comma(random: &mut Random) -> Scene {
    let scene = Scene::of(Plain::draw(random).rows).in_degrees(50.0, 14.4);
    Scene { spelling: Spelling::Comma, ..scene }
}

/// An app's export: a line above the header, names of its own, and a few places that jump.
fn app(random: &mut Random) -> Scene {
    let mut rows = Plain::draw(random).rows;
    let jumps = random.count(1, 3);
    for _ in 0..jumps {
        let row = random.index(rows.len());
        let far_m = random.between(500.0, 3_000.0);
        let angle = random.between(0.0, TAU);
        rows[row].at[0] += far_m * angle.cos();
        rows[row].at[1] += far_m * angle.sin();
    }
    rows.iter_mut().for_each(|row| row.change("rss_dbm", f64::round));
    let mut scene = Scene::of(rows).in_degrees(48.2, 16.37);
    scene.renamed = vec![("rss_dbm", "RSSI"), ("lat_deg", "Lat"), ("lon_deg", "Lon")];
    if random.chance(0.5) {
        scene.preamble = vec!["AppLog-1.6,appRelease=2.72,model=Phone,release=14".to_owned()];
    }
    scene.beside.push(DrawnFile { name: "app.toml".to_owned(), text: APP.to_owned() });
    scene.with_flag("--format", "app.toml")
}

/// The mapping of the app's columns.
const APP: &str = "name = \"app\"\n\
    description = \"an app's export\"\n\
    header = [\"RSSI\", \"Lat\", \"Lon\"]\n\
    [columns]\n\
    time_s = \"time_s\"\n\
    rss_dbm = \"RSSI\"\n\
    lat_deg = \"Lat\"\n\
    lon_deg = \"Lon\"\n\
    alt_agl_m = \"alt_agl_m\"\n\
    truth_lat_deg = \"truth_lat_deg\"\n\
    truth_lon_deg = \"truth_lon_deg\"\n";

/// Places that jump in a few rows.
fn jumps(random: &mut Random) -> Scene {
    let mut rows = Plain::draw(random).rows;
    for _ in 0..random.count(2, 6) {
        let row = random.index(rows.len());
        rows[row].at[0] += random.sign() * random.log_between(200.0, 5_000.0);
    }
    Scene::of(rows)
}

/// Places of 0° N 0° E in rows without a fix.
fn no_fix(random: &mut Random) -> Scene {
    let plain = Plain::draw(random);
    let mut scene = Scene::of(plain.rows).in_degrees(50.08, 14.42);
    let origin = scene.origin.unwrap_or(super::geodesy::Origin { lat_deg: 0.0, lon_deg: 0.0 });
    let [north_deg, east_deg] = origin.degrees([1.0, 1.0]);
    for _ in 0..random.count(1, 5) {
        let row = random.index(scene.rows.len());
        scene.rows[row].at[0] = -origin.lon_deg / (east_deg - origin.lon_deg);
        scene.rows[row].at[1] = -origin.lat_deg / (north_deg - origin.lat_deg);
    }
    scene
}

/// Levels whose clock is off by seconds to minutes from that of the places.
fn late(random: &mut Random) -> Scene {
    let Plain { mut rows, path, .. } = Plain::draw(random);
    let late_s = random.sign() * random.log_between(5.0, 120.0);
    for row in &mut rows {
        let time_s = row.time_s + late_s;
        let next = path.iter().position(|step| step.time_s >= time_s);
        let next = next.unwrap_or(path.len() - 1);
        row.at = path[next].at;
    }
    Scene::of(rows)
}

/// A clock that steps back by seconds to minutes in the middle.
fn steps_back(random: &mut Random) -> Scene {
    let mut rows = Plain::draw(random).rows;
    let from = random.index(rows.len());
    let back_s = random.log_between(2.0, 300.0);
    rows.iter_mut().skip(from).for_each(|row| row.time_s -= back_s);
    Scene::of(rows)
}

/// Rows that come twice, or in each other's place.
fn duplicates(random: &mut Random) -> Scene {
    let mut rows = Plain::draw(random).rows;
    for _ in 0..random.count(3, 40) {
        let one = random.index(rows.len());
        let other = random.index(rows.len());
        if random.chance(0.5) {
            rows.swap(one, other);
        } else {
            let copy = rows[one].clone();
            rows.insert(other, copy);
        }
    }
    Scene::of(rows)
}

/// One level in eight is any.
fn outliers(random: &mut Random) -> Scene {
    let mut rows = Plain::draw(random).rows;
    for row in &mut rows {
        if random.chance(0.125) {
            let off_db = random.between(-30.0, 30.0);
            row.change("rss_dbm", |level| level + off_db);
        }
    }
    Scene::of(rows)
}

/// Another transmitter on the same frequency, that is the stronger one near itself.
fn another(random: &mut Random) -> Scene {
    let Plain { mut rows, path, side_m, mut radio, .. } = Plain::draw(random);
    let from = [random.between(0.0, side_m), random.between(0.0, side_m), 0.0];
    radio.power_dbm += random.between(-6.0, 6.0);
    let others = Receiver::default().receive(random, &path, from, &radio);
    for (row, other) in rows.iter_mut().zip(others) {
        let level = other.get("rss_dbm").unwrap_or(f64::NEG_INFINITY);
        row.change("rss_dbm", |own| own.max(level));
    }
    Scene::of(rows)
}

/// A transmitter that moves on the way; its truth is the place of the middle of the time.
fn moving(random: &mut Random) -> Scene {
    let Plain { path, from, radio, side_m, .. } = Plain::draw(random);
    let angle = random.between(0.0, TAU);
    let way_m = random.between(0.3, 1.0) * side_m;
    let last_s = path.last().map_or(1.0, |step| step.time_s).max(1.0);
    let mut rows = Vec::new();
    for step in &path {
        let along_m = way_m * (step.time_s / last_s - 0.5);
        let now = [from[0] + along_m * angle.cos(), from[1] + along_m * angle.sin(), 0.0];
        let receiver = Receiver::default();
        let received = receiver.receive(random, std::slice::from_ref(step), now, &radio);
        let middle = Some([from[0], from[1]]);
        rows.extend(received.into_iter().map(|row| Row { truth: middle, ..row }));
    }
    Scene::of(rows)
}

/// A transmitter that is switched off on the way: the receiver goes on with its noise.
fn switched_off(random: &mut Random) -> Scene {
    let mut rows = Plain::draw(random).rows;
    let least = rows.iter().filter_map(|row| row.get("rss_dbm")).fold(f64::INFINITY, f64::min);
    let off = random.index(rows.len() / 2) + rows.len() / 4;
    for row in rows.iter_mut().skip(off) {
        row.set("rss_dbm", (least - 5.0 + random.normal(0.7)).round());
    }
    Scene::of(rows)
}

/// A receiver that receives nothing but its noise.
fn silent(random: &mut Random) -> Scene {
    let mut plain = Plain::draw(random);
    plain.radio.power_dbm = -300.0;
    let floor = Floor::Hidden(random.between(-125.0, -95.0));
    let receiver = Receiver { floor, step_db: 1.0, ..Receiver::default() };
    let rows = receiver.receive(random, &plain.path, plain.from, &plain.radio);
    Scene { is_empty: true, hides_truth: true, ..Scene::of(rows) }
}
