//! Lists of pulses whose tags are known.

use std::f64::consts::PI;

use foxhunt_signal::{
    Pulse,
    tags::{Association, AssociationConfig, KnownTag, TagTable, associate},
};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};

const WIDTH_S: f64 = 0.02;

/// A tag as it is.
#[derive(Debug, Clone)]
struct Truth {
    interval_s: f64,
    frequency_hz: f64,
    /// From this time on it has this interval.
    changes: Option<(f64, f64)>,
    phase_s: f64,
    level_dbm: f64,
}

/// What a receiver in one band makes of tags.
#[derive(Debug, Clone, Copy)]
struct Band {
    seconds: f64,
    jitter_s: f64,
    detection: f64,
    clutter_hz: f64,
    width_hz: f64,
}

/// A pulse, and the tags that are in it: none of clutter, several of a collision.
type Sent = (Pulse, Vec<usize>);

fn normal(rng: &mut Xoshiro256PlusPlus) -> f64 {
    (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt() * (2.0 * PI * rng.random::<f64>()).cos()
}

/// Tags drawn over a band of frequencies, their intervals from 1 to 1.6 s.
fn drawn(number: usize, band: Band, rng: &mut Xoshiro256PlusPlus) -> Vec<Truth> {
    let tag = |_| Truth {
        interval_s: 1.0 + 0.6 * rng.random::<f64>(),
        frequency_hz: band.width_hz * (rng.random::<f64>() - 0.5),
        changes: None,
        phase_s: rng.random(),
        level_dbm: -90.0 + 20.0 * rng.random::<f64>(),
    };
    (0..number).map(tag).collect()
}

/// The pulses that a detector gives. Two that overlap in time, nearer in frequency than two bins of
/// a pulse's length, are one: at the time and frequency of both, weighed by their powers.
fn received(tags: &[Truth], band: Band, rng: &mut Xoshiro256PlusPlus) -> Vec<Sent> {
    let mut sent: Vec<Sent> = Vec::new();
    for (index, tag) in tags.iter().enumerate() {
        let mut time = tag.phase_s;
        while time < band.seconds {
            if rng.random::<f64>() < band.detection {
                let frequency = tag.frequency_hz + 10.0 * normal(rng);
                let measured = time + 0.5e-3 * normal(rng);
                let width = WIDTH_S * (0.1 * normal(rng)).exp();
                let level = tag.level_dbm + 3.0 * normal(rng);
                sent.push((Pulse::new(measured, frequency, width, level, 20.0), vec![index]));
            }
            let interval = match tag.changes {
                Some((from, interval)) if time >= from => interval,
                _ => tag.interval_s,
            };
            time += interval + band.jitter_s * normal(rng);
        }
    }
    let mut time = 0.0;
    loop {
        time -= (1.0 - rng.random::<f64>()).ln() / band.clutter_hz;
        if time.is_nan() || time > band.seconds {
            break;
        }
        let width = 0.0025 * 16.0_f64.powf(rng.random());
        let frequency = band.width_hz * (rng.random::<f64>() - 0.5);
        sent.push((Pulse::new(time, frequency, width, -95.0, 14.0), Vec::new()));
    }
    sent.sort_by(|a, b| a.0.time_s.total_cmp(&b.0.time_s));
    let mut merged: Vec<Sent> = Vec::new();
    for (pulse, from) in sent {
        let overlaps = |(last, _): &&mut Sent| {
            pulse.time_s - last.time_s < WIDTH_S
                && (pulse.frequency_hz - last.frequency_hz).abs() < 2.0 / WIDTH_S
        };
        let Some((last, tags)) = merged.iter_mut().rev().take(8).find(overlaps) else {
            merged.push((pulse, from));
            continue;
        };
        let [a, b] = [last.power_dbm, pulse.power_dbm].map(|dbm| 10f64.powf(0.1 * dbm));
        let mean = |x: f64, y: f64| (a * x + b * y) / (a + b);
        last.time_s = mean(last.time_s, pulse.time_s);
        last.frequency_hz = mean(last.frequency_hz, pulse.frequency_hz);
        last.power_dbm = 10.0 * (a + b).log10();
        tags.extend(from);
    }
    merged
}

/// Shares of the tags' pulses: of those that came alone, given to their tag and no other; of those
/// that collided, to one that is in them; of both; and of clutter, given to none.
#[derive(Debug)]
struct Shares {
    alone: f64,
    collided: f64,
    all: f64,
    clutter: f64,
    collisions: f64,
}

fn shares(sent: &[Sent], given: &Association, of_tag: impl Fn(usize) -> Option<usize>) -> Shares {
    let mut holders: Vec<Vec<Option<usize>>> = vec![Vec::new(); sent.len()];
    for (index, tag) in given.tags.iter().enumerate() {
        tag.pulses.iter().for_each(|pulse| holders[*pulse].push(of_tag(index)));
    }
    let is_right = |index: usize| {
        let (held, from) = (&holders[index], &sent[index].1);
        !held.is_empty() && held.iter().all(|tag| tag.is_some_and(|tag| from.contains(&tag)))
    };
    let share = |wanted: &dyn Fn(&Sent) -> bool, right: &dyn Fn(usize) -> bool| {
        let of: Vec<usize> = (0..sent.len()).filter(|index| wanted(&sent[*index])).collect();
        of.iter().filter(|index| right(**index)).count() as f64 / of.len().max(1) as f64
    };
    let from_tags = sent.iter().filter(|(_, from)| !from.is_empty()).count() as f64;
    Shares {
        alone: share(&|(_, from)| from.len() == 1, &is_right),
        collided: share(&|(_, from)| from.len() > 1, &is_right),
        all: share(&|(_, from)| !from.is_empty(), &is_right),
        clutter: share(&|(_, from)| from.is_empty(), &|index| holders[index].is_empty()),
        collisions: sent.iter().filter(|(_, from)| from.len() > 1).count() as f64 / from_tags,
    }
}

const BAND: Band =
    Band { seconds: 120.0, jitter_s: 1e-3, detection: 0.95, clutter_hz: 0.5, width_hz: 1e3 };

fn table(tags: &[Truth], rng: &mut Xoshiro256PlusPlus) -> TagTable {
    let known = |(index, tag): (usize, &Truth)| {
        // As a list of frequencies by hand has it.
        let frequency = tag.frequency_hz + 20.0 * normal(rng);
        let interval = tag.interval_s * (1.0 + 0.002 * normal(rng));
        KnownTag::new(index.to_string(), interval)
            .with_frequency_hz(frequency)
            .with_width_s(WIDTH_S)
    };
    TagTable::new(tags.iter().enumerate().map(known).collect())
}

fn pulses(sent: &[Sent]) -> Vec<Pulse> {
    sent.iter().map(|(pulse, _)| *pulse).collect()
}

#[test]
fn twenty_known_tags_in_one_band() {
    let mut config = AssociationConfig::default();
    config.frequency_tolerance_hz = 30.0;
    config.frequency_sigma_hz = 15.0;
    for seed in 0..1 {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let tags = drawn(20, BAND, &mut rng);
        let sent = received(&tags, BAND, &mut rng);
        let given = associate(&pulses(&sent), &table(&tags, &mut rng), &config).expect("in range");
        let of = |index: usize| given.tags[index].names.first()?.parse().ok();
        println!("{seed} {} {:?}", given.tags.len(), shares(&sent, &given, of));
        let given = associate(&pulses(&sent), &TagTable::default(), &config).expect("in range");
        let of = |index: usize| nearest(&sent, &given.tags[index].pulses);
        println!("unknown {seed} {} {:?}", given.tags.len(), shares(&sent, &given, of));
    }
}

/// The tag of most of these pulses.
fn nearest(sent: &[Sent], pulses: &[usize]) -> Option<usize> {
    let mut counts = [0_usize; 64];
    pulses.iter().flat_map(|index| &sent[*index].1).for_each(|tag| counts[*tag] += 1);
    (0..counts.len()).max_by_key(|tag| counts[*tag]).filter(|tag| counts[*tag] > 0)
}
