//! Propagation and reception of levels along the ways of receivers, written apart from the
//! estimators' models.

use core::f64::consts::{FRAC_PI_2, TAU};

use crate::{
    random::Random,
    scene::{At, Row},
};

/// Loss through the floor of a storey in dB, and the height of a storey in metres.
const STOREY: (f64, f64) = (12.0, 2.8);

/// Waves of a field: the sum is near to normal.
const WAVES: u32 = 48;

/// Wavelength of what a reflection interferes at, in metres: 433 MHz.
const WAVELENGTH_M: f64 = 0.69;

/// A place of a receiver at a time.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    pub time_s: f64,
    pub at: At,
    /// Number of the receiver.
    pub receiver: u32,
}

/// A way from a transmitter to receivers: two slopes that meet at a distance, walls, a field of
/// shadowing over the plane, and a reflection from the ground.
#[derive(Clone, Debug)]
pub struct Radio {
    /// Level at one metre in dBm.
    pub power_dbm: f64,
    /// Exponent up to [`bend_m`](Self::bend_m).
    pub near: f64,
    /// Exponent beyond it.
    pub far: f64,
    /// Distance at which the slopes meet, in metres.
    pub bend_m: f64,
    /// σ of each reading's own error in dB.
    pub noise_db: f64,
    /// Growth of that σ per decade of distance beyond 10 m, in dB.
    pub growth_db: f64,
    pub field: Option<Field>,
    pub walls: Vec<Wall>,
    /// Amplitude of the ground's reflection over that of the direct wave.
    pub reflection: Option<f64>,
    /// Both antennas are upright dipoles.
    pub dipoles: bool,
}

/// Shadowing over the plane: a sum of waves in random directions (Rice 1944), whose correlation
/// falls to about 1/e over the length. It is the same wherever one passes again.
#[derive(Clone, Debug)]
pub struct Field {
    waves: Vec<[f64; 3]>,
    amplitude_db: f64,
}

/// A wall between two places, from the floor to the ceiling of all storeys.
#[derive(Clone, Copy, Debug)]
pub struct Wall {
    pub from: [f64; 2],
    pub to: [f64; 2],
    pub loss_db: f64,
}

impl Field {
    fn draw(random: &mut Random, sigma_db: f64, length_m: f64) -> Self {
        let wave = |_| {
            let direction = random.between(0.0, TAU);
            // A heavy tail: shadowing has sharp edges, too.
            let number = random.normal(1.0).abs() / random.between(0.4, 1.6) / length_m;
            [number * direction.cos(), number * direction.sin(), random.between(0.0, TAU)]
        };
        let waves: Vec<[f64; 3]> = (0..WAVES).map(wave).collect();
        Self { waves, amplitude_db: sigma_db * (2.0 / f64::from(WAVES)).sqrt() }
    }

    fn at(&self, at: At) -> f64 {
        let wave = |[east, north, phase]: &[f64; 3]| (east * at[0] + north * at[1] + phase).cos();
        self.amplitude_db * self.waves.iter().map(wave).sum::<f64>()
    }
}

impl Wall {
    /// Returns true if the straight way between two places goes through the wall.
    fn is_between(&self, one: At, other: At) -> bool {
        let side = |from: [f64; 2], to: [f64; 2], at: [f64; 2]| {
            (to[0] - from[0]) * (at[1] - from[1]) - (to[1] - from[1]) * (at[0] - from[0]) > 0.0
        };
        let one = [one[0], one[1]];
        let other = [other[0], other[1]];
        side(self.from, self.to, one) != side(self.from, self.to, other)
            && side(one, other, self.from) != side(one, other, self.to)
    }
}

impl Radio {
    /// A single slope with independent errors.
    pub fn white(random: &mut Random, sigma_db: f64) -> Self {
        let exponent = random.between(2.0, 3.2);
        Self {
            power_dbm: random.between(-45.0, -15.0),
            near: exponent,
            far: exponent,
            bend_m: 1.0,
            noise_db: sigma_db,
            growth_db: 0.0,
            field: None,
            walls: Vec::new(),
            reflection: None,
            dipoles: false,
        }
    }

    /// Open country or a suburb: two slopes, and shadowing over 10 to 60 m.
    pub fn usual(random: &mut Random) -> Self {
        let noise_db = random.between(1.0, 2.5);
        let sigma_db = random.between(2.5, 6.0);
        let length_m = random.log_between(10.0, 60.0);
        Self {
            near: random.between(1.9, 2.3),
            far: random.between(2.2, 3.8),
            bend_m: random.log_between(20.0, 150.0),
            field: Some(Field::draw(random, sigma_db, length_m)),
            ..Self::white(random, noise_db)
        }
    }

    /// Level without the reading's own error, in dBm.
    pub fn level(&self, from: At, at: At) -> f64 {
        let ground_m = (at[0] - from[0]).hypot(at[1] - from[1]);
        let distance_m = ground_m.hypot(at[2] - from[2]).max(0.3);
        let near_m = distance_m.min(self.bend_m);
        let mut level = self.power_dbm - 10.0 * self.near * near_m.log10();
        level -= 10.0 * self.far * (distance_m / near_m).log10();
        if let Some(amplitude) = self.reflection {
            let reflected_m = ground_m.hypot(at[2] + from[2]);
            let (sin, cos) = (TAU * (reflected_m - distance_m) / WAVELENGTH_M).sin_cos();
            level += 20.0 * (1.0 - amplitude * cos).hypot(amplitude * sin).log10();
        }
        if self.dipoles {
            level += 40.0 * (ground_m / distance_m).max(0.03).log10();
        }
        level += self.field.as_ref().map_or(0.0, |field| field.at(at));
        level -=
            self.walls.iter().filter(|w| w.is_between(from, at)).map(|w| w.loss_db).sum::<f64>();
        if !self.walls.is_empty() {
            let (loss_db, storey_m) = STOREY;
            let storeys = (at[2] / storey_m).floor() - (from[2] / storey_m).floor();
            level -= loss_db * storeys.abs();
        }
        level
    }

    /// σ of a reading's own error at a distance.
    pub fn sigma_db(&self, from: At, at: At) -> f64 {
        let distance_m = (at[0] - from[0]).hypot(at[1] - from[1]).max(10.0);
        (self.noise_db + self.growth_db * (distance_m / 10.0).log10()).max(0.1)
    }
}

/// A receiver, and what it makes of levels.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// Level of its own noise.
    pub floor: Floor,
    /// Largest level that it shows.
    pub ceiling_dbm: f64,
    /// Levels are multiples of this, in dB.
    pub step_db: f64,
    /// σ of the recorded places per axis, in metres.
    pub gnss_m: f64,
    /// σ of the gain of one receiver beside the others, in dB.
    pub offset_db: f64,
}

/// Fate of levels below the receiver's noise.
#[derive(Clone, Copy, Debug)]
pub enum Floor {
    /// There is no noise.
    Absent,
    /// The noise stands for the level, and the recording has its level in `floor_dbm`.
    Stated(f64),
    /// The noise stands for the level, and nothing says so.
    Hidden(f64),
    /// There is no row.
    Lost(f64),
}

impl Default for Receiver {
    /// A receiver without floor and ceiling at exact places, which rounds to 0.1 dB.
    fn default() -> Self {
        Self {
            floor: Floor::Absent,
            ceiling_dbm: f64::INFINITY,
            step_db: 0.1,
            gnss_m: 0.0,
            offset_db: 0.0,
        }
    }
}

impl Receiver {
    /// Rounds and clips a level.
    fn shown(&self, level: f64) -> f64 {
        (level.min(self.ceiling_dbm) / self.step_db).round() * self.step_db
    }

    /// Receives a transmitter along a path.
    pub fn receive(&self, random: &mut Random, path: &[Step], from: At, radio: &Radio) -> Vec<Row> {
        let receivers = path.iter().map(|step| step.receiver).max().unwrap_or(0);
        let offsets: Vec<f64> = (0..=receivers).map(|_| random.normal(self.offset_db)).collect();
        // The error of GNSS places wanders: it keeps 0.95 of itself from row to row.
        let mut error_m = [random.normal(self.gnss_m), random.normal(self.gnss_m)];
        let mut rows = Vec::with_capacity(path.len());
        for step in path {
            let own_m = self.gnss_m * (1.0 - 0.95_f64.powi(2)).sqrt();
            error_m = error_m.map(|error| 0.95 * error + random.normal(own_m));
            let offset = offsets.get(usize::try_from(step.receiver).unwrap_or(0)).unwrap_or(&0.0);
            let sigma_db = radio.sigma_db(from, step.at);
            let level = radio.level(from, step.at) + offset + random.normal(sigma_db);
            let at = [step.at[0] + error_m[0], step.at[1] + error_m[1], step.at[2]];
            let mut row = Row::new(step.time_s, at, from);
            row.receiver = (receivers > 0).then_some(step.receiver);
            let level = match self.floor {
                Floor::Absent => level,
                Floor::Lost(floor) if level < floor => continue,
                Floor::Lost(_) => level,
                Floor::Hidden(floor) => level.max(floor + random.normal(0.7)),
                Floor::Stated(floor) => {
                    // Nine in ten readings of noise alone lie below what is called the floor.
                    row.set("floor_dbm", floor + 1.0);
                    level.max(floor + random.normal(0.7))
                }
            };
            rows.push(row.with("rss_dbm", self.shown(level)));
        }
        rows
    }
}

/// Places along a way at a constant speed.
fn timed(places: impl IntoIterator<Item = At>, speed_mps: f64) -> Vec<Step> {
    let mut steps: Vec<Step> = Vec::new();
    for at in places {
        let time_s = steps.last().map_or(0.0, |last| {
            let way_m = (at[0] - last.at[0]).hypot(at[1] - last.at[1]);
            last.time_s + (way_m / speed_mps).max(0.5)
        });
        steps.push(Step { time_s, at, receiver: 0 });
    }
    steps
}

/// A lawnmower's lanes over a rectangle with a corner at the origin.
pub fn lanes(length_m: f64, width_m: f64, lanes: u32, step_m: f64, up_m: f64) -> Vec<Step> {
    let apart_m = width_m / f64::from(lanes.saturating_sub(1).max(1));
    let along = whole(length_m / step_m);
    let place = |lane: u32, step: u32| {
        let forth = f64::from(step) * length_m / f64::from(along.max(1));
        let east = if lane.is_multiple_of(2) { forth } else { length_m - forth };
        [east, f64::from(lane) * apart_m, up_m]
    };
    timed((0..lanes).flat_map(|lane| (0..=along).map(move |step| place(lane, step))), 5.0)
}

/// A drive on a grid of streets.
pub fn streets(random: &mut Random, length_m: f64, block_m: f64, step_m: f64) -> Vec<Step> {
    let mut at = [0.0, 0.0];
    let mut heading = f64::from(random.count(0, 3)) * FRAC_PI_2;
    let mut places = vec![[0.0, 0.0, 1.5]];
    let mut left_m = length_m;
    let mut to_crossing_m = block_m;
    while left_m > 0.0 {
        let go_m = step_m.min(to_crossing_m);
        at[0] += go_m * heading.cos();
        at[1] += go_m * heading.sin();
        places.push([at[0], at[1], 1.5]);
        left_m -= go_m;
        to_crossing_m -= go_m;
        if to_crossing_m <= 1e-6 {
            to_crossing_m = block_m;
            if random.chance(0.35) {
                heading += random.sign() * FRAC_PI_2;
            }
        }
    }
    timed(places, 12.0)
}

/// A walk that ends at a place, with detours that grow shorter.
pub fn home(random: &mut Random, from: [f64; 2], to: [f64; 2], step_m: f64) -> Vec<Step> {
    let length_m = (to[0] - from[0]).hypot(to[1] - from[1]);
    let count = whole(length_m / step_m).max(2);
    let swing_m = random.between(0.05, 0.25) * length_m;
    let turns = random.between(2.0, 5.0);
    let place = |step: u32| {
        let done = f64::from(step) / f64::from(count);
        let aside = swing_m * (1.0 - done) * (TAU * turns * done).sin() / length_m;
        let way = [to[0] - from[0], to[1] - from[1]];
        let east = from[0] + done * way[0] - aside * way[1];
        [east, from[1] + done * way[1] + aside * way[0], 1.5]
    };
    timed((0..=count).map(place), 1.4)
}

/// A loop about a centre.
pub fn round(centre: [f64; 2], radius_m: f64, count: u32, up_m: f64) -> Vec<Step> {
    let place = |step: u32| {
        let (sin, cos) = (TAU * f64::from(step) / f64::from(count)).sin_cos();
        [centre[0] + radius_m * cos, centre[1] + radius_m * sin, up_m]
    };
    timed((0..count).map(place), 5.0)
}

/// A straight line to the East.
pub fn straight(length_m: f64, count: u32, up_m: f64) -> Vec<Step> {
    let place = |step: u32| [length_m * f64::from(step) / f64::from(count.max(1)), 0.0, up_m];
    timed((0..=count).map(place), 5.0)
}

/// One place, held to within some metres.
pub fn hover(random: &mut Random, at: At, count: u32, wander_m: f64) -> Vec<Step> {
    let step = |number: u32| {
        let off = [random.normal(wander_m), random.normal(wander_m)];
        let at = [at[0] + off[0], at[1] + off[1], at[2]];
        Step { time_s: f64::from(number), at, receiver: 0 }
    };
    (0..count).map(step).collect()
}

/// Receivers that stay at places over a square, each of which receives `rounds` times.
pub fn nodes(random: &mut Random, count: u32, side_m: f64, rounds: u32) -> Vec<Step> {
    let places: Vec<At> = (0..count)
        .map(|_| [random.between(0.0, side_m), random.between(0.0, side_m), 3.0])
        .collect();
    of_places(&places, rounds, 10.0)
}

/// Receivers at given places, each of which receives `rounds` times.
pub fn of_places(places: &[At], rounds: u32, every_s: f64) -> Vec<Step> {
    let of_round = |round: u32| {
        let time_s = every_s * f64::from(round);
        (0..).zip(places).map(move |(receiver, at)| Step { time_s, at: *at, receiver })
    };
    (0..rounds).flat_map(of_round).collect()
}

/// Converts a positive number to a whole one.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below a million")]
pub fn whole(value: f64) -> u32 {
    value.round().clamp(0.0, 1e7) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn slopes_meet_and_walls_take_their_loss() {
        let mut random = Random::new("test", 1);
        let mut radio = Radio::white(&mut random, 1.0);
        radio.power_dbm = -30.0;
        radio.near = 2.0;
        radio.far = 4.0;
        radio.bend_m = 10.0;
        let level = |radio: &Radio, east: f64| radio.level([0.0; 3], [east, 0.0, 0.0]);
        assert_abs_diff_eq!(level(&radio, 10.0), -50.0, epsilon = 1e-9);
        assert_abs_diff_eq!(level(&radio, 100.0), -90.0, epsilon = 1e-9);
        radio.walls.push(Wall { from: [5.0, -1.0], to: [5.0, 1.0], loss_db: 7.0 });
        assert_abs_diff_eq!(level(&radio, 10.0), -57.0, epsilon = 1e-9);
        assert_abs_diff_eq!(level(&radio, 4.0), -42.041, epsilon = 1e-3);
        let aside = radio.level([0.0; 3], [10.0, 10.0, 0.0]);
        assert!((aside + 50.0 + 40.0 * 2.0_f64.sqrt().log10()).abs() < 1e-9, "it misses the wall");
    }

    #[test]
    fn a_field_has_its_spread_and_forgets_over_its_length() {
        let mut random = Random::new("field", 1);
        let [mut square, mut near, mut far] = [0.0; 3];
        for _ in 0..2000 {
            let field = Field::draw(&mut random, 5.0, 30.0);
            let here = field.at([100.0, 40.0, 0.0]);
            square += here * here;
            near += here * field.at([103.0, 40.0, 0.0]);
            far += here * field.at([100.0, 340.0, 0.0]);
        }
        // 2000 draws: the standard error of the variance is 3 %, of the correlations 2 %.
        assert_abs_diff_eq!(square / 2000.0 / 25.0, 1.0, epsilon = 0.15);
        assert!(near / square > 0.9, "{near}");
        assert_abs_diff_eq!(far / square, 0.0, epsilon = 0.15);
    }
}
