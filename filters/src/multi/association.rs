//! Probabilities that tracks made observations, over all joint associations.

use alloc::{collections::BTreeMap, vec, vec::Vec};

use nalgebra::DMatrix;

/// Largest number of states of one exact sum; beyond it a group of tracks is summed by loopy belief
/// propagation.
const MOST_STATES: usize = 1 << 14;

/// Largest number of rounds of loopy belief propagation.
const MOST_ROUNDS: usize = 300;

/// Change of a message below which loopy belief propagation ends.
const SETTLED: f64 = 1e-9;

/// Largest number of tracks of a region that is summed exactly within loopy belief propagation. Two
/// tracks that both surely made one of the same two observations are off by up to 0.4 by
/// propagation alone.
const REGION: usize = 5;

/// Largest number of states of the exact sum over a region; it has fewer tracks beyond it.
const REGION_STATES: usize = 1 << 10;

/// Probabilities that each track made each observation of a scan.
#[derive(Clone, Debug, PartialEq)]
pub struct Associations {
    /// Row: track; column 0: no observation, column j + 1: observation j.
    probabilities: DMatrix<f64>,
    exact: bool,
}

impl Associations {
    /// Sums over all joint associations in which each observation has at most one track.
    ///
    /// `weights` has a row for each track. Column 0 is the weight of a track without an
    /// observation, which is positive; column j + 1 is the weight of a track that made observation
    /// j, over the intensity of clutter there. A joint association weighs the product over tracks.
    pub(super) fn of_weights(weights: &DMatrix<f64>) -> Self {
        let mut probabilities = DMatrix::zeros(weights.nrows(), weights.ncols());
        let mut exact = true;
        for group in groups(weights) {
            let scaled = Group::new(weights, &group);
            let rows = scaled.exact(MOST_STATES).unwrap_or_else(|| {
                exact = false;
                scaled.propagated()
            });
            for (track, row) in group.iter().zip(rows) {
                for (column, probability) in row {
                    probabilities[(*track, column)] = probability;
                }
            }
        }
        Self { probabilities, exact }
    }

    /// Probability that a track made an observation, both counted from 0; 0 for a pair that does
    /// not exist.
    #[must_use]
    pub fn of(&self, track: usize, observation: usize) -> f64 {
        self.probabilities.get((track, observation + 1)).copied().unwrap_or(0.0)
    }

    /// Probability that a track made no observation of the scan; 0 for a track that does not exist.
    #[must_use]
    pub fn missed(&self, track: usize) -> f64 {
        self.probabilities.get((track, 0)).copied().unwrap_or(0.0)
    }

    /// Probability that an observation is clutter or an unknown transmitter's: no track made it.
    #[must_use]
    pub fn clutter(&self, observation: usize) -> f64 {
        let by_tracks: f64 = (0..self.tracks()).map(|track| self.of(track, observation)).sum();
        (1.0 - by_tracks).max(0.0)
    }

    /// Number of tracks.
    #[must_use]
    pub fn tracks(&self) -> usize {
        self.probabilities.nrows()
    }

    /// Number of observations.
    #[must_use]
    pub fn observations(&self) -> usize {
        self.probabilities.ncols().saturating_sub(1)
    }

    /// Returns true if every probability is exact. A group of very many tracks that compete for the
    /// same observations is approximated by loopy belief propagation (Williams & Lau 2014) beyond
    /// the closest of them.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        self.exact
    }
}

/// The tracks in groups that share no observation.
fn groups(weights: &DMatrix<f64>) -> Vec<Vec<usize>> {
    let mut group_of: Vec<usize> = (0..weights.nrows()).collect();
    for column in 1..weights.ncols() {
        let sharing: Vec<usize> =
            (0..weights.nrows()).filter(|track| weights[(*track, column)] > 0.0).collect();
        if let [first, others @ ..] = &sharing[..] {
            for other in others {
                let from = group_of[*other];
                let to = group_of[*first];
                group_of.iter_mut().filter(|group| **group == from).for_each(|group| *group = to);
            }
        }
    }
    let mut members: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (track, group) in group_of.into_iter().enumerate() {
        members.entry(group).or_default().push(track);
    }
    members.into_values().collect()
}

/// Tracks that compete for observations.
struct Group {
    tracks: Vec<Row>,
    /// Number of different observations.
    observations: usize,
}

/// Weights of one track, the largest of them 1.
#[derive(Clone)]
struct Row {
    missed: f64,
    candidates: Vec<Candidate>,
}

/// An observation that a track may have made.
#[derive(Clone)]
struct Candidate {
    /// Column of the weights.
    column: usize,
    /// Number of the observation within the group.
    local: usize,
    weight: f64,
}

/// The probability of each column that a track may have.
type Probabilities = Vec<(usize, f64)>;

impl Group {
    fn new(weights: &DMatrix<f64>, members: &[usize]) -> Self {
        let row = |track: &usize| {
            // A product over many tracks of unscaled weights overflows.
            let scale = weights.row(*track).max();
            let wanted = (1..weights.ncols()).filter(|c| weights[(*track, *c)] > 0.0);
            let candidates = wanted.map(|column| Candidate {
                column,
                local: 0,
                weight: weights[(*track, column)] / scale,
            });
            Row { missed: weights[(*track, 0)] / scale, candidates: candidates.collect() }
        };
        Self::of_rows(members.iter().map(row).collect())
    }

    /// Numbers the observations that the tracks want.
    fn of_rows(mut tracks: Vec<Row>) -> Self {
        let mut local: BTreeMap<usize, usize> = BTreeMap::new();
        for candidate in tracks.iter_mut().flat_map(|row| &mut row.candidates) {
            let next = local.len();
            candidate.local = *local.entry(candidate.column).or_insert(next);
        }
        Self { tracks, observations: local.len() }
    }

    /// The exact probabilities. The sum runs over the tracks; its state is the set of taken
    /// observations that a later track may still want (Horridge & Maskell 2006). `None` where there
    /// are more states than `most_states`, or the sum underflows.
    fn exact(&self, most_states: usize) -> Option<Vec<Probabilities>> {
        if self.observations > 128 {
            return None;
        }
        let count = self.tracks.len();
        let bit = |candidate: &Candidate| 1_u128 << candidate.local;
        let mut later = vec![0_u128; count + 1];
        for (track, row) in self.tracks.iter().enumerate().rev() {
            later[track] = row.candidates.iter().map(bit).fold(later[track + 1], |a, b| a | b);
        }
        let mut forward: Vec<BTreeMap<u128, f64>> = vec![BTreeMap::from([(0, 1.0)])];
        for (row, wanted) in self.tracks.iter().zip(&later[1..]) {
            let mut next = BTreeMap::new();
            for (taken, sum) in forward.last()? {
                *next.entry(taken & wanted).or_insert(0.0) += sum * row.missed;
                for candidate in row.candidates.iter().filter(|c| taken & bit(c) == 0) {
                    let taken = (taken | bit(candidate)) & wanted;
                    *next.entry(taken).or_insert(0.0) += sum * candidate.weight;
                }
            }
            if next.len() > most_states {
                return None;
            }
            forward.push(next);
        }
        let mut backward: BTreeMap<u128, f64> = BTreeMap::from([(0, 1.0)]);
        let mut probabilities = Vec::with_capacity(count);
        for (track, row) in self.tracks.iter().enumerate().rev() {
            let wanted = later[track + 1];
            let rest = |taken: u128| backward.get(&(taken & wanted)).copied().unwrap_or(0.0);
            let mut sums = vec![0.0; row.candidates.len() + 1];
            let mut before = BTreeMap::new();
            for (taken, ahead) in &forward[track] {
                let missed = row.missed * rest(*taken);
                let mut all = missed;
                sums[0] += ahead * missed;
                for (candidate, sum) in row.candidates.iter().zip(&mut sums[1..]) {
                    if taken & bit(candidate) == 0 {
                        let made = candidate.weight * rest(taken | bit(candidate));
                        all += made;
                        *sum += ahead * made;
                    }
                }
                before.insert(*taken, all);
            }
            backward = before;
            let total: f64 = sums.iter().sum();
            if total < f64::MIN_POSITIVE {
                return None;
            }
            let columns = core::iter::once(0).chain(row.candidates.iter().map(|c| c.column));
            probabilities.push(columns.zip(sums.iter().map(|sum| sum / total)).collect());
        }
        probabilities.reverse();
        Some(probabilities)
    }

    /// Approximate probabilities: each track with its closest competitors exactly, all others by
    /// the messages of loopy belief propagation.
    fn propagated(&self) -> Vec<Probabilities> {
        let Messages { sent, beliefs } = self.messages();
        let exact = |(track, belief): (usize, &Probabilities)| {
            let mut region = self.region(track, &beliefs);
            while region.len() > 1 {
                let exact = self.within(&region, &sent).exact(REGION_STATES);
                if let Some(first) = exact.and_then(|rows| rows.into_iter().next()) {
                    return first;
                }
                region.pop();
            }
            belief.clone()
        };
        beliefs.iter().enumerate().map(exact).collect()
    }

    /// Some of the tracks; an observation that they leave may be of a track that is not among them.
    fn within(&self, region: &[usize], sent: &[Vec<f64>]) -> Self {
        let mut outside = vec![0.0; self.observations];
        let rows = self.tracks.iter().zip(sent).enumerate();
        for (_, (row, sent)) in rows.filter(|(track, _)| !region.contains(track)) {
            add(&mut outside, row, sent);
        }
        let mut tracks: Vec<Row> =
            region.iter().map(|member| self.tracks[*member].clone()).collect();
        for candidate in tracks.iter_mut().flat_map(|row| &mut row.candidates) {
            candidate.weight /= 1.0 + outside[candidate.local];
        }
        Self::of_rows(tracks)
    }

    /// Numbers of a track and of the tracks that most likely want the same observations.
    fn region(&self, track: usize, beliefs: &[Probabilities]) -> Vec<usize> {
        let made = |track: usize| beliefs[track].iter().skip(1).map(|(_, made)| *made);
        let mut wanted = vec![0.0; self.observations];
        let mut members = vec![track];
        while members.len() < REGION.min(self.tracks.len()) {
            let last = members.last().copied().unwrap_or(track);
            add(&mut wanted, &self.tracks[last], &made(last).collect::<Vec<_>>());
            let contest = |other: &usize| -> f64 {
                let candidates = self.tracks[*other].candidates.iter();
                candidates.zip(made(*other)).map(|(c, made)| wanted[c.local] * made).sum()
            };
            let others = (0..self.tracks.len()).filter(|other| !members.contains(other));
            let Some(closest) = others.max_by(|a, b| contest(a).total_cmp(&contest(b))) else {
                break;
            };
            members.push(closest);
        }
        members
    }

    /// Messages of loopy belief propagation (Williams & Lau 2014, fig. 2).
    fn messages(&self) -> Messages {
        // Weights over that of a missed track, which is positive.
        let ratio = |row: &Row, c: &Candidate| c.weight / row.missed.max(f64::MIN_POSITIVE);
        let mut from_observation: Vec<Vec<f64>> =
            self.tracks.iter().map(|row| vec![1.0; row.candidates.len()]).collect();
        let mut from_track = from_observation.clone();
        for _ in 0..MOST_ROUNDS {
            let mut sums = vec![1.0; self.observations];
            for ((row, own), out) in self.tracks.iter().zip(&from_observation).zip(&mut from_track)
            {
                let wants: Vec<f64> =
                    row.candidates.iter().zip(own).map(|(c, m)| ratio(row, c) * m).collect();
                let all: f64 = 1.0 + wants.iter().sum::<f64>();
                for ((candidate, want), out) in row.candidates.iter().zip(&wants).zip(&mut *out) {
                    *out = ratio(row, candidate) / (all - want).max(1.0);
                }
                add(&mut sums, row, out);
            }
            let mut change = 0.0_f64;
            for ((row, sent), out) in self.tracks.iter().zip(&from_track).zip(&mut from_observation)
            {
                for ((candidate, sent), out) in row.candidates.iter().zip(sent).zip(out) {
                    let next = 1.0 / (sums[candidate.local] - sent).max(1.0);
                    change = change.max((next - *out).abs());
                    *out = next;
                }
            }
            if change < SETTLED {
                break;
            }
        }
        let of_track = |(row, messages): (&Row, &Vec<f64>)| -> Probabilities {
            let wants = row.candidates.iter().zip(messages).map(|(c, m)| ratio(row, c) * m);
            let wants: Vec<f64> = wants.collect();
            let all: f64 = 1.0 + wants.iter().sum::<f64>();
            let columns = row.candidates.iter().map(|c| c.column).zip(&wants);
            let made = columns.map(|(column, want)| (column, want / all));
            core::iter::once((0, 1.0 / all)).chain(made).collect()
        };
        let beliefs = self.tracks.iter().zip(&from_observation).map(of_track).collect();
        Messages { sent: from_track, beliefs }
    }
}

/// Messages and beliefs at the end of loopy belief propagation.
struct Messages {
    /// Message of each track to each of its candidates: how much it wants it, to 1 of an
    /// observation that no track wants.
    sent: Vec<Vec<f64>>,
    beliefs: Vec<Probabilities>,
}

/// Adds a value for each candidate of a row to its observation.
fn add(sums: &mut [f64], row: &Row, values: &[f64]) {
    for (candidate, value) in row.candidates.iter().zip(values) {
        sums[candidate.local] += value;
    }
}

#[cfg(test)]
mod tests {
    use approx::abs_diff_eq;
    use proptest::prelude::*;

    use super::*;

    /// The probabilities by listing every joint association.
    fn by_enumeration(weights: &DMatrix<f64>) -> DMatrix<f64> {
        fn list(
            weights: &DMatrix<f64>,
            chosen: &mut Vec<usize>,
            weight: f64,
            sums: &mut DMatrix<f64>,
        ) {
            let track = chosen.len();
            if track == weights.nrows() {
                for (track, column) in chosen.iter().enumerate() {
                    sums[(track, *column)] += weight;
                }
                return;
            }
            for column in 0..weights.ncols() {
                if column == 0 || !chosen.contains(&column) {
                    chosen.push(column);
                    list(weights, chosen, weight * weights[(track, column)], sums);
                    chosen.pop();
                }
            }
        }
        let mut sums = DMatrix::zeros(weights.nrows(), weights.ncols());
        list(weights, &mut Vec::new(), 1.0, &mut sums);
        let total = if sums.nrows() > 0 { sums.row(0).sum() } else { 1.0 };
        sums / total
    }

    /// Weights of `most` tracks and observations or fewer.
    fn weights(most: usize) -> impl Strategy<Value = DMatrix<f64>> {
        let weight = prop_oneof![1 => Just(0.0), 2 => (-4.0..8.0_f64).prop_map(libm::exp)];
        let values = proptest::collection::vec(weight, most * (most + 1));
        (1..=most, 0..=most, values).prop_map(move |(tracks, observations, values)| {
            DMatrix::from_fn(tracks, observations + 1, |row, column| match column {
                0 => 0.05 + 0.1 * crate::count::number(row),
                _ => values[row * (most + 1) + column],
            })
        })
    }

    proptest! {
        #[test]
        fn exact_probabilities_are_those_of_all_joint_associations(weights in weights(4)) {
            let found = Associations::of_weights(&weights);
            prop_assert!(found.is_exact());
            let expected = by_enumeration(&weights);
            let off = (&found.probabilities - &expected).amax();
            prop_assert!(off < 1e-10, "{weights}{expected}{}", found.probabilities);
        }

        #[test]
        fn propagated_probabilities_are_close_and_sum_to_one(weights in weights(6)) {
            let expected = by_enumeration(&weights);
            for group in groups(&weights) {
                let rows = Group::new(&weights, &group).propagated();
                for (track, row) in group.iter().zip(rows) {
                    let sum: f64 = row.iter().map(|(_, p)| p).sum();
                    prop_assert!(abs_diff_eq!(sum, 1.0, epsilon = 1e-6));
                    for (column, p) in row {
                        // Propagation alone is off by up to 0.4.
                        let off = (p - expected[(*track, column)]).abs();
                        prop_assert!(off < 0.25, "{off} of track {track}\n{weights}{expected}");
                    }
                }
            }
        }
    }

    #[test]
    fn two_tracks_share_one_observation_by_their_weights() {
        let weights = DMatrix::from_row_slice(2, 2, &[1.0, 3.0, 1.0, 1.0]);
        let found = Associations::of_weights(&weights);
        // Joint associations: none 1, the first 3, the second 1.
        assert!(abs_diff_eq!(found.of(0, 0), 0.6, epsilon = 1e-15));
        assert!(abs_diff_eq!(found.of(1, 0), 0.2, epsilon = 1e-15));
        assert!(abs_diff_eq!(found.clutter(0), 0.2, epsilon = 1e-15));
        assert!(abs_diff_eq!(found.missed(0), 0.4, epsilon = 1e-15));
        assert_eq!((found.tracks(), found.observations()), (2, 1));
        assert!(abs_diff_eq!(found.of(5, 5), 0.0) && abs_diff_eq!(found.missed(9), 0.0));
    }

    #[test]
    fn weights_of_hundreds_of_powers_of_ten_do_not_overflow() {
        let weights = DMatrix::from_fn(12, 13, |row, column| match column {
            0 => 1.0,
            _ if column == row + 1 => 1e60,
            _ => 1e-60,
        });
        let found = Associations::of_weights(&weights);
        for track in 0..12 {
            assert!(found.of(track, track) > 0.999, "{track}");
        }
    }
}
