//! Bursts of coded tags, by the gaps between their pulses.

use super::{AssociationConfig, KnownTag};
use crate::Pulse;

/// One burst: its pulses, and the misfit of its gaps to the tag's.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Burst {
    pub(super) pulses: Vec<usize>,
    /// The sum of the squares of the gaps' errors, in s².
    pub(super) misfit: f64,
}

/// All bursts of a tag among pulses in the order of their beginnings. No two share a pulse: the
/// better of those that would is taken.
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
