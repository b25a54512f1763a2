use alloc::vec::Vec;

use foxhunt_core::{Covariance, Estimate, EstimatorError, Role, State, elementary};

use super::{Columns, Lattice, blur::blur};
use crate::{
    Gaussian,
    vectorised::{Dot, Largest, Map, Sum, run},
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
                square += columns.spread(hypothesis, weights);
            }
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
