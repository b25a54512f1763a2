use std::collections::BTreeMap;

use serde::Serialize;

use super::{
    AssociationConfig, Clutter, IntervalTransform, KnownTag, Link, Member, Scene, TagError,
    TagTable, Train, TrainModel,
    codes::{bursts, unknown_code},
    transform::count,
};
use crate::Pulse;

/// A tag, and the pulses that it sent.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Tag {
    /// Names of the tag; several where known tags cannot be distinguished, empty where unknown.
    pub names: Vec<String>,
    /// The median frequency of its pulses, in hertz.
    pub frequency_hz: f64,
    /// Interval from pulse to pulse, or burst to burst, in seconds: the median.
    pub interval_s: f64,
    /// The median width of its pulses, in seconds.
    pub width_s: f64,
    /// The scatter of intervals about the median, in seconds: half the middle 68 %.
    pub jitter_s: f64,
    /// Pulses of the tag, as places in the list that was given, in the order of their beginnings.
    pub pulses: Vec<usize>,
    /// The number of bursts that the pulses make; 0 for an uncoded tag.
    pub bursts: usize,
    /// The gaps between the pulses of a burst, in seconds: the medians.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub gaps_s: Vec<f64>,
    /// The number of pulses, or bursts, that were missed between the first and the last.
    pub missed: u32,
    /// The number of pulses that another tag has as well: they collided.
    pub collided: usize,
    /// The number of pulses that were detected twice.
    pub doubled: usize,
    /// The number of slips of its phase.
    pub slips: usize,
    /// The number of changes to its other interval or back.
    pub changes: usize,
    /// The number of pulses that came by its other interval.
    pub by_other_interval: usize,
    /// The logarithm of the odds that they are a train and not noise; absent for bursts.
    pub log_odds: Option<f64>,
}

/// The tags to which pulses were given.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Association {
    /// The tags: known coded ones, other known ones, unknown ones by their odds.
    pub tags: Vec<Tag>,
    /// The pulses of no tag, as places in the list that was given.
    pub others: Vec<usize>,
}

/// Gives pulses to the tags that sent them.
///
/// Coded bursts of the table are matched by their gaps first; other bursts are found, after the
/// known tags, where the same gaps come again at one interval. Every other known tag, then every
/// unknown one whose interval an [`IntervalTransform`] over a window of frequencies proposes, is
/// the most likely path of a hidden Markov model over intervals: pulses are missed, intervals
/// jitter and drift, phases slip, tags go out of range, change to another interval, and collide.
/// The tags share the pulses out among them by coordinate ascent: each path is found again
/// while the others are held, until no path changes (Besag 1986); a pulse that another tag holds
/// can only be one that collided. An unknown tag is taken where the odds of its train over noise
/// exceed the number of trains that were tried, over [`AssociationConfig::false_tags`].
///
/// # Errors
///
/// If a parameter is out of its range or a pulse is not finite.
pub fn associate(
    pulses: &[Pulse],
    table: &TagTable,
    config: &AssociationConfig,
) -> Result<Association, TagError> {
    config.check()?;
    for (index, pulse) in pulses.iter().enumerate() {
        let fields = [
            ("time_s", pulse.time_s),
            ("frequency_hz", pulse.frequency_hz),
            ("ln width_s", pulse.width_s.ln()),
        ];
        if let Some((field, value)) = fields.into_iter().find(|(_, value)| !value.is_finite()) {
            return Err(TagError::Pulse { index, field, value });
        }
    }
    let mut order: Vec<usize> = (0..pulses.len()).collect();
    // By their beginnings: a piece of a pulse that is detected as well begins after it.
    let begin = |index: usize| pulses[index].time_s - 0.5 * pulses[index].width_s;
    order.sort_by(|a, b| begin(*a).total_cmp(&begin(*b)));
    let sorted: Vec<Pulse> = order.iter().map(|index| pulses[*index]).collect();
    let mut work = Work::new(&sorted, config);
    let mut tags = work.coded(table);
    let uncoded: Vec<&KnownTag> = table.tags().iter().filter(|tag| tag.gaps_s.is_empty()).collect();
    work.known(&uncoded);
    work.rename();
    work.share_out();
    tags.extend(work.unknown_codes());
    work.unknown();
    work.share_out();
    tags.extend((0..work.found.len()).map(|index| work.tag(index)));
    for tag in &mut tags {
        tag.pulses.iter_mut().for_each(|index| *index = order[*index]);
    }
    let mut free = vec![true; pulses.len()];
    tags.iter().flat_map(|tag| &tag.pulses).for_each(|index| free[*index] = false);
    let others = (0..pulses.len()).filter(|index| free[*index]).collect();
    Ok(Association { tags, others })
}

/// A train that was found, with what is known of it.
struct Found {
    tag: Option<KnownTag>,
    model: TrainModel,
    train: Train,
    log_odds: f64,
}

impl Found {
    /// The logarithm of how well it fits a tag's interval and frequency, but for a constant.
    fn fit(&self, tag: &KnownTag, pulses: &[Pulse], config: &AssociationConfig) -> f64 {
        let members = &self.train.members;
        let interval =
            (self.model.intervals_s[0] / tag.interval_s - 1.0) / config.interval_tolerance;
        let frequencies = members.iter().map(|member| pulses[member.pulse].frequency_hz);
        let off = median(frequencies.collect()).zip(tag.frequency_hz).map_or(0.0, |(f, of)| f - of);
        -0.5 * (interval.powi(2) + (off / config.frequency_tolerance_hz).powi(2))
    }
}

/// The best train of a known tag.
enum Proposal {
    /// It has to be found, for the first time or again.
    Old,
    Nothing,
    Found(Box<(TrainModel, Train)>),
}

impl Proposal {
    fn score(&self) -> f64 {
        if let Self::Found(found) = self { found.1.score } else { f64::NEG_INFINITY }
    }

    /// Returns true if it has any of these pulses.
    fn holds(&self, pulses: &[bool]) -> bool {
        let Self::Found(found) = self else { return false };
        found.1.members.iter().any(|member| pulses[member.pulse])
    }
}

/// The pulses in the order of their beginnings, and what holds them so far.
struct Work<'a> {
    pulses: &'a [Pulse],
    config: &'a AssociationConfig,
    frequency_sigma_hz: f64,
    /// Pulses of coded bursts.
    in_burst: Vec<bool>,
    found: Vec<Found>,
}

/// The share of pulses that a detector finds, before it is known.
const DETECTION: f64 = 0.9;
/// The share of intervals that slip, before it is known.
const SLIP: f64 = 0.01;
/// The most intervals of one window of frequencies that are tried.
const TRIED: usize = 4;
/// The most pulses in a row that may be missed where trains are only compared.
const PROPOSED_MISSED: u32 = 5;
/// The least number of pulses of an unknown tag.
const FEWEST: usize = 5;
/// The most times that all trains are found again; where they share pulses two or three suffice.
const SWEEPS: usize = 6;

impl<'a> Work<'a> {
    fn new(pulses: &'a [Pulse], config: &'a AssociationConfig) -> Self {
        let frequency_sigma_hz = config.frequency_sigma_hz.max(raster_hz(pulses));
        let in_burst = vec![false; pulses.len()];
        Self { pulses, config, frequency_sigma_hz, in_burst, found: Vec::new() }
    }

    /// Bursts of the coded tags, each given to all tags whose tolerances hold it.
    fn coded(&mut self, table: &TagTable) -> Vec<Tag> {
        let coded = || table.tags().iter().filter(|tag| !tag.gaps_s.is_empty());
        let mut all: BTreeMap<Vec<usize>, (f64, Vec<&KnownTag>)> = BTreeMap::new();
        for tag in coded() {
            for burst in bursts(self.pulses, tag, self.config) {
                let entry = all.entry(burst.pulses).or_insert((burst.misfit, Vec::new()));
                entry.0 = entry.0.min(burst.misfit);
                entry.1.push(tag);
            }
        }
        let mut all: Vec<_> = all.into_iter().collect();
        all.sort_by(|a, b| a.1.0.total_cmp(&b.1.0));
        let mut groups: BTreeMap<Vec<String>, (f64, Vec<Vec<usize>>)> = BTreeMap::new();
        for (pulses, (_, tags)) in all {
            if pulses.iter().any(|index| self.in_burst[*index]) {
                continue;
            }
            pulses.iter().for_each(|index| self.in_burst[*index] = true);
            let names = tags.iter().map(|tag| tag.name.clone()).collect();
            let group = groups.entry(names).or_insert((tags[0].interval_s, Vec::new()));
            group.1.push(pulses);
        }
        groups
            .into_iter()
            .map(|(names, (interval, bursts))| self.group(names, interval, bursts))
            .collect()
    }

    fn group(&self, names: Vec<String>, interval_s: f64, mut bursts: Vec<Vec<usize>>) -> Tag {
        bursts.sort();
        let begins: Vec<f64> = bursts.iter().map(|burst| self.pulses[burst[0]].time_s).collect();
        let times = |gap: f64| (gap / interval_s).round();
        let away = f64::from(self.config.max_missed) + 1.0;
        let gaps: Vec<f64> = begins.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let near = || gaps.iter().filter(|gap| (1.0..=away).contains(&times(**gap)));
        let missed: f64 = near().map(|gap| times(*gap) - 1.0).sum();
        let each: Vec<f64> = near().map(|gap| gap / times(*gap)).collect();
        let most = bursts.iter().map(Vec::len).max().unwrap_or(0);
        let gap = |n: usize| {
            let each = bursts.iter().filter_map(|burst| {
                Some(self.pulses[*burst.get(n + 1)?].time_s - self.pulses[burst[n]].time_s)
            });
            median(each.collect()).unwrap_or(0.0)
        };
        let gaps_s = (0..most.saturating_sub(1)).map(gap).collect();
        let pulses: Vec<usize> = bursts.concat();
        Tag {
            names,
            interval_s: median(each.clone()).unwrap_or(interval_s),
            jitter_s: scatter(each),
            bursts: bursts.len(),
            gaps_s,
            missed: whole(missed),
            log_odds: None,
            ..self.summary(pulses)
        }
    }

    /// Bursts of coded tags of no table, the clearest tag first.
    fn unknown_codes(&mut self) -> Vec<Tag> {
        let mut tags = Vec::new();
        loop {
            let free: Vec<bool> = self.held(None).iter().map(|held| !held).collect();
            let Some(code) = unknown_code(self.pulses, &free, self.config) else { return tags };
            code.bursts.iter().flatten().for_each(|index| self.in_burst[*index] = true);
            tags.push(self.group(Vec::new(), code.interval_s, code.bursts));
        }
    }

    /// A tag with the medians of these pulses' frequency and width.
    fn summary(&self, pulses: Vec<usize>) -> Tag {
        let of = |field: fn(&Pulse) -> f64| {
            median(pulses.iter().map(|index| field(&self.pulses[*index])).collect())
        };
        Tag {
            names: Vec::new(),
            frequency_hz: of(|pulse| pulse.frequency_hz).unwrap_or(0.0),
            interval_s: 0.0,
            width_s: of(|pulse| pulse.width_s).unwrap_or(0.0),
            jitter_s: 0.0,
            pulses,
            bursts: 0,
            gaps_s: Vec::new(),
            missed: 0,
            collided: 0,
            doubled: 0,
            slips: 0,
            changes: 0,
            by_other_interval: 0,
            log_odds: None,
        }
    }

    /// Finds the known tags, the best first: what the others are weighed against is then smaller.
    fn known(&mut self, tags: &[&KnownTag]) {
        // A train may begin with any pulse.
        let threshold = (count(self.pulses.len()) / self.config.false_tags).ln();
        let mut open: Vec<(&KnownTag, Proposal)> =
            tags.iter().map(|tag| (*tag, Proposal::Old)).collect();
        loop {
            let held = self.held(None);
            let clutter = Clutter::new(self.pulses, &held, self.frequency_sigma_hz);
            let scene = Scene { pulses: self.pulses, clutter: &clutter, held: &held };
            for (tag, proposal) in &mut open {
                if matches!(proposal, Proposal::Old) {
                    *proposal = match self.known_proposal(tag, &scene) {
                        Some((model, train)) => Proposal::Found(Box::new((model, train))),
                        None => Proposal::Nothing,
                    };
                }
            }
            let best = (0..open.len())
                .max_by(|a, b| open[*a].1.score().total_cmp(&open[*b].1.score()))
                .filter(|place| open[*place].1.score() > threshold);
            let Some((tag, Proposal::Found(found))) = best.map(|place| open.swap_remove(place))
            else {
                return;
            };
            let (model, train) = *found;
            let log_odds = train.score;
            let mut now = vec![false; self.pulses.len()];
            train.members.iter().for_each(|member| now[member.pulse] = true);
            for (_, proposal) in &mut open {
                if proposal.holds(&now) {
                    *proposal = Proposal::Old;
                }
            }
            self.found.push(Found { tag: Some(tag.clone()), model, train, log_odds });
        }
    }

    /// The best train of a known tag, at any frequency where its own is not known.
    fn known_proposal(&self, tag: &KnownTag, scene: &Scene<'_>) -> Option<(TrainModel, Train)> {
        let windows = match tag.frequency_hz {
            Some(f) => vec![(f, self.config.frequency_tolerance_hz)],
            None => self.windows(scene.held),
        };
        let intervals_s: Vec<f64> =
            std::iter::once(tag.interval_s).chain(tag.other_interval_s).collect();
        let tried = windows.into_iter().filter_map(|frequency_hz| {
            let model = self.model(intervals_s.clone(), frequency_hz, tag.width_s);
            let train = model.best(scene, &self.candidates(&model))?;
            Some((model, train))
        });
        let (model, train) = tried.max_by(|a, b| a.1.score.total_cmp(&b.1.score))?;
        Some(refined(&model, train, scene, &self.candidates(&model)))
    }

    /// Exchanges the names of known tags where both fit better: two that are alike may have found
    /// each other's train.
    fn rename(&mut self) {
        let places = 0..self.found.len();
        let pairs: Vec<(usize, usize)> =
            places.clone().flat_map(|a| places.clone().map(move |b| (a, b))).collect();
        // Each exchange betters the sum, and a second pass finds what the first made possible.
        for (a, b) in pairs.iter().chain(&pairs) {
            let one = &self.found[*a];
            let other = &self.found[*b];
            let (Some(name), Some(rival)) = (&one.tag, &other.tag) else { continue };
            let fit = |found: &Found, tag| found.fit(tag, self.pulses, self.config);
            let gain = fit(one, rival) + fit(other, name) - fit(one, name) - fit(other, rival);
            let alike = name.width_s.is_some() == rival.width_s.is_some()
                && name.other_interval_s.is_some() == rival.other_interval_s.is_some();
            if gain > 0.0 && alike {
                let name = name.clone();
                let rival = rival.clone();
                self.found[*a].tag = Some(rival);
                self.found[*b].tag = Some(name);
            }
        }
    }

    /// Finds unknown tags among the free pulses, the best first.
    fn unknown(&mut self) {
        let transform =
            IntervalTransform::new(self.config.intervals_s, self.config.interval_tolerance);
        let windows = self.windows(&self.held(None));
        let reach = 8.0 * self.frequency_sigma_hz;
        let mut proposals: Vec<Option<(TrainModel, Train)>> = vec![None; windows.len()];
        let mut is_old = vec![true; windows.len()];
        loop {
            let held = self.held(None);
            let clutter = Clutter::new(self.pulses, &held, self.frequency_sigma_hz);
            let scene = Scene { pulses: self.pulses, clutter: &clutter, held: &held };
            for (index, window) in windows.iter().enumerate() {
                if std::mem::take(&mut is_old[index]) {
                    proposals[index] = self.proposal(&transform, *window, &scene);
                }
            }
            let best = proposals.iter().flatten().max_by(|a, b| a.1.score.total_cmp(&b.1.score));
            let Some((model, train)) = best.cloned() else { return };
            let model = TrainModel { max_missed: self.config.max_missed, ..model };
            let (model, train) = refined(&model, train, &scene, &self.candidates(&model));
            let tried = count(windows.len() * transform.len() * self.pulses.len());
            if train.score <= (tried / self.config.false_tags).ln() || train.members.len() < FEWEST
            {
                return;
            }
            let at = model.frequency_hz.0;
            for (old, window) in is_old.iter_mut().zip(&windows) {
                *old = (window.0 - at).abs() <= reach;
            }
            let log_odds = train.score;
            self.found.push(Found { tag: None, model, train, log_odds });
        }
    }

    /// The best train of one window of frequencies.
    fn proposal(
        &self,
        transform: &IntervalTransform,
        window: (f64, f64),
        scene: &Scene<'_>,
    ) -> Option<(TrainModel, Train)> {
        let inside = self.pulses.iter().zip(scene.held).filter(|(pulse, held)| {
            !**held && (pulse.frequency_hz - window.0).abs() <= 2.0 * window.1
        });
        let mut times: Vec<f64> = inside.map(|(pulse, _)| pulse.time_s).collect();
        times.sort_by(f64::total_cmp);
        if times.len() < FEWEST {
            return None;
        }
        let peaks = transform.peaks(&times).into_iter().take(TRIED);
        let tried = peaks.filter_map(|peak| {
            let max_missed = self.config.max_missed.min(PROPOSED_MISSED);
            let model = self.model(vec![peak.interval_s], window, None);
            let model = TrainModel { max_missed, ..model };
            let train = model.best(scene, &self.candidates(&model))?;
            Some((model, train))
        });
        tried.max_by(|a, b| a.1.score.total_cmp(&b.1.score))
    }

    /// Windows of frequencies that hold pulses: middles and standard deviations; two reach as far
    /// as the next but one.
    fn windows(&self, held: &[bool]) -> Vec<(f64, f64)> {
        let step = 4.0 * self.frequency_sigma_hz;
        let open = self.pulses.iter().zip(held).filter(|(_, held)| !**held);
        let mut places: Vec<f64> =
            open.map(|(pulse, _)| (pulse.frequency_hz / step).round()).collect();
        places.sort_by(f64::total_cmp);
        places.dedup();
        places.into_iter().map(|place| (place * step, 0.5 * step)).collect()
    }

    fn model(
        &self,
        intervals_s: Vec<f64>,
        frequency_hz: (f64, f64),
        width_s: Option<f64>,
    ) -> TrainModel {
        TrainModel {
            intervals_s,
            interval_sigma: self.config.interval_tolerance,
            frequency_hz,
            width_s,
            time_sigma_s: self.config.time_sigma_s,
            frequency_sigma_hz: self.frequency_sigma_hz,
            max_missed: self.config.max_missed,
            detection: DETECTION,
            slip: SLIP,
        }
    }

    /// The pulses near enough to a train's frequency.
    fn candidates(&self, model: &TrainModel) -> Vec<usize> {
        let (middle, sigma) = model.frequency_hz;
        // Carriers drift.
        let reach = 5.0 * sigma.max(2.0 * self.frequency_sigma_hz);
        let near = |index: &usize| {
            !self.in_burst[*index] && (self.pulses[*index].frequency_hz - middle).abs() <= reach
        };
        (0..self.pulses.len()).filter(near).collect()
    }

    /// Marks the pulses of a burst or of any train other than `but`.
    fn held(&self, but: Option<usize>) -> Vec<bool> {
        let mut held = self.in_burst.clone();
        for (index, found) in self.found.iter().enumerate() {
            if Some(index) != but {
                found.train.members.iter().for_each(|member| held[member.pulse] = true);
            }
        }
        held
    }

    /// Finds each train again while the others are held, until none changes.
    fn share_out(&mut self) {
        for _ in 0..SWEEPS {
            let mut changed = false;
            let mut order: Vec<usize> = (0..self.found.len()).collect();
            order.sort_by(|a, b| self.found[*b].train.score.total_cmp(&self.found[*a].train.score));
            for index in order {
                changed |= self.find_anew(index);
            }
            if !changed {
                return;
            }
        }
    }

    /// Finds a train again with the others held; returns true if it came out different.
    fn find_anew(&mut self, index: usize) -> bool {
        let held = self.held(Some(index));
        let clutter = Clutter::new(self.pulses, &self.held(None), self.frequency_sigma_hz);
        let scene = Scene { pulses: self.pulses, clutter: &clutter, held: &held };
        let found = &self.found[index];
        let candidates = self.candidates(&found.model);
        let Some(train) = found.model.best(&scene, &candidates) else { return false };
        let (model, train) = refined(&found.model, train, &scene, &candidates);
        let places = |train: &Train| train.members.iter().map(|m| m.pulse).collect::<Vec<_>>();
        let changed = places(&train) != places(&found.train);
        let found = &mut self.found[index];
        (found.model, found.train) = (model, train);
        changed
    }

    fn tag(&self, index: usize) -> Tag {
        let found = &self.found[index];
        let members = &found.train.members;
        let others = self.held(Some(index));
        let linked = |link: Link| members.iter().filter(|member| member.link == link).count();
        let missed = members.iter().map(|member| member.intervals.saturating_sub(1)).sum();
        let gaps = gaps_s(self.pulses, members);
        Tag {
            names: found.tag.iter().map(|tag| tag.name.clone()).collect(),
            interval_s: median(gaps.clone()).unwrap_or(found.model.intervals_s[0]),
            jitter_s: scatter(gaps),
            missed,
            collided: members.iter().filter(|member| others[member.pulse]).count(),
            doubled: linked(Link::Doubles),
            slips: linked(Link::Slips),
            changes: linked(Link::Changes),
            by_other_interval: members.iter().filter(|member| member.mode > 0).count(),
            log_odds: Some(found.log_odds),
            ..self.summary(members.iter().map(|member| member.pulse).collect())
        }
    }
}

/// A train found with its detection probability, jitter, slips and interval as it shows them.
fn refined(
    model: &TrainModel,
    train: Train,
    scene: &Scene<'_>,
    candidates: &[usize],
) -> (TrainModel, Train) {
    let mut model = model.clone();
    let mut train = train;
    for _ in 0..3 {
        let members = &train.members;
        let links = members.iter().filter(|m| !matches!(m.link, Link::Begins | Link::Doubles));
        let pulses = count(links.clone().count());
        let intervals: f64 = links.map(|m| f64::from(m.intervals)).sum();
        let slips = |pair: &&[Member]| pair[1].link == Link::Slips && pair[0].link != Link::Slips;
        let slips = count(members.windows(2).filter(slips).count());
        if pulses < 3.0 {
            break;
        }
        // With a little of what was known before, so that no share is 0 or 1.
        let detection = (pulses + 10.0 * DETECTION) / (intervals + 10.0);
        let slip = (slips + 100.0 * SLIP) / (pulses + 100.0);
        // A tag jitters besides what its detector is off by.
        let scale = train.spread.sqrt().clamp(1.0, 3.0);
        let interval = median(gaps_s(scene.pulses, members));
        let mut intervals_s = model.intervals_s.clone();
        intervals_s[0] = interval.unwrap_or(intervals_s[0]);
        let time_sigma_s = model.time_sigma_s * scale;
        let tried = TrainModel { intervals_s, time_sigma_s, detection, slip, ..model.clone() };
        let Some(next) = tried.best(scene, candidates) else { break };
        (model, train) = (tried, next);
    }
    (model, train)
}

/// The gaps between a train's pulses, each over the intervals that it holds; but for slips.
fn gaps_s(pulses: &[Pulse], members: &[Member]) -> Vec<f64> {
    let mut gaps = Vec::new();
    let mut last: Option<f64> = None;
    for member in members {
        let time = pulses[member.pulse].time_s;
        if let (Link::Follows, Some(last), 0) = (member.link, last, member.mode) {
            gaps.push((time - last) / f64::from(member.intervals));
        }
        if member.link != Link::Doubles {
            last = Some(time);
        }
    }
    gaps
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Half the width of the middle 68 %.
fn scatter(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let low = values.len() * 16 / 100;
    let high = values.len() * 84 / 100;
    match (values.get(low), values.get(high)) {
        (Some(low), Some(high)) => 0.5 * (high - low),
        _ => 0.0,
    }
}

/// The raster that frequencies stand on: the least step between two; zero of fewer.
fn raster_hz(pulses: &[Pulse]) -> f64 {
    let mut frequencies: Vec<f64> = pulses.iter().map(|pulse| pulse.frequency_hz).collect();
    frequencies.sort_by(f64::total_cmp);
    frequencies.dedup();
    let least = frequencies.windows(2).map(|pair| pair[1] - pair[0]).fold(f64::INFINITY, f64::min);
    if least.is_finite() { least } else { 0.0 }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a count from below")]
fn whole(number: f64) -> u32 {
    number as u32
}
