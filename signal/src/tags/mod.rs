//! Pulses given to the tags that sent them.
//!
//! [`read_pulses`] reads what detectors wrote, [`TagTable`] holds the tags that are known, and
//! [`associate`] finds the trains: coded bursts by their gaps, other known tags by frequency, width
//! and interval, and unknown ones, whose intervals the [`IntervalTransform`] proposes. Everything
//! is searched first and associated afterwards; nothing is listened for in predicted windows.

mod associate;
mod codes;
mod read;
mod transform;

pub use associate::{Association, Tag, associate};
pub use read::{KnownTag, PulseList, TagError, TagTable, parse_pulses, read_pulses};
pub use transform::{IntervalPeak, IntervalTransform};

use std::f64::consts::PI;

use crate::Pulse;
use transform::count;

/// The most paths that are kept to each pulse.
const PATHS: usize = 3;

/// The gate for a train's next pulse, in standard deviations.
const GATE: f64 = 5.0;

/// The share of intervals after which a train's phase slips: samples were lost, or the tag's
/// oscillator was disturbed. One slip makes the next likely; how far, as a share of the interval.
const SLIPS_AGAIN: f64 = 0.7;
const SLIP: f64 = 0.05;

/// The share of intervals after which a tag changes to its other interval.
const CHANGE: f64 = 0.01;

/// The share of pulses that a detector gives twice, side by side in frequency or time.
const TWICE: f64 = 0.005;

/// The share of intervals after which a tag is out of range, and that in which it comes back.
const AWAY: (f64, f64) = (0.02, 0.05);

/// Drift of an interval from one to the next, as a share of itself, one σ.
const DRIFT: f64 = 1e-4;

/// Drift of a carrier from pulse to pulse, as a share of its measurements' σ.
const CARRIER_DRIFT: f64 = 0.05;

/// Time from a pulse within which others are counted, in seconds: noise comes in bursts.
const NEAR_S: f64 = 20.0;

/// The standard deviation of the logarithm of a width that a detector measures.
const WIDTH_SIGMA: f64 = 0.2;

/// Settings of an association: what is known of pulses and tags beforehand.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct AssociationConfig {
    /// The shortest and the longest interval that unknown tags are searched for, in seconds.
    pub intervals_s: [f64; 2],
    /// The most by which a known tag's interval may be off its table's, as a share of it; half the
    /// width of the bins in which unknown intervals are searched.
    pub interval_tolerance: f64,
    /// The standard deviation of a pulse's measured time, in seconds.
    pub time_sigma_s: f64,
    /// The standard deviation of a pulse's measured frequency, in hertz. Where the pulses of a list
    /// stand on a coarser raster, its step takes the place of this.
    pub frequency_sigma_hz: f64,
    /// The distance of a known tag's carrier from its table's frequency, in hertz, one σ.
    pub frequency_tolerance_hz: f64,
    /// The most pulses of a train in a row that may be missed; after a longer absence a tag begins
    /// again.
    pub max_missed: u32,
    /// The mean number of unknown tags that may be found in a list of nothing but noise.
    pub false_tags: f64,
    /// The most by which a gap of a coded burst may be off, in seconds.
    pub gap_tolerance_s: f64,
    /// The most by which the whole of a coded burst may be off, in seconds.
    pub burst_tolerance_s: f64,
    /// The most by which the frequencies of a coded burst's pulses may lie apart, in hertz.
    pub burst_spread_hz: f64,
}

impl Default for AssociationConfig {
    /// Intervals of 0.2 to 5 s within 1 %, times within 1 ms, frequencies within 30 Hz and 100 Hz
    /// of the table's, 30 pulses missed, 0.001 false tags; bursts by the tolerances published for
    /// the tag finder of SensorGnome (Brzustowski, `find_tags_motus`): 1.5 ms a gap, 4 ms a burst,
    /// 0.5 kHz.
    fn default() -> Self {
        Self {
            intervals_s: [0.2, 5.0],
            interval_tolerance: 0.01,
            time_sigma_s: 1e-3,
            frequency_sigma_hz: 30.0,
            frequency_tolerance_hz: 100.0,
            max_missed: 30,
            false_tags: 1e-3,
            gap_tolerance_s: 1.5e-3,
            burst_tolerance_s: 4e-3,
            burst_spread_hz: 500.0,
        }
    }
}

impl AssociationConfig {
    fn check(&self) -> Result<(), TagError> {
        let positive = [
            ("time_sigma_s", self.time_sigma_s),
            ("frequency_sigma_hz", self.frequency_sigma_hz),
            ("frequency_tolerance_hz", self.frequency_tolerance_hz),
            ("false_tags", self.false_tags),
            ("gap_tolerance_s", self.gap_tolerance_s),
            ("burst_tolerance_s", self.burst_tolerance_s),
            ("burst_spread_hz", self.burst_spread_hz),
            ("intervals_s[0]", self.intervals_s[0]),
        ];
        let refuse =
            |name, value, requirement| Err(TagError::Parameter { name, value, requirement });
        for (name, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return refuse(name, value, "finite and above 0");
            }
        }
        let [shortest, longest] = self.intervals_s;
        if !(longest.is_finite() && longest > shortest) {
            return refuse("intervals_s[1]", longest, "finite and above intervals_s[0]");
        }
        if !(1e-4..=0.1).contains(&self.interval_tolerance) {
            return refuse("interval_tolerance", self.interval_tolerance, "0.0001 to 0.1");
        }
        Ok(())
    }
}

/// The model of a tag's train. The most likely train is found by Viterbi's algorithm over a hidden
/// Markov model of intervals, with a Kalman filter of phase and interval on each surviving path.
///
/// The model is that of Moore and Krishnamurthy (1994, stochastic dynamic-linear models of pulse
/// trains) and of Logothetis and Krishnamurthy (1998, interval and amplitude); paths with a filter
/// each are per-survivor processing (Raheli, Polydoros and Tzou 1995).
#[derive(Debug, Clone)]
struct TrainModel {
    /// The usual interval, and the others that it may change to, in seconds.
    intervals_s: Vec<f64>,
    /// The standard deviation of an interval, as a share of it.
    interval_sigma: f64,
    /// The carrier's frequency and its standard deviation, in hertz.
    frequency_hz: (f64, f64),
    /// The width of its pulses, in seconds.
    width_s: Option<f64>,
    time_sigma_s: f64,
    frequency_sigma_hz: f64,
    max_missed: u32,
    /// The probability that a pulse is detected while the tag is in range.
    detection: f64,
    /// The share of intervals that slip after one that does not.
    slip: f64,
}

/// A train that was found.
#[derive(Debug, Clone)]
struct Train {
    /// The logarithm of its probability over that of its pulses being clutter.
    score: f64,
    /// Pulses of the train, in the order of time.
    members: Vec<Member>,
    /// Mean square of the normalised residuals of pulses that follow without a slip.
    spread: f64,
}

/// One pulse of a train.
#[derive(Debug, Clone, Copy)]
struct Member {
    /// Place of the pulse in the list.
    pulse: usize,
    /// The link from the pulse before.
    link: Link,
    /// The number of intervals since the pulse before; 0 for a double.
    intervals: u32,
    /// Index of the model's interval.
    mode: usize,
}

/// The way that a pulse follows on the one before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Link {
    /// The pulse is the first, or the first after a tag was away.
    Begins,
    /// The pulse follows by the interval.
    Follows,
    /// The phase slipped.
    Slips,
    /// The tag changed to another interval.
    Changes,
    /// The pulse is the one before it, detected twice.
    Doubles,
}

/// A path to a pulse, with its filter of phase and interval.
#[derive(Debug, Clone, Copy)]
struct Path {
    score: f64,
    before: Option<usize>,
    member: Member,
    time_s: f64,
    interval_s: f64,
    /// Variances of phase, of both, and of the interval.
    phase: f64,
    both: f64,
    interval: f64,
    carrier: (f64, f64),
    ln_width: (f64, f64),
    /// The normalised square of the residual.
    square: f64,
    /// True if the last interval slipped.
    slips: bool,
}

/// The pulses that a train is looked for among.
#[derive(Debug, Clone, Copy)]
struct Scene<'a> {
    /// In the order of their beginnings.
    pulses: &'a [Pulse],
    clutter: &'a Clutter,
    /// True for the pulses that other trains hold: with them a train can only collide.
    held: &'a [bool],
}

impl TrainModel {
    /// The most likely train among candidates, places in the list that rise.
    fn best(&self, scene: &Scene<'_>, candidates: &[usize]) -> Option<Train> {
        let longest = self.intervals_s.iter().fold(0.0_f64, |a, b| a.max(*b));
        let reach = longest * (f64::from(self.max_missed) + 1.5);
        let mut paths: Vec<Path> = Vec::new();
        // The paths to each candidate.
        let mut ends: Vec<(usize, usize)> = Vec::with_capacity(candidates.len());
        let (mut near, mut away): (usize, Option<usize>) = (0, None);
        for (place, index) in candidates.iter().enumerate() {
            let time = scene.pulses[*index].time_s;
            while near < place && scene.pulses[candidates[near]].time_s < time - reach {
                for path in ends[near].0..ends[near].1 {
                    if away.is_none_or(|best: usize| paths[path].score > paths[best].score) {
                        away = Some(path);
                    }
                }
                near += 1;
            }
            let mut found: Vec<Path> = Vec::new();
            if !scene.held[*index] {
                found.extend(self.begun(scene, *index, None));
                found.extend(away.and_then(|p| self.begun(scene, *index, Some((p, &paths[p])))));
            }
            for (from, to) in &ends[near..] {
                for (before, path) in (*from..*to).zip(&paths[*from..*to]) {
                    self.follow(scene, *index, (before, path), &mut found);
                }
            }
            found.sort_by(|a, b| b.score.total_cmp(&a.score));
            found.truncate(PATHS);
            let from = paths.len();
            paths.append(&mut found);
            ends.push((from, paths.len()));
        }
        let mut at = (0..paths.len()).max_by(|a, b| paths[*a].score.total_cmp(&paths[*b].score));
        let score = paths[at?].score;
        let mut members = Vec::new();
        let mut squares = Vec::new();
        while let Some(path) = at.map(|index| &paths[index]) {
            members.push(path.member);
            if path.member.link == Link::Follows {
                squares.push(path.square);
            }
            at = path.before;
        }
        members.reverse();
        let spread = squares.iter().sum::<f64>() / count(squares.len()).max(1.0);
        Some(Train { score, members, spread })
    }

    /// A path to a pulse that begins a train, or begins it again after a path before.
    fn begun(
        &self,
        scene: &Scene<'_>,
        index: usize,
        before: Option<(usize, &Path)>,
    ) -> Option<Path> {
        let pulse = &scene.pulses[index];
        let interval_s = before.map_or(self.intervals_s[0], |(_, path)| path.interval_s);
        let mode = before.map_or(0, |(_, path)| path.member.mode);
        let width = match self.width_s {
            Some(width) => (width.ln(), 0.0),
            None => (scene.clutter.ln_width.0, scene.clutter.ln_width.1.powi(2)),
        };
        let path = Path {
            score: before.map_or(0.0, |(_, path)| path.score + (AWAY.0 * AWAY.1).ln()),
            before: before.map(|(index, _)| index),
            member: Member { pulse: index, link: Link::Begins, intervals: 1, mode },
            time_s: pulse.time_s,
            interval_s,
            phase: self.time_sigma_s.powi(2),
            both: 0.0,
            interval: (self.interval_sigma * interval_s).powi(2),
            carrier: before
                .map_or((self.frequency_hz.0, self.frequency_hz.1.powi(2)), |(_, path)| {
                    path.carrier
                }),
            ln_width: before.map_or(width, |(_, path)| path.ln_width),
            square: 0.0,
            slips: false,
        };
        // Its phase is not known.
        self.measured(scene, index, path, -interval_s.ln())
    }

    /// All ways in which a pulse follows on a path.
    fn follow(
        &self,
        scene: &Scene<'_>,
        index: usize,
        (from, path): (usize, &Path),
        found: &mut Vec<Path>,
    ) {
        let pulse = &scene.pulses[index];
        let last = &scene.pulses[path.member.pulse];
        let gap = pulse.time_s - last.time_s;
        let width = pulse.width_s.max(last.width_s);
        let next = Path { before: Some(from), square: 0.0, ..*path };
        let member = |link, intervals, mode| Member { pulse: index, link, intervals, mode };
        if gap < width && !scene.held[index] && !scene.held[path.member.pulse] {
            // The second is often but a piece of the first.
            let ln_width = (path.ln_width.0, 1.0);
            let member = member(Link::Doubles, 0, path.member.mode);
            let double = Path { member, ln_width, ..next };
            let chance = TWICE.ln() - width.ln();
            // The filters hold the pulse already.
            let kept = self.measured(scene, index, double, chance);
            found.extend(kept.map(|kept| Path {
                carrier: path.carrier,
                ln_width: path.ln_width,
                ..kept
            }));
            return;
        }
        let slipped = (SLIP * path.interval_s).powi(2);
        if let Some((n, times)) = self.intervals(pulse.time_s - path.time_s, path.interval_s) {
            let ahead = self.ahead(next, times);
            let residual = pulse.time_s - ahead.time_s;
            let slip = if path.slips { SLIPS_AGAIN } else { self.slip };
            let mut go = |link, more: f64, share: f64| {
                let member = member(link, n, path.member.mode);
                let slips = link == Link::Slips;
                let ahead = Path { phase: ahead.phase + more, member, slips, ..ahead };
                let chance = || self.missed(n) + share.ln();
                found.extend(self.timed(scene, index, ahead, chance));
            };
            go(Link::Follows, 0.0, 1.0 - slip);
            // Over several intervals any pulse could be a slip.
            let may_slip = n == 1 && !scene.held[index];
            if may_slip && residual.powi(2) <= GATE.powi(2) * slipped {
                go(Link::Slips, slipped, slip);
            }
        }
        for (mode, interval_s) in self.intervals_s.iter().enumerate() {
            if mode == path.member.mode {
                continue;
            }
            let Some((n, times)) = self.intervals(pulse.time_s - path.time_s, *interval_s) else {
                continue;
            };
            let changed = Path {
                interval_s: *interval_s,
                both: 0.0,
                interval: (self.interval_sigma * interval_s).powi(2),
                phase: path.phase + slipped,
                member: member(Link::Changes, n, mode),
                ..next
            };
            let ahead = self.ahead(changed, times);
            found.extend(self.timed(scene, index, ahead, || self.missed(n) + CHANGE.ln()));
        }
    }

    /// The number of intervals in a gap; `None` if more than may be missed.
    fn intervals(&self, gap_s: f64, interval_s: f64) -> Option<(u32, f64)> {
        let times = (gap_s / interval_s).round();
        if !(1.0..=f64::from(self.max_missed) + 1.0).contains(&times) {
            return None;
        }
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "checked above"
        )]
        let n = times as u32;
        Some((n, times))
    }

    /// The logarithm of the probability that the next pulse detected is the n-th: of a tag in range
    /// or, with a tail as long as it is away, of one that is not.
    fn missed(&self, n: u32) -> f64 {
        let missed = f64::from(n) - 1.0;
        let (leaves, returns) = AWAY;
        let within = (1.0 - leaves) * self.detection * (1.0 - self.detection).powf(missed);
        (within + leaves * returns * (1.0 - returns).powf(missed)).ln()
    }

    /// The filter some intervals later.
    fn ahead(&self, path: Path, times: f64) -> Path {
        let jitter = 0.25 * times * self.time_sigma_s.powi(2);
        Path {
            time_s: path.time_s + times * path.interval_s,
            phase: path.phase + times * (2.0 * path.both + times * path.interval) + jitter,
            both: path.both + times * path.interval,
            interval: path.interval + times * (DRIFT * path.interval_s).powi(2),
            carrier: (
                path.carrier.0,
                path.carrier.1 + times * (CARRIER_DRIFT * self.frequency_sigma_hz).powi(2),
            ),
            ..path
        }
    }

    /// A path updated with a pulse's time, and weighed by it.
    fn timed(
        &self,
        scene: &Scene<'_>,
        index: usize,
        path: Path,
        chance: impl FnOnce() -> f64,
    ) -> Option<Path> {
        let pulse = &scene.pulses[index];
        let residual = pulse.time_s - path.time_s;
        // What collides is a pulse's length wide.
        let merged = if scene.held[index] { 0.5 * pulse.width_s } else { 0.0 };
        let variance = path.phase + self.time_sigma_s.powi(2) + merged.powi(2);
        if residual.powi(2) > GATE.powi(2) * variance {
            return None;
        }
        let gain = path.phase / variance;
        let turn = path.both / variance;
        let updated = Path {
            time_s: path.time_s + gain * residual,
            interval_s: path.interval_s + turn * residual,
            phase: path.phase - gain * path.phase,
            both: path.both - gain * path.both,
            interval: path.interval - turn * path.both,
            square: residual.powi(2) / variance,
            ..path
        };
        let chance = chance() + ln_normal(residual, variance);
        if scene.held[index] {
            Some(collided(pulse, path, updated, chance, self))
        } else {
            self.measured(scene, index, updated, chance)
        }
    }

    /// A path updated with a pulse's frequency and width, and weighed by both against clutter.
    fn measured(&self, scene: &Scene<'_>, index: usize, path: Path, chance: f64) -> Option<Path> {
        let pulse = &scene.pulses[index];
        let (carrier, frequency) =
            scalar(path.carrier, pulse.frequency_hz, self.frequency_sigma_hz.powi(2))?;
        let (ln_width, width) = scalar(path.ln_width, pulse.width_s.ln(), WIDTH_SIGMA.powi(2))?;
        let score = path.score + chance + frequency + width - scene.clutter.ln_density[index];
        Some(Path { score, carrier, ln_width, ..path })
    }
}

/// The logarithm of the density of other pulses about each pulse, per second, hertz and natural
/// logarithm of a width.
#[derive(Debug, Clone)]
struct Clutter {
    ln_density: Vec<f64>,
    /// Mean and standard deviation of the widths' logarithms.
    ln_width: (f64, f64),
}

impl Clutter {
    /// The clutter of pulses in the order of their beginnings, without explained ones: the greater
    /// of the density about a pulse's frequency at any time and of that near its time. A pulse
    /// counts itself, so that no density is zero.
    fn new(pulses: &[Pulse], explained: &[bool], frequency_sigma_hz: f64) -> Self {
        let reach = 4.0 * frequency_sigma_hz;
        let span = span_s(pulses);
        let ln_width = spread(pulses.iter().map(|pulse| pulse.width_s.ln()));
        let open = || pulses.iter().zip(explained).filter(|(_, explained)| !**explained);
        let mut frequencies: Vec<f64> = open().map(|(pulse, _)| pulse.frequency_hz).collect();
        frequencies.sort_by(f64::total_cmp);
        let density = |pulse: &Pulse| {
            let f = pulse.frequency_hz;
            let from = frequencies.partition_point(|x| *x < f - reach);
            let to = frequencies.partition_point(|x| *x <= f + reach);
            let always = count((to - from).max(1)) / (2.0 * reach * span);
            let from = pulses.partition_point(|other| other.time_s < pulse.time_s - NEAR_S);
            let to = pulses.partition_point(|other| other.time_s <= pulse.time_s + NEAR_S);
            let near = (from..to)
                .filter(|k| !explained[*k] && (pulses[*k].frequency_hz - f).abs() <= reach)
                .count();
            // One alone is no burst of noise.
            let here = count(near.saturating_sub(1)) / (2.0 * reach * span.min(2.0 * NEAR_S));
            always.max(here).ln() + ln_normal(pulse.width_s.ln() - ln_width.0, ln_width.1.powi(2))
        };
        Self { ln_density: pulses.iter().map(density).collect(), ln_width }
    }
}

/// A path whose pulse another train holds as well: the two overlapped, within the pulse's length
/// and the width of its spectrum. It explains nothing that is not explained, so it is weighed
/// against a miss.
fn collided(pulse: &Pulse, before: Path, path: Path, chance: f64, model: &TrainModel) -> Path {
    let band = 1.0 / pulse.width_s;
    let variance = path.carrier.1 + model.frequency_sigma_hz.powi(2) + band.powi(2);
    let frequency = ln_normal(pulse.frequency_hz - path.carrier.0, variance) + band.ln();
    let score = path.score + chance + pulse.width_s.ln() + frequency;
    // Its time is that of both, so the filter goes on without it.
    Path {
        score,
        time_s: before.time_s,
        interval_s: before.interval_s,
        phase: before.phase,
        both: before.both,
        interval: before.interval,
        ..path
    }
}

/// A scalar Kalman update: the new mean and variance, and the logarithm of the density; nothing
/// beyond the gate.
fn scalar((mean, variance): (f64, f64), value: f64, noise: f64) -> Option<((f64, f64), f64)> {
    let total = variance + noise;
    let residual = value - mean;
    if residual.powi(2) > GATE.powi(2) * total {
        return None;
    }
    let gain = variance / total;
    let updated = (mean + gain * residual, variance - gain * variance);
    Some((updated, ln_normal(residual, total)))
}

/// Time from the first pulse to the last, in seconds; at least one.
fn span_s(pulses: &[Pulse]) -> f64 {
    match (pulses.first(), pulses.last()) {
        (Some(first), Some(last)) => (last.time_s - first.time_s).max(1.0),
        _ => 1.0,
    }
}

/// The logarithm of a normal density.
fn ln_normal(residual: f64, variance: f64) -> f64 {
    -0.5 * (residual * residual / variance + (2.0 * PI * variance).ln())
}

/// Mean and standard deviation; at least that of widths of one transmitter.
fn spread(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let n = count(values.clone().count()).max(1.0);
    let mean = values.clone().sum::<f64>() / n;
    let variance = values.map(|x| (x - mean).powi(2)).sum::<f64>() / n;
    (mean, variance.sqrt().max(WIDTH_SIGMA))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::abs_diff_eq;

    fn model(detection: f64) -> TrainModel {
        TrainModel {
            intervals_s: vec![1.3],
            interval_sigma: 0.01,
            frequency_hz: (0.0, 100.0),
            width_s: None,
            time_sigma_s: 1e-3,
            frequency_sigma_hz: 30.0,
            max_missed: 30,
            detection,
            slip: 0.01,
        }
    }

    #[test]
    fn some_pulse_is_the_next() {
        for detection in [0.3, 0.9] {
            let sum: f64 = (1..2_000).map(|n| model(detection).missed(n).exp()).sum();
            assert!(abs_diff_eq!(sum, 1.0, epsilon = 1e-9), "{detection}: {sum}");
            assert!(model(detection).missed(2) < model(detection).missed(1));
        }
    }

    #[test]
    fn the_filter_finds_the_interval() {
        let pulse = |n: u32| Pulse::new(1.306 * f64::from(n), 5.0, 0.02, -80.0, 20.0);
        let pulses: Vec<Pulse> = (0..40).filter(|n| n % 5 != 3).map(pulse).collect();
        let held = vec![false; pulses.len()];
        let clutter = Clutter::new(&pulses, &held, 30.0);
        let scene = Scene { pulses: &pulses, clutter: &clutter, held: &held };
        let all: Vec<usize> = (0..pulses.len()).collect();
        let train = model(0.9).best(&scene, &all).expect("a train");
        assert_eq!(train.members.len(), 32);
        assert_eq!(train.members.iter().map(|member| member.intervals).sum::<u32>(), 1 + 39);
        // A prior that is 0.46 % off, and slips are dear: all follow.
        assert!(train.members[1..].iter().all(|member| member.link == Link::Follows));
        assert!(train.spread < 0.5, "{}", train.spread);
    }
}
