//! Trains of pulses that are too weak one by one: the energies of several are added up before it is
//! decided, over all starts, intervals, frequencies and drifts (fast folding, Staelin 1969).

mod comb;
mod map;
mod search;

pub use search::TrainDetector;

use std::collections::BTreeMap;

use rustfft::num_complex::{Complex32, Complex64};
use serde::Serialize;

use super::{
    Front, View,
    channeliser::{bessel_i0, float},
    index, samples,
};
use crate::Pulse;
use map::{Map, limited};

/// The share of pulses that are missing, before anything is known.
const MISSING: f64 = 0.2;

/// ln of the odds of a train's first and last pulse, at least: beyond the ends the best of several
/// places is tried, so that noise looks like a pulse more often than within.
const CLEAR: f64 = 4.0;

/// The places of a train's pulses, in samples of a channel and cycles per sample.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Course {
    /// The beginning of the first pulse.
    start: f64,
    interval: f64,
    /// The frequency of the first pulse.
    frequency: f64,
    /// The frequency's rise from a pulse to the next.
    drift: f64,
}

impl Course {
    fn place(&self, pulse: usize) -> f64 {
        self.start + float(pulse) * self.interval
    }

    fn frequency(&self, pulse: usize) -> f64 {
        self.frequency + float(pulse) * self.drift
    }
}

/// The energy of one pulse of a train.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Energy {
    /// Energy over the noise's power density, without what is no pulse.
    energy: f64,
    /// The noise's power in a sample.
    noise: f64,
}

/// Samples of a channel in which trains are measured.
struct Scene<'a> {
    samples: &'a [Complex32],
    /// The first sample's index.
    origin: u64,
    /// The index of the map's first frame.
    first: u64,
    map: &'a Map,
    /// The noise's power at an index and a frequency.
    noise: &'a dyn Fn(f64, f64) -> f64,
    ceiling: f64,
    pulses: usize,
    /// The steepest drift from a pulse to the next.
    steepest: f64,
}

impl Scene<'_> {
    fn view(&self) -> View<'_> {
        View { samples: self.samples, noise: 1.0 }
    }

    /// The energy at a place and a frequency; 0 where there are no samples.
    fn energy(&self, place: f64, frequency: f64) -> Energy {
        let noise = (self.noise)(place, frequency);
        let begin = place - index(self.origin);
        if begin < 0.0 {
            return Energy { energy: 0.0, noise };
        }
        let power = self.view().energy(samples(begin), self.map.length, frequency);
        Energy { energy: power * self.share(place, frequency) / noise, noise }
    }

    fn share(&self, place: f64, frequency: f64) -> f64 {
        let frame = (place - index(self.first)) / float(self.map.hop);
        self.map.share(frame, frequency)
    }

    fn energies(&self, course: &Course) -> Vec<Energy> {
        let energy = |n: usize| self.energy(course.place(n), course.frequency(n));
        (0..self.pulses).map(energy).collect()
    }

    /// The energy, limited by the ceiling.
    fn limited(&self, energy: f64) -> f64 {
        #[expect(clippy::cast_possible_truncation, reason = "energies are f32")]
        let limited = limited(energy as f32, self.ceiling as f32);
        f64::from(limited)
    }

    fn statistic(&self, energies: &[Energy]) -> f64 {
        energies.iter().map(|energy| self.limited(energy.energy)).sum()
    }

    fn value(&self, course: &Course) -> f64 {
        self.statistic(&self.energies(course))
    }

    /// The best course between the points of the grid.
    fn refine(&self, course: Course) -> Course {
        let bin = 0.5 / float(self.map.length);
        let course = self.best(course, bin / 2.0, |course, by| Course {
            frequency: course.frequency + by,
            ..course
        });
        let course = self.best_times(course);
        let middle = (float(self.pulses) - 1.0) / 2.0;
        let steepest = self.steepest;
        let course = if steepest > 0.0 {
            // By half a bin at the ends, about the middle.
            let step = (bin / 2.0 / middle).min(steepest);
            self.best(course, step, |course, by| {
                let drift = (course.drift + by).clamp(-steepest, steepest);
                let frequency = course.frequency - (drift - course.drift) * middle;
                Course { frequency, drift, ..course }
            })
        } else {
            course
        };
        self.best(course, bin / 4.0, |course, by| Course {
            frequency: course.frequency + by,
            ..course
        })
    }

    /// Refines a course as long as that wins: a strong train is above the threshold at places far
    /// from its own.
    fn climb(&self, course: Course) -> Course {
        let mut best = course;
        let mut of = self.value(&course);
        for _ in 0..6 {
            let next = self.refine(best);
            let value = self.value(&next);
            if value <= of + 1e-3 {
                break;
            }
            (best, of) = (next, value);
        }
        best
    }

    /// Steps uphill, then the vertex of the parabola through three points.
    fn best(&self, course: Course, step: f64, moved: impl Fn(Course, f64) -> Course) -> Course {
        let mut course = course;
        let at = |course: Course, by: f64| self.value(&moved(course, by));
        let mut middle = self.value(&course);
        let [mut low, mut high] = [at(course, -step), at(course, step)];
        for _ in 0..3 {
            if high > middle && high >= low {
                course = moved(course, step);
                (low, middle, high) = (middle, high, at(course, step));
            } else if low > middle {
                course = moved(course, -step);
                (low, middle, high) = (at(course, -step), low, middle);
            } else {
                break;
            }
        }
        let curvature = 2.0 * middle - low - high;
        if curvature <= 0.0 {
            return course;
        }
        let by = step * ((high - low) / (2.0 * curvature)).clamp(-0.5, 0.5);
        let vertex = moved(course, by);
        if self.value(&vertex) > middle { vertex } else { course }
    }

    /// The best start within a hop and the best interval within a step of the grid.
    fn best_times(&self, course: Course) -> Course {
        let Map { length, hop, .. } = *self.map;
        let middle = (float(self.pulses) - 1.0) / 2.0;
        // Starts are tried this far from those of the course.
        let reach = 2 * hop;
        let step = time_step(length);
        let tried: Vec<(Vec<Complex64>, f64)> = (0..self.pulses)
            .map(|pulse| {
                let place = course.place(pulse);
                let frequency = course.frequency(pulse);
                let begin = place.round() - index(self.origin) - float(reach);
                let from = samples(begin);
                let to = (from + 2 * reach + length).min(self.samples.len());
                if begin < 0.0 || to < from + 2 * reach + length {
                    return (Vec::new(), 0.0);
                }
                let noise = (self.noise)(place, frequency) * float(length);
                (self.view().sums(from, to, frequency), self.share(place, frequency) / noise)
            })
            .collect();
        let value = |later: f64, longer: f64| -> f64 {
            let each = tried.iter().enumerate().map(|(pulse, (sums, weight))| {
                let by = later + (float(pulse) - middle) * longer;
                let begin = samples((float(reach) + by).clamp(0.0, 2.0 * float(reach)));
                match (sums.get(begin), sums.get(begin + length)) {
                    (Some(a), Some(b)) => self.limited((b - a).norm_sqr() * weight),
                    _ => 0.0,
                }
            });
            each.sum()
        };
        let mut best = (0.0, 0.0);
        let mut of = value(0.0, 0.0);
        for quarter in -4..=4_i32 {
            // The outer pulses move by up to half a hop.
            let longer = f64::from(quarter) / 8.0 * float(hop) / middle;
            let mut later = -float(hop);
            while later <= float(hop) {
                let sum = value(later, longer);
                if sum > of {
                    (best, of) = ((later, longer), sum);
                }
                later += float(step);
            }
        }
        let (later, longer) = best;
        Course {
            start: course.start + later - middle * longer,
            interval: course.interval + longer,
            ..course
        }
    }
}

/// A train of pulses that was found by adding them up.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Train {
    /// Interval from pulse to pulse, in seconds.
    pub interval_s: f64,
    /// Time of the middle of its first pulse, in seconds of the samples' clock.
    pub first_s: f64,
    /// The carrier's frequency at the first pulse, in hertz; absolute where the receiver's centre
    /// is known.
    pub frequency_hz: f64,
    /// The rate at which the frequency rises, in hertz a second.
    pub drift_hz_per_s: f64,
    /// The width that each pulse was searched with, in seconds.
    pub width_s: f64,
    /// The energy of a pulse over the noise's power density, E/N0, in dB: the mean over the pulses
    /// that are there.
    pub snr_db: f64,
    /// The rate per hour at which noise alone gives a train at least as strong, anywhere in what is
    /// searched.
    pub false_alarms_per_hour: f64,
    /// The pulses that stand out, in the order of time, each with its own power.
    pub pulses: Vec<Pulse>,
    /// The number of pulses between the first and the last that do not stand out.
    pub missed: usize,
}

/// A train of as many pulses as are added up.
#[derive(Debug, Clone)]
struct Hit {
    /// Index of its width.
    width: usize,
    /// Samples of a pulse.
    length: usize,
    /// Course of the train; frequencies are about the band's centre, over the channels' rate.
    course: Course,
    energies: Vec<Energy>,
    statistic: f64,
    threshold: f64,
    rate_hz: f64,
}

impl Hit {
    /// The excess of its statistic over its threshold.
    fn margin(&self) -> f64 {
        self.statistic - self.threshold
    }

    /// The beginning of its last pulse.
    fn last(&self) -> f64 {
        self.course.place(self.energies.len() - 1)
    }
}

/// A pulse of a train.
#[derive(Debug, Clone, Copy)]
struct Member {
    start: f64,
    frequency: f64,
    energy: Energy,
    /// The margin of the hit that it is from.
    margin: f64,
}

/// A train that may still become longer.
#[derive(Debug, Clone)]
struct OpenTrain {
    length: usize,
    interval: f64,
    best_rate_hz: f64,
    added_up: usize,
    /// The pulses by the number of intervals since the first pulse of the first hit.
    members: BTreeMap<i64, Member>,
}

/// The pulses that a train and a hit have in common.
#[derive(Debug, Clone)]
struct Shared {
    /// The hit's pulses that are also the train's.
    pulses: Vec<usize>,
    /// The number of the hit's pulses between the train's first and last.
    inside: usize,
}

impl Shared {
    /// A pulse that both have, if the hit is the train at another time.
    fn same(&self) -> Option<usize> {
        let is_same = self.pulses.len() >= 2 && 4 * self.pulses.len() >= 3 * self.inside;
        self.pulses.first().copied().filter(|_| is_same)
    }
}

impl OpenTrain {
    fn new(hit: &Hit) -> Self {
        let mut train = Self {
            length: hit.length,
            interval: hit.course.interval,
            best_rate_hz: hit.rate_hz,
            added_up: hit.energies.len(),
            members: BTreeMap::new(),
        };
        train.put(hit, 0);
        train
    }

    fn put(&mut self, hit: &Hit, first: i64) {
        let margin = hit.margin();
        for (pulse, energy) in hit.energies.iter().enumerate() {
            let start = hit.course.place(pulse);
            let member =
                Member { start, frequency: hit.course.frequency(pulse), energy: *energy, margin };
            #[expect(clippy::cast_possible_truncation, reason = "a few pulses")]
            let by = ((start - hit.course.start) / self.interval).round() as i64;
            self.keep(first + by, member);
        }
    }

    /// Keeps a member, or that of the stronger hit at its place.
    fn keep(&mut self, place: i64, member: Member) {
        let held = self.members.entry(place).or_insert(member);
        if held.margin < member.margin {
            *held = member;
        }
    }

    /// The pulses that a hit and this train share.
    fn shared(&self, hit: &Hit) -> Shared {
        let width = float(hit.length.max(self.length));
        let narrow = float(hit.length.min(self.length));
        let first = self.members.values().next().map_or(0.0, |member| member.start);
        let mut shared = Shared { pulses: Vec::new(), inside: 0 };
        for pulse in 0..hit.energies.len() {
            let start = hit.course.place(pulse);
            let frequency = hit.course.frequency(pulse);
            if start < first - width || start > self.last() + width {
                continue;
            }
            shared.inside += 1;
            let near = |(_, member): &(i64, &Member)| {
                (member.start - start).abs() < width
                    && (member.frequency - frequency).abs() < 1.5 / narrow
            };
            if self.nearest(start).iter().flatten().any(near) {
                shared.pulses.push(pulse);
            }
        }
        shared
    }

    /// The members before and after a place.
    fn nearest(&self, start: f64) -> [Option<(i64, &Member)>; 2] {
        let mut after = None;
        // Hits are late in the train.
        for (place, member) in self.members.iter().rev() {
            if member.start <= start {
                return [Some((*place, member)), after];
            }
            after = Some((*place, member));
        }
        [None, after]
    }

    /// The number of the member nearest to a place.
    fn number_at(&self, start: f64) -> Option<(i64, f64)> {
        let distance = |member: &Member| (member.start - start).abs();
        let near = self.nearest(start).into_iter().flatten();
        let nearest = near.min_by(|a, b| distance(a.1).total_cmp(&distance(b.1)));
        nearest.map(|(place, member)| (place, member.start))
    }

    /// Takes in a hit that is this train at another time, with a pulse of both at this place.
    fn absorb(&mut self, hit: &Hit, at: f64) {
        let Some((number, start)) = self.number_at(at) else { return };
        let before = (hit.course.start - start) / self.interval;
        #[expect(clippy::cast_possible_truncation, reason = "a few intervals")]
        let before = before.round() as i64;
        self.put(hit, number + before);
        self.best_rate_hz = self.best_rate_hz.min(hit.rate_hz);
    }

    /// Returns true if another train has the same interval and width.
    fn is_alike(&self, other: &Self) -> bool {
        let off = (self.interval - other.interval).abs() * float(self.added_up - 1);
        self.length == other.length && off < float(self.length)
    }

    /// Takes in a train that has a pulse of both at this place.
    fn join(&mut self, other: &Self, at: f64) {
        let (Some((here, _)), Some((there, _))) = (self.number_at(at), other.number_at(at)) else {
            return;
        };
        for (number, member) in &other.members {
            self.keep(number + here - there, *member);
        }
        self.best_rate_hz = self.best_rate_hz.min(other.best_rate_hz);
    }

    /// The beginning of its last pulse.
    fn last(&self) -> f64 {
        self.members.values().next_back().map_or(0.0, |member| member.start)
    }

    /// The train, from the first to the last pulse that is more likely there than not.
    fn finish(&self, front: &Front) -> Option<Train> {
        let members: Vec<(i64, Member)> = self.members.iter().map(|(n, m)| (*n, *m)).collect();
        let energies: Vec<f64> = members.iter().map(|(_, member)| member.energy.energy).collect();
        let there = Presence::of(&energies);
        let range = there.longest();
        let members = &members[range.clone()];
        // What is beyond the ends is no part of its energy.
        let there = Presence::of(&energies[range]);
        let length = float(self.length);
        let rate = front.rate_hz();
        let listed: Vec<&(i64, Member)> = members
            .iter()
            .zip(&there.ln_odds)
            .filter(|((_, member), ln_odds)| **ln_odds > 0.0 && member.energy.energy > 2.0)
            .map(|(member, _)| member)
            .collect();
        let first = listed.first()?;
        let last = listed.last()?;
        let intervals = float(usize::try_from(last.0 - first.0).unwrap_or(0)).max(1.0);
        let interval =
            slope(listed.iter().map(|(n, member)| (*n, member.start))).unwrap_or(self.interval);
        let drift = slope(listed.iter().map(|(n, member)| (*n, member.frequency))).unwrap_or(0.0);
        let pulse = |member: &Member| {
            let Energy { energy, noise } = member.energy;
            let energy = energy - bias(self.added_up);
            Pulse::new(
                front.time_s(member.start + (length - 1.0) / 2.0),
                front.frequency_hz(member.frequency),
                length / rate,
                front.power_dbm(energy, noise, length),
                10.0 * energy.log10(),
            )
        };
        let pulses: Vec<Pulse> = listed.iter().map(|(_, member)| pulse(member)).collect();
        let interval_s = interval / rate;
        Some(Train {
            interval_s,
            first_s: pulses.first()?.time_s,
            frequency_hz: pulses.first()?.frequency_hz,
            drift_hz_per_s: drift * rate / interval_s,
            width_s: length / rate,
            snr_db: 10.0 * (there.energy - bias(self.added_up) + 1.0).max(0.1).log10(),
            false_alarms_per_hour: 3600.0 * self.best_rate_hz,
            missed: samples_between(intervals).saturating_sub(pulses.len()),
            pulses,
        })
    }
}

/// The places of a train that hold a pulse.
#[derive(Debug, Clone)]
struct Presence {
    /// The energy of a pulse.
    energy: f64,
    /// ln of the odds that a place holds one.
    ln_odds: Vec<f64>,
}

impl Presence {
    /// By expectation and maximisation over pulses that have one energy or are missing.
    fn of(energies: &[f64]) -> Self {
        let mean = energies.iter().sum::<f64>() / float(energies.len().max(1));
        let mut energy = (mean - 1.0).max(1.0);
        let mut ln_odds = Vec::new();
        for _ in 0..8 {
            ln_odds = energies.iter().map(|x| ln_odds_of(energy, *x)).collect();
            let mut sum = 0.0;
            let mut weights = 1e-9;
            for (x, odds) in energies.iter().zip(&ln_odds) {
                let weight = 1.0 / (1.0 + (-odds).exp());
                weights += weight;
                sum += weight * (x - 1.0);
            }
            energy = (sum / weights).max(0.5);
        }
        Self { energy, ln_odds }
    }

    /// The stretch whose odds are the highest together, from a pulse that is clearly there to one
    /// that is: at the ends of a train every hit that reaches beyond tries another place.
    fn longest(&self) -> std::ops::Range<usize> {
        let mut best = f64::NEG_INFINITY;
        let mut range = 0..0;
        let mut sum = 0.0_f64;
        let mut from = 0;
        for (n, odds) in self.ln_odds.iter().enumerate() {
            let clear = *odds > CLEAR;
            if sum <= 0.0 {
                if !clear {
                    continue;
                }
                (sum, from) = (0.0, n);
            }
            // That of a pulse or none over that of none.
            sum += MISSING.ln() + odds.max(0.0) + (-odds.abs()).exp().ln_1p();
            if clear && sum > best {
                (best, range) = (sum, from..n + 1);
            }
        }
        range
    }
}

/// The distance between refined starts, in samples.
fn time_step(length: usize) -> usize {
    (length / 32).max(1)
}

fn samples_between(intervals: f64) -> usize {
    samples(intervals) + 1
}

/// The energy that noise adds to a pulse: 1, and about 2, shared by all pulses, from taking the
/// best course.
fn bias(pulses: usize) -> f64 {
    1.0 + 2.0 / float(pulses)
}

/// The slope of a line through points, by least squares.
fn slope(points: impl Iterator<Item = (i64, f64)> + Clone) -> Option<f64> {
    #[expect(clippy::cast_precision_loss, reason = "numbers of pulses are small")]
    let points = points.map(|(n, y)| (n as f64, y));
    let count = float(points.clone().count());
    let (sum_x, sum_y) = points.clone().fold((0.0, 0.0), |(x, y), p| (x + p.0, y + p.1));
    let middle_x = sum_x / count;
    let middle_y = sum_y / count;
    let mut square = 0.0;
    let mut both = 0.0;
    for (x, y) in points {
        square += (x - middle_x).powi(2);
        both += (x - middle_x) * (y - middle_y);
    }
    (square > 0.0).then(|| both / square)
}

/// ln of the odds that a place with this energy holds a pulse of that one: the densities of a
/// noncentral and a central χ² of two degrees.
fn ln_odds_of(energy: f64, x: f64) -> f64 {
    ((1.0 - MISSING) / MISSING).ln() - energy + ln_bessel_i0(2.0 * (energy * x.max(0.0)).sqrt())
}

/// ln I₀, by its series and its asymptotic series (Abramowitz & Stegun 1964, 9.6.12, 9.7.1).
fn ln_bessel_i0(x: f64) -> f64 {
    if x > 15.0 {
        return x - 0.5 * (std::f64::consts::TAU * x).ln() + (1.0 / (8.0 * x)).ln_1p();
    }
    bessel_i0(x).ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    /// A train begins and ends with a pulse that is clearly there: what is but likely there may be
    /// noise, and each hit beyond an end tries another place.
    #[test]
    fn trains_end_with_pulses_that_are_clear() {
        let pulses = [12.0, 11.0, 13.0, 0.8, 12.0, 10.0];
        let with = |before: f64, after: f64| {
            let energies: Vec<f64> = [0.4, before].into_iter().chain(pulses).collect();
            let energies: Vec<f64> = energies.into_iter().chain([after, 0.5]).collect();
            Presence::of(&energies)
        };
        let noise = with(0.9, 1.2);
        assert_eq!(noise.longest(), 2..8);
        assert_abs_diff_eq!(noise.energy, 10.6, epsilon = 0.5);
        assert!(noise.ln_odds[5] < -5.0, "a miss within it: {}", noise.ln_odds[5]);
        // More likely there than not, but not clearly.
        let likely = with(3.4, 3.4);
        for odds in [likely.ln_odds[1], likely.ln_odds[8]] {
            assert!((0.2..CLEAR).contains(&odds), "{odds}");
        }
        assert_eq!(likely.longest(), 2..8);
        assert_eq!(with(9.0, 3.4).longest(), 1..8);
        assert_eq!(with(3.4, 9.0).longest(), 2..9);
        // As clear as a pulse may be that noise looks like.
        assert!((2.0..CLEAR).contains(&with(4.4, 4.4).ln_odds[1]));
        assert_eq!(with(4.4, 4.4).longest(), 2..8);
        // A stretch of noise within it divides it; the longer part counts.
        let apart: Vec<f64> = [11.0; 3].into_iter().chain([0.7; 30]).chain([11.0; 5]).collect();
        assert_eq!(Presence::of(&apart).longest(), 33..38);
    }
}
