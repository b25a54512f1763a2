//! Lists of pulses whose tags are known.

use approx::{abs_diff_eq, assert_abs_diff_eq};
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

/// The band of a receiver, and the disturbances of the pulses in it.
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

/// Shares: of the tags' detected pulses, those given to tags that are in them and to no other; of
/// clutter, that given to none; of the pulses sent, those that collided.
#[derive(Debug)]
struct Shares {
    right: f64,
    clutter: f64,
    collisions: f64,
}

fn shares(sent: &[Sent], given: &Association, of_tag: impl Fn(usize) -> Option<usize>) -> Shares {
    let mut holders: Vec<Vec<Option<usize>>> = vec![Vec::new(); sent.len()];
    for (index, tag) in given.tags.iter().enumerate() {
        tag.pulses.iter().for_each(|pulse| holders[*pulse].push(of_tag(index)));
    }
    let is_right = |index: usize| {
        let held = &holders[index];
        let from = &sent[index].1;
        !held.is_empty() && held.iter().all(|tag| tag.is_some_and(|tag| from.contains(&tag)))
    };
    let share = |wanted: &dyn Fn(&Sent) -> bool, right: &dyn Fn(usize) -> bool| {
        let of: Vec<usize> = (0..sent.len()).filter(|index| wanted(&sent[*index])).collect();
        of.iter().filter(|index| right(**index)).count() as f64 / of.len().max(1) as f64
    };
    // Of pulses as they were sent.
    let from_tags = sent.iter().map(|(_, from)| from.len()).sum::<usize>() as f64;
    let in_others = |(_, from): &&Sent| from.len() > 1;
    let collided = sent.iter().filter(in_others).map(|(_, from)| from.len()).sum::<usize>() as f64;
    Shares {
        right: share(&|(_, from)| !from.is_empty(), &is_right),
        clutter: share(&|(_, from)| from.is_empty(), &|index| holders[index].is_empty()),
        collisions: collided / from_tags,
    }
}

const BAND: Band =
    Band { seconds: 45.0, jitter_s: 1e-3, detection: 0.95, clutter_hz: 0.5, width_hz: 850.0 };

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

/// As a user would set them who knows his tags and his detector.
fn config() -> AssociationConfig {
    let mut config = AssociationConfig::default();
    config.frequency_tolerance_hz = 30.0;
    config.frequency_sigma_hz = 15.0;
    config.interval_tolerance = 0.004;
    config.max_missed = 12;
    config
}

/// The tag of most of these pulses.
fn of_most(sent: &[Sent], pulses: &[usize]) -> Option<usize> {
    let mut counts = [0_usize; 64];
    pulses.iter().flat_map(|index| &sent[*index].1).for_each(|tag| counts[*tag] += 1);
    (0..counts.len()).max_by_key(|tag| counts[*tag]).filter(|tag| counts[*tag] > 0)
}

/// Shares with the tags of the table, or with none: then a train is the tag of most of its pulses.
fn measured(seed: u64, are_known: bool) -> Shares {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let tags = drawn(20, BAND, &mut rng);
    let sent = received(&tags, BAND, &mut rng);
    let table = if are_known { table(&tags, &mut rng) } else { TagTable::default() };
    let given = associate(&pulses(&sent), &table, &config()).expect("in range");
    let by_name = |index: usize| given.tags[index].names.first()?.parse().ok();
    let by_pulses = |index: usize| of_most(&sent, &given.tags[index].pulses);
    if are_known { shares(&sent, &given, by_name) } else { shares(&sent, &given, by_pulses) }
}

/// Over these seeds the mean share of right pulses less 1.96 standard errors, from band to band,
/// the mean share of pulses that collided, and of clutter that was left.
fn at_least(seeds: std::ops::Range<u64>, are_known: bool) -> [f64; 3] {
    let n = (seeds.end - seeds.start) as f64;
    let all: Vec<Shares> = seeds.map(|seed| measured(seed, are_known)).collect();
    let mean = |of: fn(&Shares) -> f64| all.iter().map(of).sum::<f64>() / n;
    let right = mean(|shares| shares.right);
    let variance = all.iter().map(|s| (s.right - right).powi(2)).sum::<f64>() / (n - 1.0);
    [right - 1.96 * (variance / n).sqrt(), mean(|s| s.collisions), mean(|s| s.clutter)]
}

#[test]
fn twenty_known_tags_in_one_band() {
    let [right, collisions, clutter] = at_least(0..3, true);
    assert!(
        right >= 0.95 && collisions >= 0.095 && clutter >= 0.9,
        "{right} {collisions} {clutter}"
    );
}

#[test]
#[ignore = "minutes"]
fn twenty_tags_in_six_bands() {
    for are_known in [true, false] {
        let [right, collisions, clutter] = at_least(0..6, are_known);
        let figures = format!("{are_known}: {right} {collisions} {clutter}");
        assert!(right >= 0.95 && collisions >= 0.095 && clutter >= 0.9, "{figures}");
        println!("{figures}");
    }
}

/// One tag alone, in a band of its own.
fn one(truth: Truth, band: Band, seed: u64) -> (Vec<Sent>, Vec<Truth>) {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let tags = vec![truth];
    (received(&tags, band, &mut rng), tags)
}

fn tag(interval_s: f64) -> Truth {
    Truth { interval_s, frequency_hz: 100.0, changes: None, phase_s: 0.3, level_dbm: -80.0 }
}

#[test]
fn a_tag_changes_to_its_other_interval() {
    let truth = Truth { changes: Some((60.0, 0.65)), ..tag(1.3) };
    let (sent, _) = one(truth, Band { seconds: 120.0, ..BAND }, 5);
    let known = KnownTag::new("otter", 1.3).with_other_interval_s(0.65).with_frequency_hz(100.0);
    let table = TagTable::new(vec![known]);
    let given = associate(&pulses(&sent), &table, &config()).expect("in range");
    assert_eq!(given.tags.len(), 1);
    let tag = &given.tags[0];
    let right = tag.pulses.iter().filter(|index| !sent[**index].1.is_empty()).count();
    let from_tag = sent.iter().filter(|(_, from)| !from.is_empty()).count();
    assert!(right as f64 >= 0.97 * from_tag as f64, "{right} of {from_tag}");
    assert_eq!((tag.changes, tag.names[0].as_str()), (1, "otter"));
    let after = sent.iter().filter(|(pulse, from)| !from.is_empty() && pulse.time_s > 61.0).count();
    assert!(tag.by_other_interval.abs_diff(after) <= 2, "{} {after}", tag.by_other_interval);
}

#[test]
fn a_tag_of_which_half_is_missed() {
    let band = Band { seconds: 180.0, detection: 0.5, ..BAND };
    let (sent, _) = one(tag(1.7), band, 6);
    let given = associate(&pulses(&sent), &TagTable::default(), &config()).expect("in range");
    assert_eq!(given.tags.len(), 1, "{given:?}");
    let tag = &given.tags[0];
    assert_abs_diff_eq!(tag.interval_s, 1.7, epsilon = 0.002);
    let expected = (180.0 / 1.7) as i64;
    let all = tag.pulses.len() as i64 + i64::from(tag.missed);
    assert_abs_diff_eq!(all, expected, epsilon = 8);
}

/// Two coded tags on one frequency that are in no table, one pulse in twenty missed, three false
/// pulses a second: both, with their gaps, and nearly all of their whole bursts.
#[test]
fn coded_tags_of_no_table_are_found_by_gaps_that_come_again() {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(12);
    let codes = [(5.31, [0.022, 0.031, 0.045]), (7.87, [0.041, 0.022, 0.036])];
    let mut pulses = Vec::new();
    let mut whole = [0; 2];
    for ((interval, gaps), whole) in codes.iter().zip(&mut whole) {
        let mut begin = 1.7 * interval;
        while begin < 400.0 {
            let offsets = [0.0, gaps[0], gaps[0] + gaps[1], gaps.iter().sum()];
            let received = offsets.map(|_| rng.random::<f64>() < 0.95);
            for offset in
                offsets.iter().zip(received).filter(|(_, received)| *received).map(|(o, _)| o)
            {
                let time = begin + offset + 0.2e-3 * normal(&mut rng);
                pulses.push(Pulse::new(time, 50.0 * normal(&mut rng), 0.0025, -80.0, 20.0));
            }
            *whole += usize::from(received.iter().all(|received| *received));
            begin += interval;
        }
    }
    for _ in 0..1200 {
        let time = 400.0 * rng.random::<f64>();
        let frequency = 2000.0 * (rng.random::<f64>() - 0.5);
        pulses.push(Pulse::new(time, frequency, 0.0025, -95.0, 14.0));
    }
    let given = associate(&pulses, &TagTable::default(), &AssociationConfig::default());
    let mut tags = given.expect("in range").tags;
    tags.sort_by(|a, b| a.interval_s.total_cmp(&b.interval_s));
    assert_eq!(
        tags.len(),
        2,
        "{:?}",
        tags.iter().map(|t| (t.interval_s, &t.gaps_s)).collect::<Vec<_>>()
    );
    for ((tag, (interval, gaps)), whole) in tags.iter().zip(codes).zip(whole) {
        assert_abs_diff_eq!(tag.interval_s, interval, epsilon = 2e-3);
        assert_eq!(tag.gaps_s.len(), 3, "{:?}", tag.gaps_s);
        for (gap, sent) in tag.gaps_s.iter().zip(gaps) {
            assert!(abs_diff_eq!(*gap, sent, epsilon = 0.3e-3), "{:?}", tag.gaps_s);
        }
        // A pulse of clutter may stand for one that was missed.
        assert!(
            (0.95..1.2).contains(&(tag.bursts as f64 / whole as f64)),
            "{} of {whole}",
            tag.bursts
        );
    }
}

#[test]
fn noise_holds_no_tag() {
    // 40 lists at 0.001 false tags each: none, but for one time in 25.
    for seed in 0..40 {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(100 + seed);
        let band = Band { clutter_hz: 8.0, ..BAND };
        let sent = received(&[], band, &mut rng);
        let given = associate(&pulses(&sent), &TagTable::default(), &config()).expect("in range");
        assert!(given.tags.is_empty(), "seed {seed}: {:?}", given.tags);
    }
}
