//! Offset between the clock of levels and the clock of the receiver's places, found from how well
//! the levels fit the path.
//!
//! Each offset is another path of the same levels. Its likelihood is that of a log-distance law
//! about the best place, with shadowing that is correlated over the plane: a lane beside another
//! one has the same shadows, so that shadows count neither as independent errors nor for nothing.

mod shadowed;

use nalgebra::{Vector2, Vector3};
use serde::Serialize;

use self::shadowed::{Neighbours, Search, Shadowing};

/// Least number of levels by which clocks are compared.
const LEAST: usize = 40;
/// Largest number of levels that are looked at; of longer recordings, means.
const MOST_HEARD: usize = 4000;
/// Largest number of levels in the scan of all offsets, and about the best one; more are averaged.
const MOST_IN_SCAN: usize = 150;
const MOST_AT_BEST: usize = 300;
const MOST_IN_PROFILE: usize = 900;
/// Way from one offset of the scan to the next, in metres.
const SCAN_STEP_M: f64 = 8.0;
/// Largest number of offsets of the scan.
const MOST_OFFSETS: f64 = 241.0;
/// Steps of the scan about an offset whose levels are all on the path.
const PROFILE_STEPS: f64 = 6.0;
/// Largest number of local maxima of the scan that are looked at.
const MOST_MODES: usize = 10;
/// Largest gap of a maximum of the scan to the best one, as twice the log-likelihood ratio: the
/// levels that all offsets have in common may be the lesser part.
const MOST_BEHIND: f64 = 120.0;
/// Clocks that differ by less than this agree, in seconds: so late are many receivers' levels.
const AGREE_S: f64 = 2.0;
/// Twice the log-likelihood ratio from which on the clocks differ.
const DIFFER: f64 = 40.0;
/// Twice the log-likelihood ratio up to which another offset is a rival.
const RIVAL: f64 = 20.0;
/// Twice the log-likelihood ratio up to which an offset is looked at for the interval.
const LIKELY: f64 = 30.0;
/// Divisor of the log-likelihood in the posterior: shadows are no Gaussian field, and readings have
/// errors besides. So intervals of 95 % hold 95 % of drawn flights.
const TEMPER: f64 = 2.5;
/// Largest way of the receiver within the interval of an offset that is taken off, in metres.
const MOST_WAY_M: f64 = 60.0;
/// Levels that spread by less than this, in dB, show no place.
const LEAST_SPREAD_DB: f64 = 1.5;

/// Level at a time by its own clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HeardLevel {
    /// Seconds.
    pub time_s: f64,
    /// dB or dBm.
    pub level_db: f64,
}

/// Time by which the clock of the places is ahead of that of the levels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FoundOffset {
    /// The most likely offset, in seconds.
    pub offset_s: f64,
    /// Interval that holds the offset with 95 % probability, in seconds.
    pub interval_s: [f64; 2],
}

/// Relation of two clocks, as the levels show it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Clocks {
    /// The clocks differ by this.
    Differ(FoundOffset),
    /// The clocks agree within the interval, in seconds.
    Agree {
        /// Interval that holds the offset with 95 % probability, in seconds.
        interval_s: [f64; 2],
    },
    /// The levels do not show the offset.
    Unknown(ClocksUnknown),
}

/// Reason why levels do not show the offset of two clocks.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ClocksUnknown {
    /// Too few levels have a place at all offsets.
    #[error("{levels} levels lie on the path whatever the offset; {LEAST} are needed")]
    Few {
        /// Number of levels.
        levels: usize,
    },
    /// The receiver stays.
    #[error("the receiver stays where it is")]
    Still,
    /// The levels are alike.
    #[error("the levels hardly change")]
    Flat,
    /// Offsets far from each other fit about as well.
    #[error(
        "offsets of {:.1} to {:.1} s fit about as well, as on a straight path, along which another \
         clock is another place", interval_s[0], interval_s[1]
    )]
    Open {
        /// Interval of 95 %, in seconds.
        interval_s: [f64; 2],
    },
    /// Two separate offsets fit about as well.
    #[error("offsets of {:.1} and {:.1} s fit about as well", between[0], between[1])]
    Several {
        /// The offsets, in seconds.
        between: [f64; 2],
    },
    /// The clocks differ, and two offsets far from each other fit about as well.
    #[error(
        "the clocks differ, and offsets of {:.1} and {:.1} s fit about as well", between[0],
        between[1]
    )]
    NotZero {
        /// The offsets, in seconds.
        between: [f64; 2],
    },
    /// The clocks differ, but not by an offset in the range.
    #[error("the levels fit best at the end of the range of offsets, {offset_s:.0} s")]
    AtTheEnd {
        /// The offset, in seconds.
        offset_s: f64,
    },
}

/// Search for the offset of two clocks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockSearch {
    /// Largest offset that is looked for, in seconds.
    pub within_s: f64,
    /// Distance beyond the path in which the transmitter may be, in metres.
    pub margin_m: f64,
    /// Height of the transmitter, in metres.
    pub target_up_m: f64,
}

impl Default for ClockSearch {
    /// 120 s, 200 m, on the ground.
    fn default() -> Self {
        Self { within_s: 120.0, margin_m: 200.0, target_up_m: 0.0 }
    }
}

impl ClockSearch {
    /// Compares the clock of one transmitter's levels, in the order of time, with that of the
    /// receiver's path. `place` is the place at a time of the path's clock, `None` off the path.
    pub fn compare(
        &self,
        heard: &[HeardLevel],
        place: &dyn Fn(f64) -> Option<Vector3<f64>>,
    ) -> Clocks {
        let search = Comparison::new(self, heard, place);
        search.and_then(|search| search.run()).unwrap_or_else(Clocks::Unknown)
    }
}

/// Levels and path, ready to be compared.
struct Comparison<'a> {
    heard: Vec<HeardLevel>,
    place: &'a dyn Fn(f64) -> Option<Vector3<f64>>,
    search: Search,
    within_s: f64,
    step_s: f64,
    speed_mps: f64,
    scale: f64,
}

/// Log-likelihood of an offset, with the best place.
#[derive(Clone, Copy, Debug)]
struct Tried {
    offset_s: f64,
    value: f64,
    place: Vector2<f64>,
}

impl<'a> Comparison<'a> {
    fn new(
        config: &ClockSearch,
        heard: &[HeardLevel],
        place: &'a dyn Fn(f64) -> Option<Vector3<f64>>,
    ) -> Result<Self, ClocksUnknown> {
        let heard = without_outliers(&averaged(heard, MOST_HEARD));
        if heard.len() < LEAST {
            return Err(ClocksUnknown::Few { levels: heard.len() });
        }
        let mut levels: Vec<f64> = heard.iter().map(|own| own.level_db).collect();
        levels.sort_by(f64::total_cmp);
        let rank = |share: f64| quantile(&levels, share);
        if rank(0.9) - rank(0.1) < 2.0 * LEAST_SPREAD_DB {
            return Err(ClocksUnknown::Flat);
        }
        let places: Vec<_> = heard.iter().map(|own| place(own.time_s)).collect();
        let found = || places.iter().flatten().map(Vector3::xy);
        let low = found().fold(Vector2::repeat(f64::INFINITY), |low, at| low.inf(&at));
        let high = found().fold(Vector2::repeat(f64::NEG_INFINITY), |high, at| high.sup(&at));
        let extent_m = (high - low).norm();
        if !extent_m.is_finite() {
            return Err(ClocksUnknown::Few { levels: 0 });
        }
        // The speed on the way: of the faster half of the steps.
        let steps = heard.windows(2).zip(places.windows(2));
        let speed = |(levels, places): (&[HeardLevel], &[Option<Vector3<f64>>])| {
            let [a, b] = levels else { return None };
            let [from, to] = places else { return None };
            let seconds = b.time_s - a.time_s;
            let way = (*to)? - (*from)?;
            (seconds > 0.0).then(|| way.norm() / seconds)
        };
        let mut speeds: Vec<f64> = steps.filter_map(speed).collect();
        speeds.sort_by(f64::total_cmp);
        let speed_mps = quantile(&speeds, 0.75);
        if !(speed_mps > 0.05 && extent_m > 10.0) {
            return Err(ClocksUnknown::Still);
        }
        let scale = (extent_m / 200.0).min(1.0);
        let step_s = (SCAN_STEP_M * scale / speed_mps).max(2.0 * config.within_s / MOST_OFFSETS);
        let half_m = 0.5 * (high - low).amax() + config.margin_m * scale.max(0.2);
        let search = Search {
            middle: 0.5 * (low + high),
            half_m,
            up_m: config.target_up_m,
            finest_m: 1.0_f64.min(0.01 * extent_m),
        };
        let within_s = config.within_s;
        Ok(Self { heard, place, search, within_s, step_s, speed_mps, scale })
    }

    /// Largest of some ranges of offsets at all of which most levels lie on the path.
    fn range_s(&self) -> f64 {
        let shares = [1.0, 0.75, 0.5, 0.35, 0.25];
        let ranges = shares.map(|share| share * self.within_s);
        let most = LEAST.max(self.heard.len() / 2);
        let holds = |range_s: &f64| self.on_path([-range_s, *range_s]).len() >= most;
        ranges.into_iter().find(holds).unwrap_or(0.25 * self.within_s)
    }

    fn run(&self) -> Result<Clocks, ClocksUnknown> {
        let count = (self.range_s() / self.step_s).floor();
        #[expect(clippy::cast_possible_truncation, reason = "at most MOST_OFFSETS")]
        let count = count.min(MOST_OFFSETS) as i32;
        let offsets: Vec<f64> = (-count..=count).map(|n| f64::from(n) * self.step_s).collect();
        let end_s = f64::from(count) * self.step_s;
        let all = self.on_path([-end_s - self.step_s, end_s + self.step_s]);
        if all.len() < LEAST {
            return Err(ClocksUnknown::Few { levels: all.len() });
        }
        let scanned = averaged(&all, MOST_IN_SCAN);
        let usual = [
            Shadowing { length_m: 40.0 * self.scale, own_share: 0.3 },
            Shadowing { length_m: 1.0, own_share: 1.0 },
        ];
        let scan: Vec<Tried> =
            offsets.iter().map(|offset_s| self.tried(&scanned, *offset_s, &usual, None)).collect();
        let Some(best) = scan.iter().copied().max_by(|a, b| a.value.total_cmp(&b.value)) else {
            return Err(ClocksUnknown::Few { levels: 0 });
        };
        let now = scan.iter().copied().find(|tried| tried.offset_s.abs() <= 0.0).unwrap_or(best);
        // Local maxima, the most likely first, and no offset.
        let mut modes: Vec<Tried> = local_maxima(&scan)
            .into_iter()
            .filter(|own| 2.0 * (best.value - own.value) < MOST_BEHIND)
            .collect();
        modes.sort_by(|a, b| b.value.total_cmp(&a.value));
        modes.truncate(MOST_MODES);
        if modes.iter().all(|own| own.offset_s.abs() > self.step_s) {
            modes.push(now);
        }
        let levels = averaged(&all, MOST_AT_BEST);
        let shadowings = self.shadowings(&levels, &best);
        let refined: Vec<Tried> =
            modes.iter().map(|mode| self.refined(&levels, mode, &shadowings)).collect();
        let Some(best) = refined.iter().copied().max_by(|a, b| a.value.total_cmp(&b.value)) else {
            return Err(ClocksUnknown::Few { levels: 0 });
        };
        let others = self.rivals(&refined, best);
        let Some((best, gains)) = others else {
            let between = [best.offset_s, now.offset_s];
            return Err(ClocksUnknown::Several { between });
        };
        // By all levels that lie on the path about the best offset.
        let shadowings = self.shadowings(&self.near(best.offset_s, MOST_AT_BEST), &best);
        let about = self.near(best.offset_s, MOST_IN_PROFILE);
        let profile = self.profile(&about, &best, &shadowings);
        let [from_s, offset_s, to_s] = posterior(&profile);
        let interval_s = [from_s, to_s];
        let most_way_m = MOST_WAY_M * self.scale.max(0.3);
        if (interval_s[1] - interval_s[0]) * self.speed_mps > most_way_m {
            let excluded = interval_s[0] > AGREE_S || interval_s[1] < -AGREE_S;
            let gain = || self.gain_over_none(&best, now.place, &shadowings);
            return Err(if excluded && gain() >= DIFFER {
                ClocksUnknown::NotZero { between: interval_s }
            } else {
                ClocksUnknown::Open { interval_s }
            });
        }
        let agrees = interval_s[0] <= AGREE_S && interval_s[1] >= -AGREE_S;
        let is_zero = |other_s: f64| other_s.abs() <= self.step_s;
        let holds =
            |(other_s, gain): &(f64, f64)| *gain >= if is_zero(*other_s) { DIFFER } else { RIVAL };
        if let Some((other_s, _)) = gains.iter().find(|own| !holds(own)) {
            let between = [best.offset_s, *other_s];
            let zero = gains.iter().find(|(other_s, _)| is_zero(*other_s));
            let excluded = zero.is_some_and(|own| holds(own)) && !agrees;
            return Err(match excluded {
                true => ClocksUnknown::NotZero { between },
                false => ClocksUnknown::Several { between },
            });
        }
        if agrees {
            return Ok(Clocks::Agree { interval_s });
        }
        if self.gain_over_none(&best, now.place, &shadowings) < DIFFER {
            return Err(ClocksUnknown::Several { between: [best.offset_s, 0.0] });
        }
        if offset_s.abs() >= end_s - self.step_s {
            return Err(ClocksUnknown::AtTheEnd { offset_s });
        }
        Ok(Clocks::Differ(FoundOffset { offset_s, interval_s }))
    }

    /// Returns the offset that no other one beats by the levels that lie on the path at both, and
    /// its gain over each; `None` where each is beaten by another one.
    fn rivals(&self, modes: &[Tried], first: Tried) -> Option<(Tried, Vec<(f64, f64)>)> {
        let mut best = first;
        for _ in 0..MOST_MODES {
            let shadowings = self.shadowings(&self.near(best.offset_s, MOST_AT_BEST), &best);
            let mut gains = Vec::new();
            let mut better = None;
            for other in modes {
                if (other.offset_s - best.offset_s).abs() <= 2.0 * self.step_s {
                    continue;
                }
                let (gain, other) = self.gain(&best, other, &shadowings);
                if gain < 0.0 {
                    better = Some(other);
                    break;
                }
                gains.push((other.offset_s, gain));
            }
            match better {
                Some(better) => best = better,
                None => return Some((best, gains)),
            }
        }
        None
    }

    /// Twice the log-likelihood ratio of an offset and of clocks that agree.
    fn gain_over_none(&self, best: &Tried, place: Vector2<f64>, shadowings: &[Shadowing]) -> f64 {
        let range_s = [best.offset_s.min(-AGREE_S), best.offset_s.max(AGREE_S)];
        let both = averaged(&self.on_path(range_s), MOST_AT_BEST);
        let here = self.tried(&both, best.offset_s, shadowings, Some(best.place));
        let none = Tried { offset_s: 0.0, value: 0.0, place };
        let own = self.shadowings(&both, &none);
        let offsets = [-1.0, -0.5, 0.0, 0.5, 1.0].map(|share| share * AGREE_S);
        let there = offsets.map(|offset_s| self.tried(&both, offset_s, &own, Some(place)).value);
        2.0 * (here.value - there.into_iter().fold(f64::NEG_INFINITY, f64::max))
    }

    /// Returns the levels that lie on the path about an offset.
    fn near(&self, offset_s: f64, most: usize) -> Vec<HeardLevel> {
        let reach_s = PROFILE_STEPS * self.step_s;
        averaged(&self.on_path([offset_s - reach_s, offset_s + reach_s]), most)
    }

    /// Twice the log-likelihood ratio of two offsets, by the levels that lie on the path at both.
    fn gain(&self, best: &Tried, other: &Tried, shadowings: &[Shadowing]) -> (f64, Tried) {
        let reach_s = self.step_s;
        let from_s = best.offset_s.min(other.offset_s) - reach_s;
        let both = self.on_path([from_s, best.offset_s.max(other.offset_s) + reach_s]);
        let both = averaged(&both, MOST_AT_BEST);
        let here = self.tried(&both, best.offset_s, shadowings, Some(best.place));
        // The other has its own shadowing: it is not to lose by that of the best.
        let own = self.shadowings(&both, other);
        let there = self.refined(&both, other, &own);
        (2.0 * (here.value - there.value), there)
    }

    /// Returns the levels that have a place at both ends of a range of offsets and between.
    fn on_path(&self, [from_s, to_s]: [f64; 2]) -> Vec<HeardLevel> {
        let steps = ((to_s - from_s) / self.step_s).ceil().max(1.0);
        #[expect(clippy::cast_possible_truncation, reason = "at most some MOST_OFFSETS")]
        let count = steps.min(4.0 * MOST_OFFSETS) as i32;
        let offsets: Vec<f64> =
            (0..=count).map(|n| from_s + (to_s - from_s) * f64::from(n) / steps).collect();
        let has_place = |own: &&HeardLevel| {
            let mut offsets = offsets.iter();
            offsets.all(|offset_s| (self.place)(own.time_s + offset_s).is_some())
        };
        self.heard.iter().filter(has_place).copied().collect()
    }

    /// Returns an offset with its log-likelihood over some shadowings that are equally likely
    /// before; `near` is a place to begin with.
    fn tried(
        &self,
        heard: &[HeardLevel],
        offset_s: f64,
        shadowings: &[Shadowing],
        near: Option<Vector2<f64>>,
    ) -> Tried {
        let none = Tried { offset_s, value: f64::NEG_INFINITY, place: self.search.middle };
        let mut values = Vec::with_capacity(shadowings.len());
        let mut from = near;
        let mut best = (self.search.middle, f64::NEG_INFINITY);
        let mut places = Vec::with_capacity(heard.len());
        let mut levels = Vec::with_capacity(heard.len());
        for own in heard {
            // Fewer levels would make any offset more likely.
            let Some(place) = (self.place)(own.time_s + offset_s) else { return none };
            places.push(place);
            levels.push(own.level_db);
        }
        if places.len() < LEAST / 2 {
            return none;
        }
        let neighbours = Neighbours::new(places);
        for shadowing in shadowings {
            let whitener = neighbours.whitener(*shadowing);
            let mut readings = whitener.readings(&levels);
            let found = match from {
                Some(place) => readings.refine(place, 0.02 * self.search.half_m, &self.search),
                None => readings.search(&self.search),
            };
            from = Some(found.0);
            values.push(found.1);
            if found.1 > best.1 {
                best = found;
            }
        }
        let sum: f64 = values.iter().map(|value| (value - best.1).exp()).sum();
        Tried { offset_s, value: best.1 + sum.ln(), place: best.0 }
    }

    /// Returns the three shadowings that fit best at an offset.
    fn shadowings(&self, heard: &[HeardLevel], at: &Tried) -> Vec<Shadowing> {
        let mut fits: Vec<(f64, Shadowing)> = Vec::new();
        for length_m in [8.0, 20.0, 50.0, 125.0] {
            for own_share in [0.03, 0.15, 0.4, 0.75] {
                let shadowing = Shadowing { length_m: length_m * self.scale, own_share };
                let tried = self.tried(heard, at.offset_s, &[shadowing], Some(at.place));
                fits.push((tried.value, shadowing));
            }
        }
        let white = Shadowing { length_m: 1.0, own_share: 1.0 };
        fits.push((self.tried(heard, at.offset_s, &[white], Some(at.place)).value, white));
        fits.sort_by(|a, b| b.0.total_cmp(&a.0));
        fits.into_iter().take(3).map(|(_, shadowing)| shadowing).collect()
    }

    /// Returns the best offset about a mode of the scan.
    fn refined(&self, heard: &[HeardLevel], mode: &Tried, shadowings: &[Shadowing]) -> Tried {
        let mut best = self.tried(heard, mode.offset_s, shadowings, Some(mode.place));
        let mut step_s = 0.5 * self.step_s;
        for _ in 0..3 {
            let middle = best;
            for side in [-1.0, 1.0] {
                let offset_s = middle.offset_s + side * step_s;
                let tried = self.tried(heard, offset_s, shadowings, Some(middle.place));
                if tried.value > best.value {
                    best = tried;
                }
            }
            step_s *= 0.5;
        }
        best
    }

    /// Returns the profile of the likelihood about an offset, as far as it is likely.
    fn profile(&self, heard: &[HeardLevel], about: &Tried, shadowings: &[Shadowing]) -> Vec<Tried> {
        let mut profile = vec![self.tried(heard, about.offset_s, shadowings, Some(about.place))];
        let mut top = profile.first().map_or(f64::NEG_INFINITY, |own| own.value);
        for side in [-1.0, 1.0] {
            let mut last = profile.first().copied().unwrap_or(*about);
            let mut step_s = 0.05 * self.step_s;
            let mut steps = 0;
            let is_near = |own: &Tried| {
                (own.offset_s - about.offset_s).abs() < (PROFILE_STEPS - 1.0) * self.step_s
            };
            while 2.0 * (top - last.value) < LIKELY && is_near(&last) && steps < 80 {
                steps += 1;
                let offset_s = last.offset_s + side * step_s;
                last = self.tried(heard, offset_s, shadowings, Some(last.place));
                top = top.max(last.value);
                profile.push(last);
                // Wider steps where the likelihood changes little.
                if steps % 6 == 0 {
                    step_s *= 1.5;
                }
            }
        }
        profile.sort_by(|a, b| a.offset_s.total_cmp(&b.offset_s));
        profile
    }
}

/// Returns the offsets whose neighbours are less likely.
fn local_maxima(scan: &[Tried]) -> Vec<Tried> {
    let value = |index: Option<usize>| {
        index.and_then(|index| scan.get(index)).map_or(f64::NEG_INFINITY, |own| own.value)
    };
    let is_top = |index: usize| {
        let own = value(Some(index));
        own >= value(index.checked_sub(1)) && own > value(Some(index + 1))
    };
    scan.iter().enumerate().filter(|(index, _)| is_top(*index)).map(|(_, own)| *own).collect()
}

/// Returns the offset of 2.5 %, the mean and the offset of 97.5 % of the posterior, with an even
/// prior and [`TEMPER`].
fn posterior(profile: &[Tried]) -> [f64; 3] {
    let top = profile.iter().map(|own| own.value).fold(f64::NEG_INFINITY, f64::max);
    let mut masses = vec![(0.0, profile.first().map_or(0.0, |own| own.offset_s))];
    let mut mass = 0.0;
    let mut moment = 0.0;
    for (a, b) in profile.iter().zip(profile.iter().skip(1)) {
        let density = |own: &Tried| ((own.value - top) / TEMPER).exp();
        let part = 0.5 * (density(a) + density(b)) * (b.offset_s - a.offset_s);
        mass += part;
        moment += 0.5 * part * (a.offset_s + b.offset_s);
        masses.push((mass, b.offset_s));
    }
    let at = |share: f64| {
        let wanted = share * mass;
        let after = masses.partition_point(|own| own.0 < wanted);
        let (Some(after), Some(before)) = (masses.get(after), masses.get(after.saturating_sub(1)))
        else {
            return f64::NAN;
        };
        let width = after.0 - before.0;
        let part = if width > 0.0 { (wanted - before.0) / width } else { 0.0 };
        before.1 + part * (after.1 - before.1)
    };
    let mean = if mass > 0.0 { moment / mass } else { at(0.5) };
    [at(0.025), mean, at(0.975)]
}

/// Returns the value below which a share of sorted numbers lies.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "a share of the number of levels"
    )]
    let rank = (share * sorted.len() as f64) as usize;
    sorted.get(rank.min(sorted.len().saturating_sub(1))).copied().unwrap_or(0.0)
}

/// Returns the levels without the ones that stand far off their neighbours in time.
fn without_outliers(heard: &[HeardLevel]) -> Vec<HeardLevel> {
    let off = |index: usize| {
        let own = heard.get(index)?;
        let near = heard.get(index.saturating_sub(3)..(index + 4).min(heard.len()))?;
        let mut near: Vec<f64> = near.iter().map(|other| other.level_db).collect();
        near.sort_by(f64::total_cmp);
        Some((own.level_db - quantile(&near, 0.5)).abs())
    };
    let offs: Vec<f64> = (0..heard.len()).map(|index| off(index).unwrap_or(0.0)).collect();
    let mut sorted = offs.clone();
    sorted.sort_by(f64::total_cmp);
    let limit = 5.0 * (1.4826 * quantile(&sorted, 0.5)).max(1.0);
    let kept =
        heard.iter().zip(&offs).filter(|(own, off)| **off <= limit && own.level_db.is_finite());
    kept.map(|(own, _)| *own).collect()
}

/// Returns at most so many levels, each the mean of as many that follow each other.
fn averaged(heard: &[HeardLevel], most: usize) -> Vec<HeardLevel> {
    let size = heard.len().div_ceil(most).max(1);
    if size == 1 {
        return heard.to_vec();
    }
    let mut means = Vec::with_capacity(most);
    for part in heard.chunks(size) {
        let count = f64::from(u32::try_from(part.len()).unwrap_or(u32::MAX));
        let mean = |of: fn(&HeardLevel) -> f64| part.iter().map(of).sum::<f64>() / count;
        means.push(HeardLevel {
            time_s: mean(|own| own.time_s),
            level_db: mean(|own| own.level_db),
        });
    }
    means
}
