use std::collections::{HashMap, VecDeque};

use rustfft::num_complex::Complex32;

use super::{
    super::{DetectorError, FoldConfig, Front, channeliser::float, index, place, samples},
    Course, Hit, OpenTrain, Scene, Train,
    comb::{Comb, TrainAlarms, Trials},
    ln_odds_of,
    map::Map,
    time_step,
};

/// A grid's points are screened above this share of the threshold over noise: between them a train
/// has lost up to 0.9 dB in frequency and about as much in time.
const SCREENED: f64 = 0.66;
/// The most places of a channel that are refined in a block, the strongest first.
const MOST_PLACES: usize = 4096;
/// The longest interval may be up to this many true ones.
const MULTIPLES: usize = 5;

/// Finds trains of pulses in a stream of complex samples by adding up the energies of several.
///
/// All starts, intervals, frequencies and drifts of the settings are searched, in blocks as long as
/// half a train, and trains are put together afterwards. So a train is given when it is over, and
/// memory holds the samples of about two trains of the longest interval.
///
/// ```
/// use foxhunt_signal::detector::{FoldConfig, TrainDetector};
///
/// // Five pulses, 1.27 to 1.33 s apart.
/// let mut config = FoldConfig::new(8e3, 5, [1.27, 1.33]);
/// config.detector.center_hz = Some(150.1e6);
/// let mut detector = TrainDetector::new(config)?;
/// let mut found = Vec::new();
/// // For each chunk of samples: detector.push(first_index, &samples, &mut found)?;
/// detector.finish(&mut found);
/// assert!(found.is_empty());
/// # Ok::<(), foxhunt_signal::detector::DetectorError>(())
/// ```
#[derive(Debug)]
pub struct TrainDetector {
    front: Front,
    pulses: usize,
    /// The steepest drift, in cycles per sample in a sample.
    steepest: f64,
    /// The longest stretch of a train, in samples.
    span: u64,
    combs: Vec<Combed>,
    /// The noise's levels up to an index.
    levels: VecDeque<(u64, Vec<f32>)>,
    /// The first start that was not searched.
    next: u64,
    /// Hits that reach beyond what was searched.
    pending: Vec<Hit>,
    open: Vec<OpenTrain>,
}

/// The parts that one width is searched with.
#[derive(Debug)]
struct Combed {
    map: Map,
    comb: Comb,
    alarms: TrainAlarms,
    /// Drifts, in cycles per sample in a sample.
    drifts: Vec<f64>,
}

/// A place of the grid.
#[derive(Debug, Clone, Copy)]
struct Place {
    frame: usize,
    interval: usize,
    /// The frequency at the first pulse.
    frequency: f64,
    drift: usize,
    sum: f32,
}

impl TrainDetector {
    /// A detector of these settings.
    ///
    /// # Errors
    ///
    /// [`DetectorError::Setting`] if one is out of its range.
    pub fn new(config: FoldConfig) -> Result<Self, DetectorError> {
        config.check()?;
        let span_s = config.span_s();
        let FoldConfig { detector, pulses, intervals_s, drift_hz_per_s } = config;
        let front = Front::new(detector)?;
        let rate = front.rate_hz();
        let each = front.config.false_alarms_per_hour / 3600.0 / float(front.lengths.len());
        let combed = |length: &usize| {
            let hop = float((*length / 4).max(1));
            let comb = Comb::new(pulses, intervals_s.map(|interval| interval * rate / hop));
            // The ends of a train are a bin apart from one drift to the next.
            let step_hz_per_s = rate / float(*length) / span_s;
            let steps = (drift_hz_per_s / step_hz_per_s - 0.5).ceil().max(0.0);
            let drifts = (-samples_i(steps)..=samples_i(steps))
                .map(|n| f64::from(n) * step_hz_per_s / (rate * rate));
            // Pulses are spread evenly over a train: 1/√12 of it about its middle.
            let spread_s = span_s / 12f64.sqrt();
            let trials = Trials {
                pulses,
                band_hz: front.band_hz(),
                length: *length,
                step: time_step(*length),
                intervals: comb.intervals.len(),
                drifts: 2.0 * drift_hz_per_s * spread_s * float(*length) / rate,
            };
            let alarms = TrainAlarms::new(trials, each);
            Combed {
                map: Map::new(*length, alarms.ceiling),
                drifts: drifts.collect(),
                comb,
                alarms,
            }
        };
        let combs = front.lengths.iter().map(combed).collect();
        Ok(Self {
            pulses,
            steepest: drift_hz_per_s / (rate * rate),
            span: samples(span_s * rate) as u64 + front.longest() as u64,
            combs,
            front,
            levels: VecDeque::new(),
            next: 0,
            pending: Vec::new(),
            open: Vec::new(),
        })
    }

    /// The time that was searched, in seconds; gaps do not count.
    #[must_use]
    pub fn searched_s(&self) -> f64 {
        self.front.searched_s()
    }

    /// The number of exponentials that the level of the noise is worth over a train: it is measured
    /// again every few seconds.
    fn known(&self) -> f64 {
        let blocks = index(self.span) / (4.0 * index(self.front.block()));
        self.front.noise.known() * blocks.max(1.0)
    }

    /// The mean energy of a train's pulses over the noise's power density that it must have now, in
    /// dB, noise taken off; for the narrowest width.
    #[must_use]
    pub fn threshold_db(&self) -> f64 {
        let threshold = self.threshold(&self.combs[0]);
        10.0 * (threshold / float(self.pulses) - 1.0).log10()
    }

    fn threshold(&self, combed: &Combed) -> f64 {
        let rate_hz = self.front.config.false_alarms_per_hour / 3600.0;
        combed.alarms.threshold(rate_hz / float(self.combs.len()), self.known())
    }

    /// Takes the samples from index `first` on, and appends the trains that are over. Where `first`
    /// is beyond the sample that is next there is a gap; no train is put together over one.
    ///
    /// # Errors
    ///
    /// [`DetectorError::Backwards`] if those samples were taken already.
    pub fn push(
        &mut self,
        first: u64,
        samples: &[Complex32],
        found: &mut Vec<Train>,
    ) -> Result<(), DetectorError> {
        let follows = self.front.follows(first)?;
        if !follows {
            self.finish(found);
        }
        self.front.expect(first, samples.len(), follows);
        let mut left = samples;
        while !left.is_empty() {
            if self.front.take(&mut left) {
                self.measure();
                if self.front.end() >= self.next + self.block() + self.span + self.margin() {
                    self.search(false, found);
                }
            }
        }
        Ok(())
    }

    /// Searches the samples not searched yet, and appends the last trains. Samples pushed later are
    /// taken to come after a gap.
    pub fn finish(&mut self, found: &mut Vec<Train>) {
        if self.front.end() > self.front.measured {
            self.measure();
        }
        while self.next < self.front.end() {
            self.search(true, found);
        }
        self.close(u64::MAX, found);
        self.front.reset();
        self.levels.clear();
        self.next = 0;
    }

    fn measure(&mut self) {
        self.front.measure(true);
        self.levels.push_back((self.front.end(), self.front.noise.levels().to_vec()));
    }

    /// The number of starts that are searched at once.
    fn block(&self) -> u64 {
        (self.span / 2).max(2 * self.front.block())
    }

    /// Length by which refined trains may reach beyond trains of the grid, in samples.
    fn margin(&self) -> u64 {
        2 * self.front.longest() as u64
    }

    fn search(&mut self, last: bool, found: &mut Vec<Train>) {
        let end = (self.next + self.block()).min(self.front.end());
        let mut combs = std::mem::take(&mut self.combs);
        let mut hits = std::mem::take(&mut self.pending);
        for width in 0..combs.len() {
            let threshold = self.threshold_of(&combs, width);
            for channel in 0..self.front.channels.len() {
                self.fold(channel, width, &mut combs[width], threshold, end, &mut hits);
            }
        }
        self.combs = combs;
        self.next = end;
        // A hit waits until all that its pulses may rather belong to was searched.
        let is_last = last && end == self.front.end();
        let (ripe, pending) = hits.into_iter().partition(|hit| is_last || hit.last() <= index(end));
        self.pending = pending;
        self.put_together(ripe);
        if !last {
            self.close(end.saturating_sub(self.span), found);
            let keep = end.saturating_sub(self.margin());
            self.front.forget(keep);
            while self.levels.front().is_some_and(|(until, _)| *until <= keep) {
                self.levels.pop_front();
            }
        }
    }

    fn threshold_of(&self, combs: &[Combed], width: usize) -> f64 {
        let rate_hz = self.front.config.false_alarms_per_hour / 3600.0;
        combs[width].alarms.threshold(rate_hz / float(combs.len()), self.known())
    }

    /// Searches one channel for trains of one width that begin before `end`.
    fn fold(
        &self,
        channel: usize,
        width: usize,
        combed: &mut Combed,
        threshold: f64,
        end: u64,
        hits: &mut Vec<Hit>,
    ) {
        let length = combed.map.length;
        let from = place(self.next, self.front.origin);
        let until = end + self.span + self.margin();
        let to = place(until, self.front.origin).min(self.front.channels[channel].len());
        combed.map.fill(&self.front.channels[channel][from..to], |at, frequencies, levels| {
            let at = self.next + at as u64;
            let Some((until, held)) = self.levels_at(at) else { return usize::MAX };
            levels.clear();
            let noise = &self.front.noise;
            levels.extend(frequencies.iter().map(|f| noise.level_of(held, channel, *f)));
            place(*until, self.next)
        });
        let places = self.places(channel, combed, threshold, end);
        let noise = |at: f64, frequency: f64| {
            let held = self.levels_at(samples(at) as u64);
            held.map_or(1.0, |(_, levels)| {
                f64::from(self.front.noise.level_of(levels, channel, frequency))
            })
        };
        let scene = Scene {
            samples: &self.front.channels[channel],
            origin: self.front.origin,
            first: self.next,
            map: &combed.map,
            noise: &noise,
            ceiling: combed.alarms.ceiling,
            pulses: self.pulses,
            steepest: 0.0,
        };
        let [low, high] = self.front.ranges[channel];
        let slack = 0.25 / float(length);
        for found in places {
            let hop = float(combed.map.hop);
            let interval = combed.comb.intervals[found.interval] * hop;
            let course = Course {
                start: index(self.next) + float(found.frame) * hop,
                interval,
                frequency: found.frequency,
                drift: combed.drifts[found.drift] * interval,
            };
            let scene = Scene { steepest: self.steepest * interval, ..scene };
            let course = scene.refine(course);
            let energies = scene.energies(&course);
            let statistic = scene.statistic(&energies);
            if statistic < threshold || !(low - slack..=high + slack).contains(&course.frequency) {
                continue;
            }
            let course = scene.climb(course);
            let shortest = combed.comb.intervals[0] * hop;
            let course = fundamental(&scene, course, shortest, threshold);
            let energies = scene.energies(&course);
            let statistic = scene.statistic(&energies).max(threshold);
            let course =
                Course { frequency: self.front.absolute(channel, course.frequency), ..course };
            let rate_hz =
                combed.alarms.rate_hz(statistic, self.known()) * float(self.front.lengths.len());
            hits.push(Hit { width, length, course, energies, statistic, threshold, rate_hz });
        }
    }

    fn levels_at(&self, at: u64) -> Option<&(u64, Vec<f32>)> {
        let held = self.levels.partition_point(|(until, _)| *until <= at);
        self.levels.get(held).or(self.levels.back())
    }

    /// The places of the grid above what is screened, the strongest of those near each other.
    fn places(&self, channel: usize, combed: &mut Combed, threshold: f64, end: u64) -> Vec<Place> {
        let Combed { map, comb, drifts, .. } = combed;
        let pulses = float(self.pulses);
        let screened = pulses + SCREENED * (threshold - pulses);
        #[expect(clippy::cast_possible_truncation, reason = "energies are f32")]
        let screened = screened as f32;
        let starts = place(end, self.next).div_ceil(map.hop);
        let [low, high] = self.front.ranges[channel];
        let intervals = comb.intervals.clone();
        let mut cells: HashMap<[i64; 4], Place> = HashMap::new();
        let mut row = Vec::new();
        for (drift, per_sample) in drifts.iter().enumerate() {
            // A line of frequency over time, in bins a frame.
            let slope = per_sample * float(map.hop) / map.bin();
            let reach = slope.abs() * float(map.frames) * map.bin() + map.bin();
            for bin in 0..map.frequencies.len() {
                let frequency = map.frequencies[bin];
                if frequency < low - reach || frequency > high + reach {
                    continue;
                }
                let line: &[f32] = if slope == 0.0 {
                    map.row(bin)
                } else {
                    along(map, bin, slope, &mut row);
                    &row
                };
                comb.fold(line, starts, screened, |interval, frame, sum| {
                    let frequency = frequency + slope * float(frame) * map.bin();
                    let found = Place { frame, interval, frequency, drift, sum };
                    let [frame, bin] = [frame / 4, samples(0.5 * float(bin))].map(wide);
                    let key = [frame, wide(samples(intervals[interval])), bin, wide(drift)];
                    let held = cells.entry(key).or_insert(found);
                    if held.sum < sum {
                        *held = found;
                    }
                });
            }
        }
        let mut cells: Vec<Place> = cells.into_values().collect();
        cells.sort_by(|a, b| {
            let order = (a.frame, a.interval, a.drift).cmp(&(b.frame, b.interval, b.drift));
            let order = b.sum.total_cmp(&a.sum).then(order);
            order.then(a.frequency.total_cmp(&b.frequency))
        });
        cells.truncate(MOST_PLACES);
        let last = |found: &Place| float(found.frame) + (pulses - 1.0) * intervals[found.interval];
        let lobe = 1.0 / float(map.length);
        let mut kept: Vec<Place> = Vec::new();
        for cell in cells {
            let near = |kept: &Place| {
                kept.frame.abs_diff(cell.frame) <= 3
                    && (last(kept) - last(&cell)).abs() <= 3.0
                    && (kept.frequency - cell.frequency).abs() <= lobe
            };
            if !kept.iter().any(near) {
                kept.push(cell);
            }
        }
        kept
    }

    /// Gives hits to trains, the strongest first.
    fn put_together(&mut self, mut hits: Vec<Hit>) {
        hits.sort_by(|a, b| {
            b.margin().total_cmp(&a.margin()).then(a.course.start.total_cmp(&b.course.start))
        });
        for hit in &hits {
            let ceiling = self.combs[hit.width].alarms.ceiling;
            let mut taken = vec![false; hit.energies.len()];
            let mut same = Vec::new();
            for (place, train) in self.open.iter().enumerate() {
                let shared = train.shared(hit);
                shared.pulses.iter().for_each(|pulse| taken[*pulse] = true);
                same.extend(shared.same().map(|pulse| (place, hit.course.place(pulse))));
            }
            if let Some(((place, at), others)) = same.split_first() {
                self.open[*place].absorb(hit, *at);
                // It may join trains that were apart.
                for (other, at) in others.iter().rev() {
                    if self.open[*place].is_alike(&self.open[*other]) {
                        let other = self.open.remove(*other);
                        self.open[*place].join(&other, *at);
                    }
                }
                continue;
            }
            // What is left of it without the pulses of other trains, which may collide with it.
            let lost = hit.energies.iter().zip(&taken).filter(|(_, taken)| **taken);
            let lost: f64 = lost.map(|(energy, _)| energy.energy.min(ceiling) - 1.0).sum();
            if hit.margin() - lost.max(0.0) >= 0.0 {
                self.open.push(OpenTrain::new(hit));
            }
        }
    }

    /// Gives the trains that nothing found from this start on can belong to.
    fn close(&mut self, from: u64, found: &mut Vec<Train>) {
        let from = index(from) - index(self.margin());
        let given = found.len();
        let front = &self.front;
        self.open.retain(|train| {
            let open = train.last() >= from;
            if !open {
                found.extend(train.finish(front));
            }
            open
        });
        found[given..].sort_by(|a, b| a.first_s.total_cmp(&b.first_s));
    }
}

/// The energies along a line of frequency over time; nothing where there is no bin.
fn along(map: &Map, bin: usize, slope: f64, row: &mut Vec<f32>) {
    row.clear();
    let mut rows: Option<(usize, &[f32])> = None;
    for frame in 0..map.frames {
        let on = float(bin) + slope * float(frame);
        let cell = (on > -0.5).then(|| samples(on)).filter(|on| *on < map.frequencies.len());
        let energy = cell.map_or(0.0, |on| {
            let line = match rows {
                Some((held, line)) if held == on => line,
                _ => map.row(on),
            };
            rows = Some((on, line));
            line[frame]
        });
        row.push(energy);
    }
}

/// A train of a multiple of the interval has pulses between its own: the shortest interval at which
/// all of them are more likely there than not, and at which as many pulses are above the threshold.
fn fundamental(scene: &Scene<'_>, course: Course, shortest: f64, threshold: f64) -> Course {
    let energies = scene.energies(&course);
    let mean = energies.iter().map(|energy| energy.energy).sum::<f64>() / float(scene.pulses);
    let energy = (mean - 1.0).max(1.0);
    for parts in (2..=MULTIPLES).rev() {
        let interval = course.interval / float(parts);
        if interval < 0.99 * shortest {
            continue;
        }
        let there = |part: usize| {
            let odds = (0..scene.pulses - 1).map(|pulse| {
                let at = float(pulse) + float(part) / float(parts);
                let place = course.start + at * course.interval;
                let found = scene.energy(place, course.frequency + at * course.drift);
                ln_odds_of(energy, found.energy)
            });
            odds.sum::<f64>() > 0.0
        };
        let shorter = Course { interval, drift: course.drift / float(parts), ..course };
        if (1..parts).all(there) && scene.statistic(&scene.energies(&shorter)) >= threshold {
            return shorter;
        }
    }
    course
}

fn wide(count: usize) -> i64 {
    i64::try_from(count).unwrap_or(i64::MAX)
}

#[expect(clippy::cast_possible_truncation, reason = "drifts are checked")]
fn samples_i(count: f64) -> i32 {
    count as i32
}
