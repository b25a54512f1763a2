use core::f64::consts::{FRAC_PI_2, TAU};

use super::{random::Random, scene::At};

/// A place of a receiver at a time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    pub(super) time_s: f64,
    pub(super) at: At,
    /// Number of the receiver.
    pub(super) receiver: u32,
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
pub(super) fn lanes(length_m: f64, width_m: f64, lanes: u32, step_m: f64, up_m: f64) -> Vec<Step> {
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
pub(super) fn streets(random: &mut Random, length_m: f64, block_m: f64, step_m: f64) -> Vec<Step> {
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
pub(super) fn home(random: &mut Random, from: [f64; 2], to: [f64; 2], step_m: f64) -> Vec<Step> {
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
pub(super) fn round(centre: [f64; 2], radius_m: f64, count: u32, up_m: f64) -> Vec<Step> {
    let place = |step: u32| {
        let (sin, cos) = (TAU * f64::from(step) / f64::from(count)).sin_cos();
        [centre[0] + radius_m * cos, centre[1] + radius_m * sin, up_m]
    };
    timed((0..count).map(place), 5.0)
}

/// A straight line to the East.
pub(super) fn straight(length_m: f64, count: u32, up_m: f64) -> Vec<Step> {
    let place = |step: u32| [length_m * f64::from(step) / f64::from(count.max(1)), 0.0, up_m];
    timed((0..=count).map(place), 5.0)
}

/// One place, held to within some metres.
pub(super) fn hover(random: &mut Random, at: At, count: u32, wander_m: f64) -> Vec<Step> {
    let step = |number: u32| {
        let off = [random.normal(wander_m), random.normal(wander_m)];
        let at = [at[0] + off[0], at[1] + off[1], at[2]];
        Step { time_s: f64::from(number), at, receiver: 0 }
    };
    (0..count).map(step).collect()
}

/// Receivers that stay at places over a square, each of which receives `rounds` times.
pub(super) fn nodes(random: &mut Random, count: u32, side_m: f64, rounds: u32) -> Vec<Step> {
    let places: Vec<At> = (0..count)
        .map(|_| [random.between(0.0, side_m), random.between(0.0, side_m), 3.0])
        .collect();
    of_places(&places, rounds, 10.0)
}

/// Receivers at given places, each of which receives `rounds` times.
pub(super) fn of_places(places: &[At], rounds: u32, every_s: f64) -> Vec<Step> {
    let of_round = |round: u32| {
        let time_s = every_s * f64::from(round);
        (0..).zip(places).map(move |(receiver, at)| Step { time_s, at: *at, receiver })
    };
    (0..rounds).flat_map(of_round).collect()
}

/// Converts a positive number to a whole one.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below a million")]
pub(super) fn whole(value: f64) -> u32 {
    value.round().clamp(0.0, 1e7) as u32
}
