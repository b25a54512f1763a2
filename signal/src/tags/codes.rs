//! Coded tags: bursts by the gaps between their pulses, and codes that stand in no table, by gaps
//! that come again.

use std::collections::BTreeMap;

use super::{AssociationConfig, KnownTag, transform::count};
use crate::Pulse;

/// The longest gap within a burst, in seconds.
const LONGEST_GAP_S: f64 = 0.1;

/// The most pulses after one that are tried as its next.
const NEXT: usize = 8;

/// The least number of bursts.
const FEWEST: usize = 5;

/// The most patterns of gaps that are tried, the most frequent first.
const TRIED: usize = 50;

/// The most intervals of one pattern that are tried.
const INTERVALS: usize = 40;

/// The most pulses of a burst.
const LONGEST: usize = 8;

/// The largest drift of an interval between bursts, as a share.
const DRIFT: f64 = 2e-4;

/// One burst: its pulses, and the misfit of its gaps to the tag's.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Burst {
    pub pulses: Vec<usize>,
    /// The sum of the squares of the gaps' errors, in s².
    pub misfit: f64,
}

struct Search<'a> {
    pulses: &'a [Pulse],
    tag: &'a KnownTag,
    config: &'a AssociationConfig,
}

impl Search<'_> {
    /// Every way in which a burst that has begun goes on.
    fn extend(&self, burst: &mut Vec<usize>, misfit: f64, found: &mut Vec<Burst>) {
        let first = burst[0];
        let last = burst[burst.len() - 1];
        let Some(gap) = self.tag.gaps_s.get(burst.len() - 1) else {
            let long = self.pulses[last].time_s - self.pulses[first].time_s;
            if (long - self.tag.burst_s()).abs() <= self.config.burst_tolerance_s {
                found.push(Burst { pulses: burst.clone(), misfit });
            }
            return;
        };
        let begin = self.pulses[last].time_s;
        for next in last + 1..self.pulses.len() {
            let error = self.pulses[next].time_s - begin - gap;
            if error > self.config.gap_tolerance_s {
                break;
            }
            if error < -self.config.gap_tolerance_s || !self.is_alike(burst, next) {
                continue;
            }
            burst.push(next);
            self.extend(burst, misfit + error * error, found);
            burst.pop();
        }
    }

    /// Returns true if the frequencies, with the next one, lie near enough together.
    fn is_alike(&self, burst: &[usize], next: usize) -> bool {
        let frequency = |index: usize| self.pulses[index].frequency_hz;
        let spread = burst.iter().map(|index| (frequency(*index) - frequency(next)).abs());
        spread.fold(0.0, f64::max) <= self.config.burst_spread_hz
    }
}

/// The bursts of one tag: gaps that come again, at an interval.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Coded {
    pub interval_s: f64,
    gaps_s: Vec<f64>,
    pub bursts: Vec<Vec<usize>>,
}

/// Three pulses that may begin a burst.
#[derive(Debug, Clone, Copy)]
struct Triple {
    first: usize,
    gaps_s: [f64; 2],
}

/// Returns all bursts of a tag among pulses in the order of their beginnings. No two share a pulse:
/// of bursts that would, the better one is taken.
pub(super) fn bursts(pulses: &[Pulse], tag: &KnownTag, config: &AssociationConfig) -> Vec<Burst> {
    let near = |pulse: &Pulse| {
        tag.frequency_hz.is_none_or(|f| {
            let reach = config.burst_spread_hz.max(5.0 * config.frequency_tolerance_hz);
            (pulse.frequency_hz - f).abs() <= reach
        })
    };
    let mut found = Vec::new();
    for first in 0..pulses.len() {
        if near(&pulses[first]) {
            let search = Search { pulses, tag, config };
            search.extend(&mut vec![first], 0.0, &mut found);
        }
    }
    found.sort_by(|a, b| a.misfit.total_cmp(&b.misfit));
    let mut taken = vec![false; pulses.len()];
    found.retain(|burst| {
        let free = burst.pulses.iter().all(|index| !taken[*index]);
        if free {
            burst.pulses.iter().for_each(|index| taken[*index] = true);
        }
        free
    });
    found.sort_by_key(|burst| burst.pulses[0]);
    found
}

/// The tag whose bursts stand out most among the free pulses, which are in the order of their
/// beginnings; `None` if chance gives one as clear more often than `false_tags`.
///
/// Triples of pulses with the same two gaps are gathered, triples that come again at one interval
/// are a tag's, and what most of them have before or behind belongs to the burst.
pub(super) fn unknown_code(
    pulses: &[Pulse],
    free: &[bool],
    config: &AssociationConfig,
) -> Option<Coded> {
    let cell = 2.0 * config.gap_tolerance_s;
    let mut cells: BTreeMap<[i64; 2], Vec<Triple>> = BTreeMap::new();
    for triple in triples(pulses, free, config) {
        #[expect(clippy::cast_possible_truncation, reason = "gaps are limited")]
        let key = triple.gaps_s.map(|gap| (gap / cell).round() as i64);
        cells.entry(key).or_default().push(triple);
    }
    let about = |[a, b]: &[i64; 2]| -> Vec<Triple> {
        let near = (a - 1..=a + 1).flat_map(|a| (b - 1..=b + 1).map(move |b| [a, b]));
        near.filter_map(|key| cells.get(&key)).flatten().copied().collect()
    };
    let mut patterns: Vec<Vec<Triple>> = cells.keys().map(about).collect();
    patterns.retain(|pattern| pattern.len() >= FEWEST);
    let tried = count(patterns.len());
    patterns.sort_by_key(|pattern| std::cmp::Reverse(pattern.len()));
    patterns.truncate(TRIED);
    let all = patterns.iter().filter_map(|pattern| chain(pulses, pattern, tried, config));
    let (_, interval_s, firsts, gaps_s) = all.min_by(|a, b| a.0.total_cmp(&b.0))?;
    let gaps_s = whole_burst(pulses, free, &firsts, gaps_s, config);
    let held: Vec<usize> = (0..pulses.len()).filter(|index| free[*index]).collect();
    let open: Vec<Pulse> = held.iter().map(|index| pulses[*index]).collect();
    let frequency = median(firsts.iter().map(|first| pulses[*first].frequency_hz).collect());
    let code =
        KnownTag::new("", interval_s).with_gaps_s(gaps_s.clone()).with_frequency_hz(frequency);
    let found: Vec<Burst> = bursts(&open, &code, config);
    let begins: Vec<f64> = found.iter().map(|burst| open[burst.pulses[0]].time_s).collect();
    let kept = longest(&begins, interval_s, config);
    let bursts: Vec<Vec<usize>> = kept
        .iter()
        .map(|place| found[*place].pulses.iter().map(|index| held[*index]).collect())
        .collect();
    (bursts.len() >= FEWEST).then_some(Coded { interval_s, gaps_s, bursts })
}

/// All triples with the gaps and frequencies that a burst may have.
fn triples(pulses: &[Pulse], free: &[bool], config: &AssociationConfig) -> Vec<Triple> {
    let mut all = Vec::new();
    let next = |from: usize| {
        let least = (2.0 * pulses[from].width_s).max(3.0 * config.gap_tolerance_s);
        let gap = move |index: usize| pulses[index].time_s - pulses[from].time_s;
        let near = (from + 1..pulses.len()).take_while(move |index| gap(*index) <= LONGEST_GAP_S);
        let alike = move |index: &usize| {
            let off = pulses[*index].frequency_hz - pulses[from].frequency_hz;
            free[*index] && gap(*index) >= least && off.abs() <= config.burst_spread_hz
        };
        near.filter(alike).take(NEXT).map(move |index| (index, gap(index)))
    };
    for first in (0..pulses.len()).filter(|first| free[*first]) {
        for (second, one) in next(first) {
            all.extend(next(second).map(|(_, other)| Triple { first, gaps_s: [one, other] }));
        }
    }
    all
}

/// The triples of one pattern that come at one interval: the logarithm of how often chance gives a
/// chain as clear, the interval, the first pulses and the gaps.
fn chain(
    pulses: &[Pulse],
    pattern: &[Triple],
    tried: f64,
    config: &AssociationConfig,
) -> Option<(f64, f64, Vec<usize>, Vec<f64>)> {
    let gaps = [0, 1].map(|n| median(pattern.iter().map(|triple| triple.gaps_s[n]).collect()));
    let frequency = median(pattern.iter().map(|t| pulses[t.first].frequency_hz).collect());
    let mut firsts: Vec<usize> = pattern
        .iter()
        .filter(|triple| {
            let off = pulses[triple.first].frequency_hz - frequency;
            let near = |n: usize| (triple.gaps_s[n] - gaps[n]).abs() <= config.gap_tolerance_s;
            near(0) && near(1) && off.abs() <= config.burst_spread_hz
        })
        .map(|triple| triple.first)
        .collect();
    firsts.sort_unstable();
    firsts.dedup();
    if firsts.len() < FEWEST {
        return None;
    }
    let begins: Vec<f64> = firsts.iter().map(|first| pulses[*first].time_s).collect();
    let span_s = begins[begins.len() - 1] - begins[0];
    let least_s = 2.0 * (gaps[0] + gaps[1]);
    let mut intervals: Vec<f64> = begins.windows(2).map(|pair| pair[1] - pair[0]).collect();
    intervals.retain(|interval| *interval >= least_s);
    intervals.sort_by(f64::total_cmp);
    intervals.dedup_by(|a, b| (*a - *b).abs() < config.burst_tolerance_s);
    intervals.truncate(INTERVALS);
    let rate = count(firsts.len()) / span_s.max(least_s);
    let trials = (tried * count(intervals.len()) * count(firsts.len())).ln();
    let weighed = intervals.iter().map(|interval| {
        let kept = longest(&begins, *interval, config);
        let links = kept.windows(2).map(|pair| {
            let gap = begins[pair[1]] - begins[pair[0]];
            // That one of so many comes in a window after each interval until then.
            let windows = (gap / interval).round() * 2.0 * tolerance(gap, config);
            (-(-rate * windows).exp_m1()).ln()
        });
        (trials + links.sum::<f64>(), *interval, kept)
    });
    let (ln_chance, interval, kept) = weighed.min_by(|a, b| a.0.total_cmp(&b.0))?;
    if kept.len() < FEWEST || ln_chance > config.false_tags.ln() {
        return None;
    }
    let each = kept.windows(2).map(|pair| {
        let gap = begins[pair[1]] - begins[pair[0]];
        gap / (gap / interval).round().max(1.0)
    });
    let interval = median(each.collect());
    Some((ln_chance, interval, kept.iter().map(|place| firsts[*place]).collect(), gaps.to_vec()))
}

/// The most by which a burst may be off its time, `gap_s` after another one.
fn tolerance(gap_s: f64, config: &AssociationConfig) -> f64 {
    config.burst_tolerance_s + DRIFT * gap_s
}

/// The places of the longest chain of times that are intervals apart.
fn longest(times: &[f64], interval_s: f64, config: &AssociationConfig) -> Vec<usize> {
    let away = f64::from(config.max_missed) + 1.0;
    let mut best: Vec<(usize, Option<usize>)> = Vec::with_capacity(times.len());
    for (place, time) in times.iter().enumerate() {
        let mut own = (1, None);
        for before in (0..place).rev() {
            let gap = time - times[before];
            let intervals = (gap / interval_s).round();
            if intervals > away {
                break;
            }
            let off = (gap - intervals * interval_s).abs();
            if intervals >= 1.0 && off <= tolerance(gap, config) && best[before].0 + 1 > own.0 {
                own = (best[before].0 + 1, Some(before));
            }
        }
        best.push(own);
    }
    let mut at = (0..best.len()).max_by_key(|place| best[*place].0);
    let mut chain = Vec::new();
    while let Some(place) = at {
        chain.push(place);
        at = best[place].1;
    }
    chain.reverse();
    chain
}

/// The gaps of a whole burst, of which `gaps_s` are known: what most bursts have before, behind or
/// between.
fn whole_burst(
    pulses: &[Pulse],
    free: &[bool],
    firsts: &[usize],
    mut gaps_s: Vec<f64>,
    config: &AssociationConfig,
) -> Vec<f64> {
    let mut begins: Vec<f64> = firsts.iter().map(|first| pulses[*first].time_s).collect();
    let frequency = median(firsts.iter().map(|first| pulses[*first].frequency_hz).collect());
    let usual = |from_s: &[f64], sign: f64, longest_s: f64| -> Option<f64> {
        let mut gaps = Vec::new();
        for from in from_s {
            let (low, high) = if sign > 0.0 {
                (*from, from + LONGEST_GAP_S)
            } else {
                (from - LONGEST_GAP_S, *from)
            };
            // Beginnings are in order, and times nearly.
            let start = pulses.partition_point(|pulse| pulse.time_s < low - LONGEST_GAP_S);
            let near =
                (start..pulses.len()).take_while(|n| pulses[*n].time_s <= high + LONGEST_GAP_S);
            gaps.extend(near.filter(|n| free[*n]).filter_map(|n| {
                let gap = sign * (pulses[n].time_s - from);
                let least = (2.0 * pulses[n].width_s).max(3.0 * config.gap_tolerance_s);
                let alike = (pulses[n].frequency_hz - frequency).abs() <= config.burst_spread_hz;
                ((least..=longest_s).contains(&gap) && alike).then_some(gap)
            }));
        }
        gaps.sort_by(f64::total_cmp);
        let within = |gap: &f64| {
            let from = gaps.partition_point(|other| *other < gap - config.gap_tolerance_s);
            gaps.partition_point(|other| *other <= gap + config.gap_tolerance_s) - from
        };
        let best = gaps.iter().max_by_key(|gap| within(gap))?;
        (2 * within(best) > from_s.len()).then_some(*best)
    };
    while gaps_s.len() + 1 < LONGEST {
        let ends: Vec<f64> = begins.iter().map(|b| b + gaps_s.iter().sum::<f64>()).collect();
        let Some(gap) = usual(&ends, 1.0, LONGEST_GAP_S) else { break };
        gaps_s.push(gap);
    }
    while gaps_s.len() + 1 < LONGEST {
        let Some(gap) = usual(&begins, -1.0, LONGEST_GAP_S) else { break };
        gaps_s.insert(0, gap);
        begins.iter_mut().for_each(|begin| *begin -= gap);
    }
    let mut place = 0;
    while place < gaps_s.len() && gaps_s.len() + 1 < LONGEST {
        let before: f64 = gaps_s[..place].iter().sum();
        let from: Vec<f64> = begins.iter().map(|begin| begin + before).collect();
        // A pulse that is not the next one itself.
        match usual(&from, 1.0, gaps_s[place] - 3.0 * config.gap_tolerance_s) {
            Some(gap) => {
                gaps_s[place] -= gap;
                gaps_s.insert(place, gap);
            }
            None => place += 1,
        }
    }
    gaps_s
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bursts of a tag of three gaps, among pulses at these times and frequencies.
    fn found(pulses: &[(f64, f64)]) -> usize {
        let pulse = |&(time, frequency): &(f64, f64)| Pulse::new(time, frequency, 2e-3, 0.0, 9.0);
        let pulses: Vec<Pulse> = pulses.iter().map(pulse).collect();
        let tag = KnownTag::new("swift", 20.0).with_gaps_s(vec![0.022, 0.020, 0.024]);
        bursts(&pulses, &tag, &AssociationConfig::default()).len()
    }

    #[test]
    fn a_burst_keeps_every_tolerance() {
        let exact = [(1.0, 0.0), (1.022, 0.0), (1.042, 0.0), (1.066, 0.0)];
        let with = |index: usize, time: f64, frequency: f64| {
            let mut pulses = exact;
            pulses[index] = (time, frequency);
            pulses
        };
        assert_eq!(found(&exact), 1);
        // 1.4 and 1.6 ms of one gap, the next one still within; 0.4 and 0.6 kHz.
        assert_eq!(found(&with(3, 1.0674, 0.0)), 1);
        assert_eq!(found(&with(3, 1.0676, 0.0)), 0);
        assert_eq!(found(&with(2, 1.042, 400.0)), 1);
        assert_eq!(found(&with(2, 1.042, 600.0)), 0);
        // Each gap within its own, the burst 4.2 ms too long.
        assert_eq!(found(&[(1.0, 0.0), (1.0234, 0.0), (1.0448, 0.0), (1.0702, 0.0)]), 0);
        // A second pulse beside the last one makes no second burst.
        let mut double = exact.to_vec();
        double.push((1.0664, 0.0));
        assert_eq!(found(&double), 1);
    }
}
