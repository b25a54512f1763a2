//! Masses of the cells, and their diffusion.

use alloc::{vec, vec::Vec};

use foxhunt_core::{Covariance, Estimate, EstimatorError, Role, State, elementary};

use super::{Lattice, columns::Columns};
use crate::{
    Gaussian,
    count::number,
    vectorised::{Dot, Kernel, Largest, Map, Sum, run},
};

/// Belief about the place alone: the probability of each cell, on a common scale.
#[derive(Clone, Debug, Default)]
pub(super) struct Weights<const N: usize> {
    /// Under each hypothesis.
    each: Vec<Vec<f64>>,
    /// Under all of them together, where there are several.
    all: Vec<f64>,
    /// Σ w n over the hypotheses, with n the mean of a further component.
    behind: Vec<Vec<f64>>,
    /// Covariance of the further components within a cell, on average; 0 in the first two.
    within: Option<Covariance<N>>,
    total: f64,
    /// Numbers of every cell, of no meaning between two calls.
    scratch: Vec<f64>,
    means: Vec<Vec<f64>>,
}

impl<const N: usize> Weights<N> {
    /// Sets the weights from the columns, the likeliest one of a hypothesis being 1; returns ln p
    /// of such a one, −∞ where nothing is possible.
    pub(super) fn set(&mut self, columns: &Columns<N>) -> f64 {
        let hypotheses = columns.hypotheses();
        self.each.resize_with(hypotheses.len(), Vec::new);
        let mut most = f64::NEG_INFINITY;
        for (j, logs) in self.each.iter_mut().enumerate() {
            logs.resize(hypotheses[j].logs.len(), 0.0);
            columns.log_marginals(j, logs);
            most = most.max(run(Largest(logs)));
        }
        if most > f64::NEG_INFINITY {
            for logs in &mut self.each {
                run(Map {
                    columns: [],
                    of: |_: [f64; 0], log| elementary::exp(log - most),
                    out: logs,
                });
            }
        }
        self.gather();
        most
    }

    /// Takes the weights under each hypothesis together.
    fn gather(&mut self) {
        if let [first, others @ ..] = &self.each[..]
            && !others.is_empty()
        {
            self.all.clone_from(first);
            for one in others {
                run(Map {
                    columns: [one],
                    of: |[one]: [f64; 1], sum| sum + one,
                    out: &mut self.all,
                });
            }
        }
        self.total = run(Sum(self.all()));
    }

    /// Convolves the weights, or those from `before`, with a Gaussian along each side of the
    /// lattice; `variance` counts in cells².
    pub(super) fn blur(&mut self, before: Option<&Self>, side: usize, variance: [f64; 2]) {
        let Self { each, scratch, .. } = self;
        if let Some(before) = before {
            each.resize_with(before.each.len(), Vec::new);
        }
        for (j, weights) in each.iter_mut().enumerate() {
            scratch.resize(side * side, 0.0);
            let before = before.map_or(&*weights, |before| &before.each[j]);
            blur(before, scratch, side, 0, variance[0]);
            weights.resize(side * side, 0.0);
            blur(scratch, weights, side, 1, variance[1]);
        }
        self.gather();
    }

    /// The weights of the cells.
    pub(super) fn all(&self) -> &[f64] {
        if let [one] = &self.each[..] { one } else { &self.all }
    }

    /// The sum of the weights.
    pub(super) fn total(&self) -> f64 {
        self.total
    }

    /// The weights under each hypothesis.
    pub(super) fn each(&self) -> &[Vec<f64>] {
        &self.each
    }

    /// Covariance of the further components within a cell, on average; `None` without them.
    pub(super) fn within(&self) -> Option<&Covariance<N>> {
        self.within.as_ref()
    }

    /// The mean of a further component in a cell, over all hypotheses.
    pub(super) fn mean_behind(&self, component: usize, index: usize) -> f64 {
        self.behind[component - 2][index] / self.all()[index]
    }

    /// Returns the moments of the belief, n counted from `reference`; keeps the moments of the
    /// further components in each cell.
    pub(super) fn moments(
        &mut self,
        columns: &Columns<N>,
        lattice: &Lattice,
        reference: &State<N>,
    ) -> Result<Gaussian<N>, EstimatorError> {
        let cells = lattice.len();
        let place = lattice.moments(self.all());
        let mut mean = State::<N>::zeros();
        let mut square = Covariance::<N>::zeros();
        mean.fixed_rows_mut::<2>(0).copy_from(&place.first);
        square.fixed_view_mut::<2, 2>(0, 0).copy_from(&place.second);
        self.behind.resize_with(N - 2, Vec::new);
        for column in &mut self.behind {
            column.clear();
            column.resize(cells, 0.0);
        }
        if N > 2 {
            let means = &mut self.means;
            let weighted = &mut self.scratch;
            means.resize_with(N - 2, Vec::new);
            means.iter_mut().for_each(|means| means.resize(cells, 0.0));
            weighted.resize(cells, 0.0);
            let mut spread = Covariance::<N>::zeros();
            for (hypothesis, weights) in self.each.iter().enumerate() {
                columns.means(hypothesis, means);
                for i in 2..N {
                    let product = |[weight, mean]: [f64; 2], _| weight * mean;
                    run(Map { columns: [weights, &means[i - 2]], of: product, out: weighted });
                    let sums = &mut self.behind[i - 2];
                    run(Map {
                        columns: [weighted],
                        of: |[one]: [f64; 1], sum| sum + one,
                        out: sums,
                    });
                    for j in 2..=i {
                        square[(i, j)] += run(Dot(weighted, &means[j - 2]));
                    }
                }
                let own = columns.spread(hypothesis, weights);
                square += own;
                spread += own;
            }
            self.within = Some(spread / place.total);
            for (i, column) in self.behind.iter().enumerate() {
                let behind = lattice.moments(column);
                mean[2 + i] = behind.total;
                (0..2).for_each(|axis| square[(2 + i, axis)] = behind.first[axis]);
            }
        }
        mean /= place.total;
        let mut covariance = square / place.total - mean * mean.transpose();
        covariance.fill_upper_triangle_with_lower_triangle();
        // A belief within a single cell is known to the cell and no better.
        let steps = lattice.steps();
        let mut within = covariance.fixed_view_mut::<2, 2>(0, 0);
        within += steps * steps.transpose() * 1e-6;
        mean += reference;
        let mut centre = mean.fixed_rows_mut::<2>(0);
        centre += lattice.centre();
        Gaussian::new(Estimate { mean, covariance }, Role::Posterior)
    }
}

/// A convolution along one side, 0 along the rows.
struct Convolution<'a> {
    weights: &'a [f64],
    columns: usize,
    along: usize,
    taps: &'a [f64],
    out: &'a mut [f64],
}

impl Kernel for Convolution<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { weights, columns, along, taps, out } = self;
        let rows = weights.len() / columns;
        for (row, out) in out.chunks_exact_mut(columns).enumerate() {
            let line = &weights[row * columns..][..columns];
            out.iter_mut().zip(line).for_each(|(out, v)| *out = taps[0] * v);
            for (reach, tap) in taps.iter().enumerate().skip(1) {
                let add = |out: &mut [f64], from: &[f64]| {
                    out.iter_mut().zip(from).for_each(|(out, v)| *out += tap * v);
                };
                if along == 0 {
                    add(&mut out[reach..], line);
                    add(out, &line[reach..]);
                } else {
                    if row >= reach {
                        add(out, &weights[(row - reach) * columns..]);
                    }
                    if row + reach < rows {
                        add(out, &weights[(row + reach) * columns..]);
                    }
                }
            }
        }
    }
}

/// Convolves weights over rows of `columns` cells with a Gaussian along one side, 0 along the rows;
/// `variance` counts in cells². Sets `out`; what spreads beyond the border is lost.
pub(crate) fn blur(weights: &[f64], out: &mut [f64], columns: usize, along: usize, variance: f64) {
    let side = if along == 0 { columns } else { weights.len() / columns };
    run(Convolution { weights, columns, along, taps: &taps(variance, side), out });
}

/// One side of a symmetric kernel of this variance that sums to 1. Up to half a cell² three
/// weights have exactly that variance; beyond, the Gaussian at whole cells has it to 10⁻³.
fn taps(variance: f64, side: usize) -> Vec<f64> {
    if variance <= 0.5 {
        return vec![1.0 - variance, 0.5 * variance];
    }
    let gauss = |reach: usize| libm::exp(-0.5 * number(reach * reach) / variance);
    let mut taps: Vec<f64> = (0..side).map(gauss).take_while(|tap| *tap > 1e-14).collect();
    let total = 2.0 * taps.iter().sum::<f64>() - taps[0];
    taps.iter_mut().for_each(|tap| *tap /= total);
    taps
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn a_gaussian_stays_one_and_gains_the_variance() {
        const SIDE: usize = 81;
        for (before, added) in [(9.0, [0.3, 0.0]), (9.0, [4.0, 0.7]), (16.0, [0.01, 12.0])] {
            let axis = |i: usize| number(i) - 40.0;
            let mut weights: Vec<f64> = (0..SIDE * SIDE)
                .map(|i| {
                    let x = axis(i % SIDE);
                    let y = axis(i / SIDE);
                    libm::exp(-0.5 * (x * x + y * y) / before)
                })
                .collect();
            let mut along_rows = vec![0.0; SIDE * SIDE];
            blur(&weights, &mut along_rows, SIDE, 0, added[0]);
            blur(&along_rows, &mut weights, SIDE, 1, added[1]);
            let weight = |i: usize| weights[i];
            let total: f64 = weights.iter().sum();
            let expected = core::f64::consts::TAU * before;
            assert_abs_diff_eq!(total / expected, 1.0, epsilon = 1e-9);
            for (along, added) in added.into_iter().enumerate() {
                let at = |i: usize| axis(if along == 0 { i % SIDE } else { i / SIDE });
                let variance =
                    (0..SIDE * SIDE).map(|i| weight(i) * at(i) * at(i)).sum::<f64>() / total;
                let error = variance - before - added;
                assert!(error.abs() < 1e-3 * (before + added), "variance {variance}");
            }
        }
    }
}
