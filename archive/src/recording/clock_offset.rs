//! Clock of a recording of levels beside the clock of its receiver's path.

use std::collections::BTreeMap;

use foxhunt_hunt::locate::{ClockSearch, Clocks, HeardLevel};
use foxhunt_sensors::{HARMONIC_PATTERN_UNKNOWNS, unexplained_by_harmonics};
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::{PoseLog, Recording, Rover, TimedLevel};

/// Least number of pulses of a tag at a place: more than twice the unknowns.
const LEAST_PULSES: usize = 24;
/// Largest turn of the boresight from one tried offset to the next, in radians.
const STEP: f64 = 0.02;
/// Greatest number of offsets that are tried on each side.
const MOST_STEPS: f64 = 25_000.0;
/// Largest turn of the antenna within the interval of a known offset, in degrees.
const MOST_TURN_DEG: f64 = 20.0;

/// Time by which the poses' clock is ahead of the levels' clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockOffset {
    /// The most likely offset, in seconds.
    pub offset_s: f64,
    /// Interval that holds the offset with 95 % confidence, in seconds.
    pub interval_s: [f64; 2],
}

/// Reason why the offset of two clocks is not known from the data.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ClockOffsetError {
    /// The boresight is missing or constant.
    #[error("clocks are compared by an antenna that turns, and boresight_deg_compass has none")]
    Still,
    /// The range cannot be searched.
    #[error(
        "an offset within {within_s} s is not searched: at most {most_s:.0} s for such an antenna"
    )]
    Range {
        /// The range that was given, in seconds.
        within_s: f64,
        /// The longest range, in seconds.
        most_s: f64,
    },
    /// Too few levels.
    #[error(
        "{levels} pulses of any one tag are heard at one place whatever the offset in the range; \
         {LEAST_PULSES} are needed"
    )]
    Few {
        /// The most levels of any tag at any place.
        levels: usize,
    },
    /// Offsets far from each other are about as likely.
    #[error(
        "offsets of {:.3} and {:.3} s are both likely: levels and boresight do not show which is \
         right, as where an antenna turns evenly", between[0], between[1]
    )]
    Several {
        /// Two such offsets, in seconds.
        between: [f64; 2],
    },
    /// The most likely offset is at the end of the range.
    #[error("the most likely offset, {offset_s:.3} s, is at the end of the range")]
    AtTheEnd {
        /// The offset, in seconds.
        offset_s: f64,
    },
    /// The offset is not known well enough.
    #[error(
        "the offset is between {:.3} and {:.3} s, in which the antenna turns by {turn_deg:.0}°; \
         more than {MOST_TURN_DEG}° is not known well enough", interval_s[0], interval_s[1]
    )]
    Wide {
        /// The interval of 95 %, in seconds; the whole range where it is longer.
        interval_s: [f64; 2],
        /// Turn of the antenna in the interval, in degrees (rms over the pulses).
        turn_deg: f64,
    },
}

/// The levels of a tag at a place: each with its boresights in radians at the offsets tried.
type Group = Vec<(f64, Vec<f64>)>;

impl PoseLog {
    /// Finds by how much the poses' clock is ahead of that of the levels, within `within_s` of
    /// `about_s`: the offset at which patterns explain the levels best by the boresight, by maximum
    /// likelihood. Each tag has its own pattern at each place where the receiver hovers, any with
    /// four harmonics in dB, so that neither bearings nor antenna nor noise need be known. The
    /// interval is that of the profile likelihood, with Student's t for the noise's level (Seber &
    /// Wild 1989).
    ///
    /// # Errors
    ///
    /// [`ClockOffsetError`] where the offset does not follow from the data: several are likely, the
    /// best is at the end of the range, or the antenna turns by more than 20° within the interval.
    pub fn clock_offset(
        &self,
        levels: &[TimedLevel],
        [about_s, within_s]: [f64; 2],
        gap_s: f64,
    ) -> Result<ClockOffset, ClockOffsetError> {
        let rate = self.turn_rate();
        if !self.has_boresight() || rate <= 0.0 {
            return Err(ClockOffsetError::Still);
        }
        let steps = (within_s * rate / STEP).ceil().max(10.0);
        if !(within_s > 0.0 && about_s.is_finite() && steps <= MOST_STEPS) {
            return Err(ClockOffsetError::Range { within_s, most_s: MOST_STEPS * STEP / rate });
        }
        #[expect(clippy::cast_possible_truncation, reason = "at most MOST_STEPS")]
        let count = steps as i32;
        let offsets = (-count..=count).map(|i| about_s + within_s * f64::from(i) / steps);
        let offsets: Vec<f64> = offsets.collect();
        let groups = self.groups(levels, &offsets, gap_s)?;
        let pulses: usize = groups.iter().map(Vec::len).sum();
        let squares = |place| groups.iter().map(|group| unexplained(group, place)).sum();
        let squares: Vec<f64> = (0..offsets.len()).map(squares).collect();
        #[expect(clippy::cast_precision_loss, reason = "pulses of a flight")]
        let freedom = (pulses - HARMONIC_PATTERN_UNKNOWNS * groups.len() - 1) as f64;
        let profile = Profile { offsets: &offsets, squares: &squares, freedom };
        let (found, places) = profile.interval()?;
        let turn_deg = turn(&groups, places).to_degrees();
        if turn_deg > MOST_TURN_DEG {
            return Err(ClockOffsetError::Wide { interval_s: found.interval_s, turn_deg });
        }
        Ok(found)
    }

    /// The levels by tag and place, if heard at one place at all offsets.
    fn groups(
        &self,
        levels: &[TimedLevel],
        offsets: &[f64],
        gap_s: f64,
    ) -> Result<Vec<Group>, ClockOffsetError> {
        let mut groups = BTreeMap::<_, Group>::new();
        for level in levels {
            let at = |offset: &f64| self.boresight(level.time_s + offset, gap_s);
            let Some(seen) = offsets.iter().map(at).collect::<Option<Vec<_>>>() else { continue };
            let Some(hover) = seen.first().map(|(_, hover)| *hover) else { continue };
            if seen.iter().all(|(_, other)| *other == hover) {
                let boresights = seen.into_iter().map(|(boresight, _)| boresight).collect();
                let group = groups.entry((&level.beacon, hover)).or_default();
                group.push((level.level_db, boresights));
            }
        }
        let most = groups.values().map(Vec::len).max().unwrap_or(0);
        groups.retain(|_, group| group.len() >= LEAST_PULSES);
        match groups.is_empty() {
            true => Err(ClockOffsetError::Few { levels: most }),
            false => Ok(groups.into_values().collect()),
        }
    }
}

/// Sum of squares that patterns leave unexplained at each offset.
struct Profile<'a> {
    offsets: &'a [f64],
    squares: &'a [f64],
    freedom: f64,
}

impl Profile<'_> {
    /// The most likely offset with its interval, and the places in the list that enclose it.
    fn interval(&self) -> Result<(ClockOffset, [usize; 2]), ClockOffsetError> {
        let Self { offsets, squares, freedom } = self;
        let least = squares.iter().copied().fold(f64::INFINITY, f64::min);
        let t = StudentsT::new(0.0, 1.0, *freedom).map_or(f64::INFINITY, |t| t.inverse_cdf(0.975));
        let limit = least * (1.0 + t * t / freedom);
        // Three times as far in likelihood, so that a second one is not just missed.
        let near = least * (1.0 + 3.0 * t * t / freedom);
        let best = squares.iter().position(|of| *of <= least).unwrap_or(0);
        // How far one can go from the best without leaving what is below a limit.
        let reach = |limit: f64| {
            let before = (0..best).rev().find(|i| squares[*i] > limit);
            let after = (best..squares.len()).find(|i| squares[*i] > limit);
            [before, after]
        };
        let [from, to] = reach(near).map(|of| of.map(|i| offsets[i]));
        let is_near = |offset: &f64| {
            from.is_none_or(|from| *offset > from) && to.is_none_or(|to| *offset < to)
        };
        let mut tried = offsets.iter().zip(*squares);
        let other = tried.find(|(offset, of)| **of <= near && !is_near(offset));
        if let Some((other, _)) = other {
            return Err(ClockOffsetError::Several { between: [offsets[best], *other] });
        }
        match reach(limit) {
            [Some(before), Some(after)] => {
                // On the straight line between two offsets.
                let crossing = |inside: usize, outside: usize| {
                    let share = (limit - squares[inside]) / (squares[outside] - squares[inside]);
                    offsets[inside] + share * (offsets[outside] - offsets[inside])
                };
                let interval_s = [crossing(before + 1, before), crossing(after - 1, after)];
                Ok((ClockOffset { offset_s: offsets[best], interval_s }, [before, after]))
            }
            [None, None] => {
                let ends = [offsets.first(), offsets.last()];
                let interval_s = ends.map(|end| end.copied().unwrap_or(f64::NAN));
                Err(ClockOffsetError::Wide { interval_s, turn_deg: f64::INFINITY })
            }
            _ => Err(ClockOffsetError::AtTheEnd { offset_s: offsets[best] }),
        }
    }
}

/// Turn of an antenna between two of the offsets, the rms over the pulses, in radians.
fn turn(groups: &[Group], [from, to]: [usize; 2]) -> f64 {
    let turned = groups.iter().flatten().filter_map(|(_, boresights)| {
        let path = boresights.get(from..=to)?.windows(2);
        let steps = path.map(|pair| foxhunt_core::angle::distance(pair[0], pair[1]).abs());
        Some(steps.sum::<f64>())
    });
    let (count, squares) = turned.fold((0.0, 0.0), |(n, sum), turn| (n + 1.0, sum + turn * turn));
    f64::sqrt(squares / f64::max(count, 1.0))
}

/// The sum of squares that the best pattern leaves of levels, by their boresights at one of the
/// offsets.
fn unexplained(group: &Group, place: usize) -> f64 {
    let levels: Vec<f64> = group.iter().map(|(level, _)| *level).collect();
    let boresights: Vec<f64> = group.iter().map(|(_, of)| of[place]).collect();
    unexplained_by_harmonics(&levels, &boresights)
}

impl Recording {
    /// Compares the clocks of a recording and of the rover's path that it was read with, by the
    /// levels of the named beacon, or else of the beacon with most levels. `None` for a recording
    /// without places on Earth or without such levels, and for one with bearings or boresights,
    /// whose antenna turns.
    #[must_use]
    pub fn compare_clocks(
        &self,
        rover: &Rover,
        beacon: Option<&str>,
        search: &ClockSearch,
    ) -> Option<Clocks> {
        let frame = self.frame?;
        let mut beacons: BTreeMap<Option<&str>, Vec<HeardLevel>> = BTreeMap::new();
        for record in self.records() {
            if record.boresight.is_some() || record.bearing.is_some() {
                return None;
            }
            let own = record.beacon.as_deref();
            if beacon.is_some() && own != beacon {
                continue;
            }
            let Some((time_s, level_db)) = record.time.zip(record.rss_dbm) else { continue };
            beacons.entry(own).or_default().push(HeardLevel { time_s, level_db });
        }
        // The first of several with as many.
        let mut heard: Vec<HeardLevel> = Vec::new();
        for levels in beacons.into_values() {
            if levels.len() > heard.len() {
                heard = levels;
            }
        }
        if heard.is_empty() {
            return None;
        }
        heard.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        let place = |time_s: f64| Some(frame.to_local(&rover.place(time_s)?));
        Some(search.compare(&heard, &place))
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
    use rand_distr::StandardNormal;

    use super::*;

    /// Motion of an antenna: an even turn, or one at a changing speed, in degrees.
    #[derive(Clone, Copy)]
    enum Turning {
        Even,
        Uneven,
    }

    impl Turning {
        fn boresight(self, time: f64) -> f64 {
            let swing = match self {
                Self::Even => 0.0,
                Self::Uneven => 70.0 * (0.31 * time).sin(),
            };
            (24.0 * time + swing).rem_euclid(360.0)
        }

        /// Poses ten times a second for six minutes at three places.
        fn poses(self) -> PoseLog {
            let mut csv = String::from("time_s,east_m,north_m,boresight_deg_compass\n");
            for i in 0..3600 {
                let time = 0.1 * f64::from(i);
                let east = 50 * (i / 1200);
                csv += &format!("{time},{east},0,{}\n", self.boresight(time));
            }
            PoseLog::parse(csv.as_bytes(), "poses.csv").expect("poses")
        }

        /// A pulse each 1.3 s with a noise of 1 dB, the tag in another direction from each place.
        fn levels(self, offset: f64, random: &mut Xoshiro256PlusPlus) -> Vec<TimedLevel> {
            let level = |i| {
                let time = 6.0 + 1.3 * f64::from(i);
                let bearing = 77.0 + 30.0 * (time / 120.0).floor();
                let off = (self.boresight(time) - bearing).to_radians();
                let noise: f64 = random.sample(StandardNormal);
                TimedLevel {
                    time_s: time - offset,
                    level_db: -60.0 + 7.0 * off.cos() + 2.0 * (2.0 * off).cos() + noise,
                    beacon: None,
                }
            };
            (0..268).map(level).collect()
        }
    }

    /// 200 flights of seed 18: 190 intervals of 95 % hold the offset; 3 σ are 9.2. None is
    /// refused.
    #[test]
    fn intervals_hold_the_offset() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(18);
        let log = Turning::Uneven.poses();
        let mut held = 0;
        for _ in 0..200 {
            let offset = random.random_range(-1.5..1.5);
            let levels = Turning::Uneven.levels(offset, &mut random);
            let found = log.clock_offset(&levels, [0.0, 2.0], 0.5).expect("found");
            let [from, to] = found.interval_s;
            assert!((from..=to).contains(&found.offset_s), "{found:?}");
            held += u32::from((from..=to).contains(&offset));
        }
        assert!((181..=199).contains(&held), "{held} of 200");
    }

    #[test]
    fn what_does_not_follow_is_refused() {
        use ClockOffsetError as E;
        let mut random = Xoshiro256PlusPlus::seed_from_u64(19);
        let [even, uneven] = [Turning::Even, Turning::Uneven].map(Turning::poses);
        for _ in 0..20 {
            // One that turns evenly fits at every offset with another bearing.
            let levels = Turning::Even.levels(0.5, &mut random);
            let error = even.clock_offset(&levels, [0.0, 5.0], 0.5);
            assert!(matches!(error, Err(E::Wide { .. } | E::Several { .. })), "{error:?}");
            // So does one without a pattern.
            let mut flat = Turning::Uneven.levels(0.5, &mut random);
            flat.iter_mut().for_each(|of| of.level_db = random.sample(StandardNormal));
            let error = uneven.clock_offset(&flat, [0.0, 5.0], 0.5);
            assert!(error.is_err(), "{error:?}");
        }
        let levels = Turning::Uneven.levels(6.5, &mut random);
        let error = uneven.clock_offset(&levels, [0.0, 5.0], 0.5);
        assert!(error.is_err(), "beyond the range: {error:?}");
        let few: Vec<_> = levels.iter().take(23).cloned().collect();
        let error = uneven.clock_offset(&few, [6.0, 1.0], 0.5);
        assert!(matches!(error, Err(E::Few { levels: 21..=23 })), "{error:?}");
        for within in [f64::NAN, 0.0, -1.0, 1e9] {
            let error = uneven.clock_offset(&levels, [0.0, within], 0.5);
            assert!(matches!(error, Err(E::Range { .. })), "{error:?}");
        }
        let still = "time_s,east_m,north_m,boresight_deg_compass\n0,0,0,5\n400,0,0,5\n";
        let still = PoseLog::parse(still.as_bytes(), "poses.csv").expect("poses");
        assert_eq!(still.clock_offset(&levels, [0.0, 5.0], 500.0), Err(E::Still));
    }

    /// A receiver on its way has another bearing at each pulse.
    #[test]
    fn pulses_on_the_way_do_not_count() {
        let mut random = Xoshiro256PlusPlus::seed_from_u64(20);
        let mut csv = String::from("time_s,east_m,north_m,boresight_deg_compass\n");
        for i in 0..3600 {
            let time = 0.1 * f64::from(i);
            csv += &format!("{time},{time},0,{}\n", Turning::Uneven.boresight(time));
        }
        let log = PoseLog::parse(csv.as_bytes(), "poses.csv").expect("poses");
        let levels = Turning::Uneven.levels(0.0, &mut random);
        let error = log.clock_offset(&levels, [0.0, 1.0], 0.5);
        assert!(matches!(error, Err(ClockOffsetError::Few { .. })), "{error:?}");
    }
}
