//! Offset between the clock of levels and the clock of the receiver's places, found from how well
//! the levels fit the path.
//!
//! Each offset is another path of the same levels. Its likelihood is that of a log-distance law
//! about the best place, with shadowing that is correlated over the plane: a lane beside another
//! one has the same shadows, so that shadows count neither as independent errors nor for nothing.

mod shadowed;

use foxhunt_core::Pose;
use foxhunt_filters::vecchia::Correlation;
use nalgebra::{Vector2, Vector3};
use serde::Serialize;

use self::shadowed::{Places, Search};

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
/// Least number of offsets on either side of none: a receiver that is slower stays.
const LEAST_COUNT: i32 = 3;
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
/// Slowest motion, in m/s, and least share of the usual speed of a receiver on its way: slower ones
/// are the receiver's own errors at a hover.
const LEAST_SPEED_MPS: f64 = 0.05;
const LEAST_SHARE_OF_SPEED: f64 = 0.2;
/// Usual steps of time between two levels beyond which they are not averaged: the receiver may have
/// been elsewhere in between.
const MOST_STEPS: f64 = 3.0;
/// Least number of points of a profile.
const LEAST_PROFILE: usize = 5;
/// Least half width of an interval, in seconds: receivers stamp their levels no better.
const LEAST_HALF_S: f64 = 0.1;
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

impl FoundOffset {
    /// Returns the sentence on where the levels fit the path, with the interval.
    pub(super) fn finding(&self) -> String {
        let Self { offset_s, interval_s: [from_s, to_s] } = self;
        let side = if *offset_s > 0.0 { "later" } else { "earlier" };
        format!(
            "the levels fit the receiver's path far better where it was {:.1} s {side} \
             ({from_s:.1} to {to_s:.1} s)",
            offset_s.abs(),
        )
    }
}

/// Relation of two clocks, as the levels show it.
#[derive(Clone, Copy, Debug, PartialEq)]
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
    /// The path has gaps where levels would lie at other offsets.
    #[error("the path has gaps, so that offsets cannot be compared")]
    Gaps,
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
    #[error(
        "the clocks differ, and the levels fit best at the end of the range of offsets, \
         {offset_s:.0} s"
    )]
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
        let steps = heard.windows(2).zip(places.windows(2));
        let step = |(levels, places): (&[HeardLevel], &[Option<Vector3<f64>>])| {
            let [a, b] = levels else { return None };
            let [from, to] = places else { return None };
            let seconds = b.time_s - a.time_s;
            let way = (*to)? - (*from)?;
            (seconds > 0.0).then(|| [way.norm(), seconds])
        };
        let speed_mps = speed_mps(&steps.filter_map(step).collect::<Vec<_>>());
        if !(speed_mps > 0.0 && extent_m > 10.0) {
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
        Ok(Self { heard, place, search, within_s, step_s, scale })
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
        if count < LEAST_COUNT {
            return Err(ClocksUnknown::Still);
        }
        let end_s = f64::from(count) * self.step_s;
        let all = self.on_path([-end_s - self.step_s, end_s + self.step_s]);
        if all.len() < LEAST {
            return Err(ClocksUnknown::Few { levels: all.len() });
        }
        let scanned = self.averaged_on_path([-end_s, end_s], &all, MOST_IN_SCAN);
        let usual = [
            Correlation { length_m: 40.0 * self.scale, nugget: 0.3 },
            Correlation { length_m: 1.0, nugget: 1.0 },
        ];
        let scan: Vec<Tried> =
            offsets.iter().map(|offset_s| self.tried(&scanned, *offset_s, &usual, None)).collect();
        let Some(best) = scan.iter().copied().max_by(|a, b| a.value.total_cmp(&b.value)) else {
            return Err(ClocksUnknown::Few { levels: 0 });
        };
        if scan.iter().any(|tried| !tried.value.is_finite()) {
            return Err(ClocksUnknown::Gaps);
        }
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
        let levels = self.averaged_on_path([-end_s, end_s], &all, MOST_AT_BEST);
        let shadowings = self.shadowings(&levels, &best);
        let refined: Vec<Tried> =
            modes.iter().map(|mode| self.refined(&levels, mode, &shadowings)).collect();
        let Some(best) = refined.iter().copied().max_by(|a, b| a.value.total_cmp(&b.value)) else {
            return Err(ClocksUnknown::Few { levels: 0 });
        };
        let Some((best, gains)) = self.rivals(&refined, best) else {
            let between = [best.offset_s, now.offset_s];
            return Err(ClocksUnknown::Several { between });
        };
        // By all levels that lie on the path about the best offset.
        let shadowings = self.shadowings(&self.near(best.offset_s, MOST_AT_BEST), &best);
        let excludes_none = best.offset_s.abs() > AGREE_S
            && self.gain_over_none(&best, now.place, &shadowings).is_some_and(|own| own >= DIFFER);
        if best.offset_s.abs() >= end_s - self.step_s {
            let offset_s = best.offset_s;
            return Err(if excludes_none {
                ClocksUnknown::AtTheEnd { offset_s }
            } else {
                ClocksUnknown::Several { between: [offset_s, 0.0] }
            });
        }
        let about = self.near(best.offset_s, MOST_IN_PROFILE);
        let profile = self.profile(&about, &best, &shadowings)?;
        let [from_s, offset_s, to_s] = posterior(&profile);
        let interval_s = [from_s.min(offset_s - LEAST_HALF_S), to_s.max(offset_s + LEAST_HALF_S)];
        let agrees = interval_s[0] <= AGREE_S && interval_s[1] >= -AGREE_S;
        if self.way_m(&about, interval_s) > MOST_WAY_M * self.scale.max(0.3) {
            return Err(if excludes_none && !agrees {
                ClocksUnknown::NotZero { between: interval_s }
            } else {
                ClocksUnknown::Open { interval_s }
            });
        }
        let is_zero = |other_s: f64| other_s.abs() <= self.step_s;
        let holds = |(other_s, gain): &(f64, Option<f64>)| {
            gain.is_some_and(|gain| gain >= if is_zero(*other_s) { DIFFER } else { RIVAL })
        };
        if let Some((other_s, _)) = gains.iter().find(|own| !holds(own)) {
            let between = [best.offset_s, *other_s];
            let zero = gains.iter().find(|(other_s, _)| is_zero(*other_s));
            let excluded = zero.is_none_or(holds) && excludes_none && !agrees;
            return Err(if excluded {
                ClocksUnknown::NotZero { between }
            } else {
                ClocksUnknown::Several { between }
            });
        }
        if agrees {
            return Ok(Clocks::Agree { interval_s });
        }
        if !excludes_none {
            return Err(ClocksUnknown::Several { between: [best.offset_s, 0.0] });
        }
        Ok(Clocks::Differ(FoundOffset { offset_s, interval_s }))
    }

    /// Mean way in metres of the receiver along the path over an interval of offsets, by the levels
    /// at which it moves.
    fn way_m(&self, heard: &[HeardLevel], [from_s, to_s]: [f64; 2]) -> f64 {
        let offsets: Vec<f64> =
            (0..=8).map(|part| from_s + (to_s - from_s) * f64::from(part) / 8.0).collect();
        let way = |own: &HeardLevel| -> f64 {
            let places: Vec<_> =
                offsets.iter().filter_map(|offset_s| (self.place)(own.time_s + offset_s)).collect();
            places.iter().zip(places.iter().skip(1)).map(|(a, b)| (b - a).norm()).sum()
        };
        let width_s = to_s - from_s;
        let ways: Vec<[f64; 2]> = heard.iter().map(|own| [way(own), width_s]).collect();
        width_s * speed_mps(&ways)
    }

    /// Returns the offset that no other one beats by the levels that lie on the path at both, and
    /// its gain over each, without one that cannot be compared; `None` where each is beaten by
    /// another one.
    #[expect(clippy::type_complexity, reason = "used once")]
    fn rivals(&self, modes: &[Tried], first: Tried) -> Option<(Tried, Vec<(f64, Option<f64>)>)> {
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
                if gain.is_some_and(|gain| gain < 0.0) {
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

    /// Twice the log-likelihood ratio of an offset and of clocks that agree; `None` where they
    /// cannot be compared.
    fn gain_over_none(
        &self,
        best: &Tried,
        place: Vector2<f64>,
        shadowings: &[Correlation],
    ) -> Option<f64> {
        let range_s = [best.offset_s.min(-AGREE_S), best.offset_s.max(AGREE_S)];
        let both = self.averaged_on_path(range_s, &self.on_path(range_s), MOST_AT_BEST);
        let here = self.tried(&both, best.offset_s, shadowings, Some(best.place));
        let none = Tried { offset_s: 0.0, value: 0.0, place };
        let own = self.shadowings(&both, &none);
        let offsets = [-1.0, -0.5, 0.0, 0.5, 1.0].map(|share| share * AGREE_S);
        let there = offsets.map(|offset_s| self.tried(&both, offset_s, &own, Some(place)).value);
        ratio(here.value, there.into_iter().fold(f64::NEG_INFINITY, f64::max))
    }

    /// Returns the levels that lie on the path about an offset.
    fn near(&self, offset_s: f64, most: usize) -> Vec<HeardLevel> {
        let reach_s = PROFILE_STEPS * self.step_s;
        let range_s = [offset_s - reach_s, offset_s + reach_s];
        self.averaged_on_path(range_s, &self.on_path(range_s), most)
    }

    /// Twice the log-likelihood ratio of two offsets, by the levels that lie on the path at both,
    /// and the other one refined; `None` where they cannot be compared.
    fn gain(
        &self,
        best: &Tried,
        other: &Tried,
        shadowings: &[Correlation],
    ) -> (Option<f64>, Tried) {
        let reach_s = self.step_s;
        let from_s = best.offset_s.min(other.offset_s) - reach_s;
        let range_s = [from_s, best.offset_s.max(other.offset_s) + reach_s];
        let both = self.averaged_on_path(range_s, &self.on_path(range_s), MOST_AT_BEST);
        let here = self.tried(&both, best.offset_s, shadowings, Some(best.place));
        // The other has its own shadowing: it is not to lose by that of the best.
        let own = self.shadowings(&both, other);
        let there = self.refined(&both, other, &own);
        (ratio(here.value, there.value), there)
    }

    /// Returns the levels that have a place at both ends of a range of offsets and between.
    fn on_path(&self, range_s: [f64; 2]) -> Vec<HeardLevel> {
        self.kept_on_path(range_s, &self.heard)
    }

    /// Returns means of levels that lie on the path over a range of offsets, without the means that
    /// do not: a gap of the path may lie between two levels.
    fn averaged_on_path(
        &self,
        range_s: [f64; 2],
        heard: &[HeardLevel],
        most: usize,
    ) -> Vec<HeardLevel> {
        self.kept_on_path(range_s, &averaged(heard, most))
    }

    fn kept_on_path(&self, [from_s, to_s]: [f64; 2], heard: &[HeardLevel]) -> Vec<HeardLevel> {
        let steps = ((to_s - from_s) / self.step_s).ceil().max(1.0);
        #[expect(clippy::cast_possible_truncation, reason = "at most some MOST_OFFSETS")]
        let count = steps.min(4.0 * MOST_OFFSETS) as i32;
        let offsets: Vec<f64> =
            (0..=count).map(|n| from_s + (to_s - from_s) * f64::from(n) / steps).collect();
        let has_place = |own: &&HeardLevel| {
            let mut offsets = offsets.iter();
            offsets.all(|offset_s| (self.place)(own.time_s + offset_s).is_some())
        };
        heard.iter().filter(has_place).copied().collect()
    }

    /// Returns an offset with its log-likelihood over some shadowings that are equally likely
    /// before; `near` is a place to begin with.
    fn tried(
        &self,
        heard: &[HeardLevel],
        offset_s: f64,
        shadowings: &[Correlation],
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
            places.push(Pose::level(place, 0.0));
            levels.push(own.level_db);
        }
        if places.len() < LEAST / 2 {
            return none;
        }
        let places = Places::new(places);
        for shadowing in shadowings {
            let Some(mut readings) = places.readings(&levels, *shadowing) else { return none };
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
        let sum: f64 = values.iter().map(|value| libm::exp(value - best.1)).sum();
        Tried { offset_s, value: best.1 + libm::log(sum), place: best.0 }
    }

    /// Returns the three shadowings that fit best at an offset.
    fn shadowings(&self, heard: &[HeardLevel], at: &Tried) -> Vec<Correlation> {
        let mut fits: Vec<(f64, Correlation)> = Vec::new();
        for length_m in [8.0, 20.0, 50.0, 125.0] {
            for nugget in [0.03, 0.15, 0.4, 0.75] {
                let shadowing = Correlation { length_m: length_m * self.scale, nugget };
                let tried = self.tried(heard, at.offset_s, &[shadowing], Some(at.place));
                fits.push((tried.value, shadowing));
            }
        }
        let white = Correlation { length_m: 1.0, nugget: 1.0 };
        fits.push((self.tried(heard, at.offset_s, &[white], Some(at.place)).value, white));
        fits.sort_by(|a, b| b.0.total_cmp(&a.0));
        fits.into_iter().take(3).map(|(_, shadowing)| shadowing).collect()
    }

    /// Returns the best offset about a mode of the scan.
    fn refined(&self, heard: &[HeardLevel], mode: &Tried, shadowings: &[Correlation]) -> Tried {
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
    fn profile(
        &self,
        heard: &[HeardLevel],
        about: &Tried,
        shadowings: &[Correlation],
    ) -> Result<Vec<Tried>, ClocksUnknown> {
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
                if !last.value.is_finite() {
                    // The profile would end where the path does, not the likelihood.
                    return Err(ClocksUnknown::Gaps);
                }
                top = top.max(last.value);
                profile.push(last);
                // Wider steps where the likelihood changes little.
                if steps % 6 == 0 {
                    step_s *= 1.5;
                }
            }
        }
        if profile.len() < LEAST_PROFILE || !top.is_finite() {
            return Err(ClocksUnknown::Gaps);
        }
        profile.sort_by(|a, b| a.offset_s.total_cmp(&b.offset_s));
        Ok(profile)
    }
}

/// Twice the logarithm of the ratio of two likelihoods; `None` unless both are known.
fn ratio(one: f64, other: f64) -> Option<f64> {
    (one.is_finite() && other.is_finite()).then_some(2.0 * (one - other))
}

/// Returns the speed on the way, length over time, of steps of metres and seconds; 0 where the
/// receiver stays.
fn speed_mps(steps: &[[f64; 2]]) -> f64 {
    let speed = |[metres, seconds]: &[f64; 2]| metres / seconds;
    let mut sorted = steps.to_vec();
    sorted.sort_by(|a, b| speed(a).total_cmp(&speed(b)));
    // The speed below which half of the way was made.
    let half_m = 0.5 * sorted.iter().map(|step| step[0]).sum::<f64>();
    let mut passed_m = 0.0;
    let usual = sorted.iter().find(|step| {
        passed_m += step[0];
        passed_m >= half_m
    });
    let usual = usual.map_or(0.0, speed);
    let least = (LEAST_SHARE_OF_SPEED * usual).max(LEAST_SPEED_MPS);
    let mut metres = 0.0;
    let mut seconds = 0.0;
    for step in sorted.iter().filter(|step| speed(step) > least) {
        metres += step[0];
        seconds += step[1];
    }
    if seconds > 0.0 { metres / seconds } else { 0.0 }
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
        let density = |own: &Tried| libm::exp((own.value - top) / TEMPER);
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

/// Returns `most` levels or fewer, each the mean of an equal number that follow each other without
/// a hole.
fn averaged(heard: &[HeardLevel], most: usize) -> Vec<HeardLevel> {
    let size = heard.len().div_ceil(most.max(1));
    if size <= 1 {
        return heard.to_vec();
    }
    let step = |pair: &[HeardLevel]| match pair {
        [a, b] => b.time_s - a.time_s,
        _ => 0.0,
    };
    let mut steps: Vec<f64> = heard.windows(2).map(step).filter(|step| *step > 0.0).collect();
    steps.sort_by(f64::total_cmp);
    let most_s = MOST_STEPS * quantile(&steps, 0.5);
    let mut means = Vec::with_capacity(most);
    for run in heard.chunk_by(|a, b| b.time_s - a.time_s <= most_s) {
        for part in run.chunks(size) {
            let count = f64::from(u32::try_from(part.len()).unwrap_or(u32::MAX));
            let mean = |of: fn(&HeardLevel) -> f64| part.iter().map(of).sum::<f64>() / count;
            means.push(HeardLevel {
                time_s: mean(|own| own.time_s),
                level_db: mean(|own| own.level_db),
            });
        }
    }
    // Many holes leave more means than wanted.
    let count = means.len();
    if count <= most {
        return means;
    }
    (0..most).filter_map(|index| means.get(index * count / most).copied()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    fn levels(times: impl Iterator<Item = f64>) -> Vec<HeardLevel> {
        times.map(|time_s| HeardLevel { time_s, level_db: -70.0 - time_s % 7.0 }).collect()
    }

    #[test]
    fn means_do_not_span_holes_and_are_few() {
        let second = |count: u32| (0..count).map(f64::from);
        // 100 levels, 300 s without, 101 levels.
        let heard = levels(second(100).chain(second(101).map(|own| own + 400.0)));
        let means = averaged(&heard, 10);
        assert!(means.len() <= 10, "{means:?}");
        assert!(means.iter().all(|own| own.time_s <= 99.0 || own.time_s >= 400.0), "{means:?}");
        // Pairs with a hole after each.
        let pairs = levels(second(2000).map(|own| (own / 2.0).floor() * 60.0 + own % 2.0));
        assert_eq!(averaged(&pairs, 150).len(), 150);
    }

    #[test]
    fn the_speed_is_that_of_steps_that_move() {
        // Nine tenths of the time at a hover, with the errors of its places.
        let hover = std::iter::repeat_n([0.2, 1.0], 900);
        let way = std::iter::repeat_n([8.0, 1.0], 100);
        let speed = speed_mps(&hover.chain(way).collect::<Vec<_>>());
        assert_abs_diff_eq!(speed, 8.0, epsilon = 1e-9);
        assert_abs_diff_eq!(speed_mps(&[[0.0, 1.0]; 9]), 0.0, epsilon = 1e-9);
    }

    /// A path whose gaps leave no offset but the own one is no evidence.
    #[test]
    fn a_path_with_gaps_is_refused() {
        let heard: Vec<HeardLevel> = (0..200_u32)
            .map(f64::from)
            .map(|own| HeardLevel { time_s: 40.0 * own, level_db: -60.0 - (own % 30.0) })
            .collect();
        let place = |time_s: f64| {
            let off = (time_s - 40.0 * (time_s / 40.0).round()).abs();
            (off < 3.0 && (0.0..8000.0).contains(&time_s))
                .then(|| Vector3::new(0.5 * time_s, 100.0 * (time_s / 500.0).sin(), 30.0))
        };
        let clocks = ClockSearch::default().compare(&heard, &place);
        assert!(matches!(clocks, Clocks::Unknown(_)), "{clocks:?}");
    }

    #[test]
    fn an_interval_has_a_width() {
        let tried = |offset_s: f64, value: f64| Tried { offset_s, value, place: Vector2::zeros() };
        let profile: Vec<Tried> =
            (-10..=10).map(f64::from).map(|own| tried(own, -0.5 * own * own)).collect();
        let [from_s, mean_s, to_s] = posterior(&profile);
        assert!(from_s < -2.0 && mean_s.abs() < 1e-9 && to_s > 2.0, "{from_s} {mean_s} {to_s}");
    }
}
