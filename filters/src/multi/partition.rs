//! Rows of several still transmitters, sorted into transmitters and clutter.

use alloc::{vec, vec::Vec};

use foxhunt_core::{
    elementary,
    parameter::{ParameterError, positive, require},
};
use rand::{Rng, RngExt};

use crate::{
    count::number,
    vectorised::{Dot, Kernel, run},
};

/// Largest number of transmitters.
const MOST_GROUPS: usize = 30;

/// Least ratio of likelihoods: its logarithm is finite.
const LEAST_RATIO: f64 = 1e-300;

/// Number of terms of the sum over the number of transmitters; the terms fall by half or faster.
const TERMS: usize = 80;

/// Sorts rows, each received from one of an unknown number of still transmitters or clutter, by
/// drawing from the posterior of all ways to sort them.
///
/// The prior is a mixture of finite mixtures (Miller & Harrison 2018): k transmitters with the
/// probability 2^−(k + 1), each equally likely to be anywhere in the area; their shares of the
/// rows are evenly distributed, as is the share of clutter. The draws are Gibbs sweeps over the
/// rows with places and shares summed out (Miller & Harrison 2018, §6).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sorting {
    /// Number of chains that begin from different orders of the rows; the most probable one goes
    /// on.
    pub chains: usize,
    /// Number of sweeps over all rows before the chains are compared.
    pub warm_up: usize,
    /// Number of sweeps that are kept.
    pub sweeps: usize,
}

impl Default for Sorting {
    /// 5 chains of 20 sweeps, the best of which goes on for 200.
    fn default() -> Self {
        Self { chains: 5, warm_up: 20, sweeps: 200 }
    }
}

/// Rows sorted into transmitters.
#[derive(Clone, Debug, PartialEq)]
pub struct Sorted {
    /// Transmitters of at least two rows, the most probable first.
    pub groups: Vec<Group>,
    /// Distribution of the number of transmitters of at least two rows: element n is the
    /// probability of n. A single row has no place, and may as well be clutter.
    pub numbers: Vec<f64>,
}

/// Rows that one transmitter made.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// Probability that a transmitter made most of the rows, and few others.
    pub existence: f64,
    /// Indices of the rows.
    pub rows: Vec<usize>,
    /// Probability for every row, including rows of other groups, that this transmitter made it.
    pub memberships: Vec<f64>,
}

impl Sorting {
    /// Sorts rows by their likelihoods.
    ///
    /// `ratios` has for each row its likelihood in each of some equally large cells of the area,
    /// over that of clutter.
    ///
    /// # Errors
    ///
    /// [`ParameterError`] when there are no sweeps, a row has not as many cells as the first, or a
    /// ratio is negative or not finite.
    pub fn sort(&self, ratios: &[Vec<f64>], rng: &mut dyn Rng) -> Result<Sorted, ParameterError> {
        positive("the number of chains", number(self.chains))?;
        positive("the number of sweeps", number(self.sweeps))?;
        let cells = ratios.first().map_or(0, Vec::len);
        for row in ratios {
            let right = row.len() == cells && cells > 0;
            require(right, "the cells of a row", number(row.len()), "as many as of the others")?;
            for ratio in row {
                let proper = *ratio >= 0.0 && ratio.is_finite();
                require(proper, "a ratio of likelihoods", *ratio, "zero or a positive number")?;
            }
        }
        let table = Table::new(ratios);
        let mut best: Option<(f64, Chain<'_>)> = None;
        for _ in 0..self.chains {
            let mut chain = Chain::new(&table);
            for row in shuffled(ratios.len(), rng) {
                chain.place(row, rng);
            }
            for _ in 0..self.warm_up {
                chain.sweep(rng);
            }
            let log = chain.log_probability();
            if best.as_ref().is_none_or(|(most, _)| log > *most) {
                best = Some((log, chain));
            }
        }
        let mut draws = Vec::with_capacity(self.sweeps);
        if let Some((_, mut chain)) = best {
            for _ in 0..self.sweeps {
                chain.sweep(rng);
                draws.push(chain.drawn());
            }
        }
        Ok(summarised(ratios.len(), &draws))
    }
}

/// Likelihoods of all rows, and the logarithms of prior probabilities.
struct Table<'a> {
    ratios: &'a [Vec<f64>],
    logs: Vec<Vec<f64>>,
    /// Mean over the cells of each row.
    means: Vec<f64>,
    /// ln Vₙ(t): of n rows that are no clutter in t groups.
    coefficients: Vec<Vec<f64>>,
}

impl<'a> Table<'a> {
    fn new(ratios: &'a [Vec<f64>]) -> Self {
        let log = |ratio: &f64| libm::log(ratio.max(LEAST_RATIO));
        let mean = |row: &Vec<f64>| row.iter().sum::<f64>() / number(row.len());
        let groups = ratios.len().min(MOST_GROUPS);
        let coefficients = (0..=ratios.len())
            .map(|rows| (0..=groups).map(|groups| log_coefficient(rows, groups)).collect());
        Self {
            ratios,
            logs: ratios.iter().map(|row| row.iter().map(log).collect()).collect(),
            means: ratios.iter().map(mean).collect(),
            coefficients: coefficients.collect(),
        }
    }

    /// ln Vₙ(t); −∞ for more groups than are looked for.
    fn coefficient(&self, rows: usize, groups: usize) -> f64 {
        let of_rows = self.coefficients.get(rows);
        of_rows.and_then(|of| of.get(groups)).copied().unwrap_or(f64::NEG_INFINITY)
    }
}

/// ln Σ_k k (k − 1) … (k − t + 1) / (k (k + 1) … (k + n − 1)) 2^−(k + 1) (Miller &
/// Harrison 2018, eq. 3.2 with γ = 1).
fn log_coefficient(rows: usize, groups: usize) -> f64 {
    if rows == 0 {
        return if groups == 0 { 0.0 } else { f64::NEG_INFINITY };
    }
    if groups == 0 || groups > rows {
        return f64::NEG_INFINITY;
    }
    let term = |k: usize| {
        libm::lgamma(number(k + 1)) - libm::lgamma(number(k - groups + 1)) + libm::lgamma(number(k))
            - libm::lgamma(number(k + rows))
            - number(k + 1) * core::f64::consts::LN_2
    };
    let terms: Vec<f64> = (groups..groups + TERMS).map(term).collect();
    let most = terms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    most + libm::log(terms.iter().map(|log| libm::exp(log - most)).sum())
}

/// One way to sort the rows.
struct Chain<'a> {
    table: &'a Table<'a>,
    /// Index of each row's group; `None` for clutter and for rows that are not placed yet.
    group_of: Vec<Option<usize>>,
    groups: Vec<Rows>,
    clutter: usize,
}

/// Rows of one transmitter.
#[derive(Clone)]
struct Rows {
    count: usize,
    /// Sum of the rows' logarithms in each cell.
    logs: Vec<f64>,
    /// Posterior of the place; sums to 1.
    posterior: Vec<f64>,
    /// Logarithm of the mean over the cells of the product of the rows.
    log_evidence: f64,
}

impl Rows {
    /// Works out posterior and evidence from the logarithms.
    fn refresh(&mut self) {
        let most = self.logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let total = run(Exponentials { logs: &self.logs, most, out: &mut self.posterior });
        self.posterior.iter_mut().for_each(|p| *p /= total);
        self.log_evidence = most + libm::log(total / number(self.logs.len()));
    }

    fn add(&mut self, logs: &[f64]) {
        self.count += 1;
        self.logs.iter_mut().zip(logs).for_each(|(sum, log)| *sum += log);
        self.refresh();
    }

    fn remove(&mut self, logs: &[f64]) {
        self.count -= 1;
        self.logs.iter_mut().zip(logs).for_each(|(sum, log)| *sum -= log);
        self.refresh();
    }
}

impl<'a> Chain<'a> {
    fn new(table: &'a Table<'a>) -> Self {
        let group_of = vec![None; table.ratios.len()];
        Self { table, group_of, groups: Vec::new(), clutter: 0 }
    }

    /// Number of rows that belong to a transmitter.
    fn rows(&self) -> usize {
        self.groups.iter().map(|group| group.count).sum()
    }

    /// Draws the group of a row that is in none, given all others.
    fn place(&mut self, row: usize, rng: &mut dyn Rng) {
        let rows = self.rows();
        let groups = self.groups.len();
        let table = self.table;
        let before = table.coefficient(rows, groups);
        let log_sound = libm::log(number(rows + 1));
        let joined = log_sound + table.coefficient(rows + 1, groups) - before;
        let mut weights: Vec<f64> = self
            .groups
            .iter()
            .map(|group| {
                let predicted = run(Dot(&group.posterior, &table.ratios[row]));
                libm::exp(joined) * number(group.count + 1) * predicted
            })
            .collect();
        let opened = log_sound + table.coefficient(rows + 1, groups + 1) - before;
        weights.push(libm::exp(opened) * table.means[row]);
        weights.push(number(self.clutter + 1));
        let chosen = drawn_from(&weights, rng);
        if chosen > groups {
            self.clutter += 1;
            return;
        }
        if chosen == groups {
            let cells = table.logs[row].len();
            self.groups.push(Rows {
                count: 0,
                logs: vec![0.0; cells],
                posterior: vec![0.0; cells],
                log_evidence: 0.0,
            });
        }
        self.groups[chosen].add(&table.logs[row]);
        self.group_of[row] = Some(chosen);
    }

    /// Draws the group of each row once more, one after the other.
    fn sweep(&mut self, rng: &mut dyn Rng) {
        for row in shuffled(self.group_of.len(), rng) {
            match self.group_of[row].take() {
                None => self.clutter -= 1,
                Some(group) if self.groups[group].count == 1 => {
                    self.groups.remove(group);
                    for other in self.group_of.iter_mut().flatten().filter(|o| **o > group) {
                        *other -= 1;
                    }
                }
                Some(group) => self.groups[group].remove(&self.table.logs[row]),
            }
            self.place(row, rng);
        }
    }

    /// Logarithm of the joint probability of rows and groups, up to a constant.
    fn log_probability(&self) -> f64 {
        let rows = self.rows();
        let share = libm::lgamma(number(rows + 1)) + libm::lgamma(number(self.clutter + 1));
        let of_group = |group: &Rows| group.log_evidence + libm::lgamma(number(group.count + 1));
        let groups: f64 = self.groups.iter().map(of_group).sum();
        self.table.coefficient(rows, self.groups.len()) + share + groups
    }

    /// The group of each row, and a list of the groups' sizes.
    fn drawn(&self) -> Draw {
        Draw {
            group_of: self.group_of.clone(),
            sizes: self.groups.iter().map(|group| group.count).collect(),
        }
    }
}

/// One way to sort the rows, as it was drawn.
struct Draw {
    group_of: Vec<Option<usize>>,
    sizes: Vec<usize>,
}

/// Puts exp(log − most) into `out` and returns the sum.
struct Exponentials<'a> {
    logs: &'a [f64],
    most: f64,
    out: &'a mut [f64],
}

impl Kernel for Exponentials<'_> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let Self { logs, most, out } = self;
        // Beyond −700 the exponential is no normal number.
        for (out, log) in out.iter_mut().zip(logs) {
            *out = elementary::exp((log - most).max(-700.0));
        }
        crate::vectorised::sum(out)
    }
}

/// Index drawn in proportion to weights.
fn drawn_from(weights: &[f64], rng: &mut dyn Rng) -> usize {
    let total: f64 = weights.iter().sum();
    let mut left = rng.random::<f64>() * total;
    for (index, weight) in weights.iter().enumerate() {
        left -= weight;
        if left < 0.0 {
            return index;
        }
    }
    weights.len() - 1
}

/// The numbers below `count` in a random order (Fisher & Yates).
fn shuffled(count: usize, rng: &mut dyn Rng) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    for last in (1..count).rev() {
        order.swap(last, rng.random_range(0..=last));
    }
    order
}

/// Summarises draws: the one that is closest to all in its pairs of rows of one transmitter (Dahl
/// 2006), and how often its groups were drawn.
fn summarised(rows: usize, draws: &[Draw]) -> Sorted {
    let all = number(draws.len());
    let mut numbers: Vec<f64> = Vec::new();
    let mut together = vec![0.0; rows * rows];
    for draw in draws {
        let count = draw.sizes.iter().filter(|size| **size > 1).count();
        if numbers.len() <= count {
            numbers.resize(count + 1, 0.0);
        }
        numbers[count] += 1.0 / all;
        for (pair, share) in together.iter_mut().enumerate() {
            *share += draw.joins(pair / rows, pair % rows) / all;
        }
    }
    let distance = |draw: &Draw| -> f64 {
        let off = |(pair, share): (usize, &f64)| draw.joins(pair / rows, pair % rows) - share;
        together.iter().enumerate().map(off).map(|off| off * off).sum()
    };
    let mut nearest: Option<(f64, &Draw)> = None;
    for draw in draws {
        let off = distance(draw);
        if nearest.is_none_or(|(least, _)| off < least) {
            nearest = Some((off, draw));
        }
    }
    let mut groups = Vec::new();
    if let Some((_, chosen)) = nearest {
        for group in (0..chosen.sizes.len()).filter(|group| chosen.sizes[*group] > 1) {
            let rows: Vec<usize> =
                (0..rows).filter(|row| chosen.group_of[*row] == Some(group)).collect();
            groups.push(frequency(rows, draws));
        }
    }
    groups.sort_by(|a, b| b.existence.total_cmp(&a.existence));
    Sorted { groups, numbers }
}

/// A group with the share of draws that have it: a group of more than half of these rows, more
/// than half of whose rows are among these.
fn frequency(rows: Vec<usize>, draws: &[Draw]) -> Group {
    let all = number(draws.len());
    let count = draws.first().map_or(0, |draw| draw.group_of.len());
    let mut memberships = vec![0.0; count];
    let mut existence = 0.0;
    for draw in draws {
        let mut shared = vec![0; draw.sizes.len()];
        rows.iter().filter_map(|row| draw.group_of[*row]).for_each(|group| shared[group] += 1);
        let same = |group: &usize| {
            2 * shared[*group] > rows.len() && 2 * shared[*group] > draw.sizes[*group]
        };
        if let Some(group) = (0..draw.sizes.len()).find(same) {
            existence += 1.0 / all;
            for (of, membership) in draw.group_of.iter().zip(&mut memberships) {
                if *of == Some(group) {
                    *membership += 1.0 / all;
                }
            }
        }
    }
    Group { existence: existence.min(1.0), rows, memberships }
}

impl Draw {
    /// 1 for two different rows of one transmitter, else 0.
    fn joins(&self, a: usize, b: usize) -> f64 {
        let joined = a != b && self.group_of[a].is_some() && self.group_of[a] == self.group_of[b];
        f64::from(u8::from(joined))
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use rand::{SeedableRng, rngs::Xoshiro256PlusPlus};

    use super::*;

    /// The posterior over all ways to sort four rows, by listing them, is that of the draws.
    #[test]
    fn draws_are_as_frequent_as_their_probability() {
        // Two cells; rows 0 and 1 are of the first, row 2 of the second, row 3 of neither.
        let ratios = [vec![6.0, 0.2], vec![4.0, 0.5], vec![0.3, 5.0], vec![0.4, 0.4]];
        let table = Table::new(&ratios);
        // A way to sort: for each row 0 for clutter, or its group from 1, in order of appearance.
        let mut ways: Vec<Vec<usize>> = vec![Vec::new()];
        for _ in 0..4 {
            ways = ways
                .into_iter()
                .flat_map(|way| {
                    let most = way.iter().copied().max().unwrap_or(0);
                    (0..=most + 1).map(move |group| {
                        let mut longer = way.clone();
                        longer.push(group);
                        longer
                    })
                })
                .collect();
        }
        assert_eq!(ways.len(), 52, "partitions of five things: the rows and clutter");
        let mut total = 0.0;
        let mut pair = 0.0;
        let mut numbers = [0.0; 5];
        for way in &ways {
            let mut chain = Chain::new(&table);
            for (row, group) in way.iter().enumerate() {
                if *group == 0 {
                    chain.clutter += 1;
                    continue;
                }
                if *group > chain.groups.len() {
                    chain.groups.push(Rows {
                        count: 0,
                        logs: vec![0.0; 2],
                        posterior: vec![0.0; 2],
                        log_evidence: 0.0,
                    });
                }
                chain.groups[group - 1].add(&table.logs[row]);
            }
            let probability = libm::exp(chain.log_probability());
            total += probability;
            pair += if way[0] > 0 && way[0] == way[1] { probability } else { 0.0 };
            numbers[chain.groups.iter().filter(|group| group.count > 1).count()] += probability;
        }
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(3);
        let mut chain = Chain::new(&table);
        (0..4).for_each(|row| chain.place(row, &mut rng));
        let draws: Vec<Draw> = (0..40_000)
            .map(|_| {
                chain.sweep(&mut rng);
                chain.drawn()
            })
            .collect();
        let drawn = draws.iter().map(|draw| draw.joins(0, 1)).sum::<f64>() / 40_000.0;
        // Four standard errors of a share of 40 000 draws that depend on each other weakly.
        assert_abs_diff_eq!(drawn, pair / total, epsilon = 0.015);
        let sorted = summarised(4, &draws);
        for (count, share) in sorted.numbers.iter().enumerate() {
            assert_abs_diff_eq!(*share, numbers[count] / total, epsilon = 0.015);
        }
    }

    #[test]
    fn coefficients_keep_the_recursion_of_miller_and_harrison() {
        // Vₙ(t) = (n + t) Vₙ₊₁(t) + Vₙ₊₁(t + 1) with γ = 1 (their proposition 3.2).
        for (rows, groups) in [(1, 1), (4, 2), (9, 3), (40, 7)] {
            let v = |n, t| libm::exp(log_coefficient(n, t) - log_coefficient(rows, groups));
            let sum = number(rows + groups) * v(rows + 1, groups) + v(rows + 1, groups + 1);
            assert_abs_diff_eq!(sum, 1.0, epsilon = 1e-9);
        }
    }

    #[test]
    fn improper_tables_are_refused() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
        let sorting = Sorting::default();
        for ratios in
            [vec![vec![1.0, 2.0], vec![1.0]], vec![vec![]], vec![vec![-1.0]], vec![vec![f64::NAN]]]
        {
            assert!(sorting.sort(&ratios, &mut rng).is_err(), "{ratios:?}");
        }
        let none = Sorting { sweeps: 0, ..sorting };
        assert!(none.sort(&[vec![1.0]], &mut rng).is_err());
        let nothing = sorting.sort(&[], &mut rng).expect("no rows are proper");
        assert!(nothing.groups.is_empty());
        assert_abs_diff_eq!(nothing.numbers[0], 1.0, epsilon = 1e-9);
    }
}
