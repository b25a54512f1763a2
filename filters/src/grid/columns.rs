use alloc::{vec, vec::Vec};
use core::f64::consts::TAU;

use foxhunt_core::{Covariance, EstimatorError, Role, State, elementary};
use nalgebra::Vector2;

use super::{Lattice, lattice::Stencil};
use crate::{
    count::number,
    vectorised::{Kernel, Map, Sum, run},
};

/// What is believed in each cell of a lattice, one column for each number.
///
/// Of a state of `N` components the first two are the cell's place. The others, n, are Gaussian
/// given the place: ln p(x, n) = l + ηᵀ n − ½ nᵀ Λ n, so that l, η and Λ are sums over the
/// observations, as smooth over the lattice as these. n counts from the prior's mean.
#[derive(Clone, Debug)]
pub(super) struct Columns<const N: usize> {
    /// One for each factor of the doubted noise: l, then η, then the rows of Λ up to its diagonal.
    hypotheses: Vec<Vec<Vec<f64>>>,
}

/// One cell under one hypothesis: l, and η and Λ in the components behind the place, where the
/// place itself stands as 0 and I.
///
/// One component behind the place, as an unknown reference power is, is so common and the cells are
/// so many that its 1 × 1 matrices are not factored.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell<const N: usize> {
    pub(super) log: f64,
    pub(super) shift: State<N>,
    pub(super) information: Covariance<N>,
}

impl<const N: usize> Cell<N> {
    /// ln p(x): n integrated out. −∞ where Λ is not positive definite.
    pub(super) fn log_marginal(&self) -> f64 {
        if N == 2 {
            return self.log;
        }
        if N == 3 {
            let (shift, information) = (self.shift[2], self.information[(2, 2)]);
            if information.is_nan() || information <= 0.0 {
                return f64::NEG_INFINITY;
            }
            return self.log + 0.5 * (shift * shift / information - libm::log(information / TAU));
        }
        let Some(factor) = self.information.cholesky() else { return f64::NEG_INFINITY };
        let white = factor.l_dirty().solve_lower_triangular_unchecked(&self.shift);
        let log_root: f64 = factor.l_dirty().diagonal().iter().map(|d| libm::log(*d)).sum();
        self.log + 0.5 * (white.norm_squared() + number(N - 2) * libm::log(TAU)) - log_root
    }

    /// The mean and the covariance of n; 0 in the first two components.
    pub(super) fn conditional(&self) -> Option<(State<N>, Covariance<N>)> {
        if N == 3 {
            let variance = 1.0 / self.information[(2, 2)];
            let (mut mean, mut covariance) = (State::zeros(), Covariance::zeros());
            mean[2] = self.shift[2] * variance;
            covariance[(2, 2)] = variance;
            return (variance > 0.0 && variance.is_finite()).then_some((mean, covariance));
        }
        let factor = self.information.cholesky()?;
        let mut covariance = factor.solve(&Covariance::identity());
        covariance[(0, 0)] = 0.0;
        covariance[(1, 1)] = 0.0;
        Some((factor.solve(&self.shift), covariance))
    }

    /// The cell with this ln p(x), mean and covariance of n, the latter with I in the place.
    pub(super) fn of(
        log_marginal: f64,
        mean: &State<N>,
        covariance: &Covariance<N>,
    ) -> Option<Self> {
        let information = if N == 3 {
            let mut information = Covariance::identity();
            information[(2, 2)] = 1.0 / covariance[(2, 2)];
            information
        } else {
            covariance.cholesky()?.solve(&Covariance::identity())
        };
        let cell = Self { log: 0.0, shift: information * mean, information };
        Some(Self { log: log_marginal - cell.log_marginal(), ..cell })
    }
}

impl<const N: usize> Columns<N> {
    /// As many columns as `hypotheses` need over `cells`.
    pub(super) fn new(hypotheses: usize, cells: usize) -> Self {
        let rest = N - 2;
        let columns = vec![vec![0.0; cells]; 1 + rest + rest * (rest + 1) / 2];
        Self { hypotheses: vec![columns; hypotheses] }
    }

    pub(super) fn hypotheses(&self) -> usize {
        self.hypotheses.len()
    }

    /// l of every cell.
    pub(super) fn logs_mut(&mut self, hypothesis: usize) -> &mut [f64] {
        &mut self.hypotheses[hypothesis][0]
    }

    pub(super) fn cell(&self, hypothesis: usize, index: usize) -> Cell<N> {
        let columns = &self.hypotheses[hypothesis];
        let mut column = columns.iter().map(|column| column[index]);
        let mut next = || column.next().unwrap_or(0.0);
        let mut cell =
            Cell { log: next(), shift: State::zeros(), information: Covariance::identity() };
        (2..N).for_each(|i| cell.shift[i] = next());
        for i in 2..N {
            for j in 2..=i {
                cell.information[(i, j)] = next();
                cell.information[(j, i)] = cell.information[(i, j)];
            }
        }
        cell
    }

    pub(super) fn set(&mut self, hypothesis: usize, index: usize, cell: &Cell<N>) {
        let mut columns = self.hypotheses[hypothesis].iter_mut();
        let mut put = |value| {
            if let Some(column) = columns.next() {
                column[index] = value;
            }
        };
        put(cell.log);
        (2..N).for_each(|i| put(cell.shift[i]));
        for i in 2..N {
            (2..=i).for_each(|j| put(cell.information[(i, j)]));
        }
    }

    /// ln p(x) of every cell under each hypothesis.
    pub(super) fn log_marginals(&self) -> Vec<Vec<f64>> {
        let marginals = |(j, columns): (usize, &Vec<Vec<f64>>)| {
            let mut logs = columns[0].clone();
            if N == 3 {
                let (shift, information) = (&columns[1][..], &columns[2][..]);
                run(Map { columns: [shift, information], of: add_log_integral, out: &mut logs });
            } else if N > 3 {
                let cells = logs.iter_mut().enumerate();
                cells.for_each(|(i, log)| *log = self.cell(j, i).log_marginal());
            }
            logs
        };
        self.hypotheses.iter().enumerate().map(marginals).collect()
    }

    /// l, then η, then the rows of Λ up to its diagonal.
    pub(super) fn columns_mut(&mut self, hypothesis: usize) -> &mut [Vec<f64>] {
        &mut self.hypotheses[hypothesis]
    }

    /// The mean of the further components in every cell, 0 where there is none.
    pub(super) fn means(&self, hypothesis: usize) -> Vec<Vec<f64>> {
        let columns = &self.hypotheses[hypothesis];
        let mut means = vec![vec![0.0; columns[0].len()]; N - 2];
        if N == 3 {
            let of = |[shift, information]: [f64; 2], _| {
                let mean = shift / information;
                if information > 0.0 { mean } else { 0.0 }
            };
            run(Map { columns: [&columns[1], &columns[2]], of, out: &mut means[0] });
        } else if N > 3 {
            (0..columns[0].len()).for_each(|index| {
                if let Some((mean, _)) = self.cell(hypothesis, index).conditional() {
                    (2..N).for_each(|i| means[i - 2][index] = mean[i]);
                }
            });
        }
        means
    }

    /// The mean covariance of the further components, cells weighed by these weights; 0 in the
    /// first two components.
    pub(super) fn spread(&self, hypothesis: usize, weights: &[f64]) -> Covariance<N> {
        let mut spread = Covariance::zeros();
        let columns = &self.hypotheses[hypothesis];
        if N == 3 {
            let of = |[weight, information]: [f64; 2], _| {
                let share = weight / information;
                if information > 0.0 { share } else { 0.0 }
            };
            let mut shares = vec![0.0; weights.len()];
            run(Map { columns: [weights, &columns[2]], of, out: &mut shares });
            spread[(2, 2)] = run(Sum(&shares));
        } else if N > 3 {
            for (index, weight) in weights.iter().enumerate().filter(|(_, w)| **w > 0.0) {
                let conditional = self.cell(hypothesis, index).conditional();
                spread += conditional.map_or(Covariance::zeros(), |(_, within)| within * *weight);
            }
        }
        spread
    }

    /// Gives every cell the log-density `after` instead of `before`, and its further components the
    /// covariance `more`.
    pub(super) fn spread_behind(
        &mut self,
        hypothesis: usize,
        before: &[f64],
        after: &[f64],
        more: &Covariance<N>,
    ) -> Result<(), EstimatorError> {
        let still = more.norm_squared() <= 0.0;
        if still {
            let of = |[before, after]: [f64; 2], log| {
                let moved = log + (after - before);
                if before > f64::NEG_INFINITY { moved } else { log }
            };
            run(Map { columns: [before, after], of, out: self.logs_mut(hypothesis) });
        }
        for (index, (before, after)) in before.iter().zip(after).enumerate() {
            // Where nothing was possible, there is no difference to add.
            if still && (*before > f64::NEG_INFINITY || *after <= f64::NEG_INFINITY) {
                continue;
            }
            let no_factor = EstimatorError::NotPositiveDefinite { role: Role::Posterior };
            let (mean, within) = self.cell(hypothesis, index).conditional().ok_or(no_factor)?;
            let mut covariance = within + more;
            (0..2).for_each(|i| covariance[(i, i)] = 1.0);
            let cell = Cell::of(*after, &mean, &covariance).ok_or(no_factor)?;
            self.set(hypothesis, index, &cell);
        }
        Ok(())
    }

    /// The same belief over other cells. Beyond the old ones l is what it is on their border, and
    /// what `fall` makes of the way from there, which is never positive.
    pub(super) fn over(
        &self,
        from: &Lattice,
        to: &Lattice,
        fall: impl Fn(&Vector2<f64>) -> f64,
    ) -> Self {
        let last = number(from.side()) - 0.5;
        let mut falls = Vec::new();
        let mut stencils = Vec::with_capacity(to.len());
        let [east, north] = to.places();
        for (index, (east, north)) in east.iter().zip(&north).enumerate() {
            let at = from.coordinates(&Vector2::new(*east, *north));
            let inside = at.map(|c| c.clamp(-0.5, last));
            if (at - inside).norm_squared() > 0.0 {
                falls.push((index, fall(&(from.steps() * (at - inside)))));
            }
            stencils.push(from.stencil(&at));
        }
        let mut columns = Self::new(self.hypotheses(), to.len());
        for (new, old) in columns.hypotheses.iter_mut().zip(&self.hypotheses) {
            for (out, column) in new.iter_mut().zip(old) {
                run(Reading { stencils: &stencils, column, side: from.side(), out });
            }
            falls.iter().for_each(|(index, fall)| new[0][*index] += fall);
        }
        columns
    }
}

/// A column read between its cells.
struct Reading<'a> {
    stencils: &'a [Stencil],
    column: &'a [f64],
    side: usize,
    out: &'a mut [f64],
}

impl Kernel for Reading<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for (out, stencil) in self.out.iter_mut().zip(self.stencils) {
            *out = stencil.read(self.column, self.side);
        }
    }
}

/// ln p(x) of a cell with one component behind the place, from η, Λ and l.
#[inline(always)]
fn add_log_integral([shift, information]: [f64; 2], log: f64) -> f64 {
    let integral = shift * shift / information - elementary::ln(information / TAU);
    if information > 0.0 { log + 0.5 * integral } else { f64::NEG_INFINITY }
}

/// ln p(x) of every cell, whatever the hypothesis.
pub(super) fn log_densities(marginals: &[Vec<f64>]) -> Vec<f64> {
    let Some((first, others)) = marginals.split_first() else { return Vec::new() };
    let mut most = first.clone();
    if others.is_empty() {
        return most;
    }
    let larger = |[a]: [f64; 1], most| if a > most { a } else { most };
    others.iter().for_each(|a| run(Map { columns: [a], of: larger, out: &mut most }));
    let mut sum = vec![0.0; most.len()];
    let add = |[a, most]: [f64; 2], sum| {
        let part = elementary::exp(a - most);
        // Where nothing is possible, there is no difference.
        if a > f64::NEG_INFINITY { sum + part } else { sum }
    };
    marginals.iter().for_each(|a| run(Map { columns: [a, &most], of: add, out: &mut sum }));
    run(Map {
        columns: [&sum],
        of: |[sum]: [f64; 1], most| most + elementary::ln(sum),
        out: &mut most,
    });
    most
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix4, Vector4};

    use super::*;

    #[test]
    fn a_cell_keeps_its_moments() {
        let mean = Vector4::new(0.0, 0.0, 1.5, -0.5);
        let mut covariance = Matrix4::identity();
        covariance
            .fixed_view_mut::<2, 2>(2, 2)
            .copy_from(&nalgebra::Matrix2::new(4.0, 1.0, 1.0, 2.0));
        let cell = Cell::of(-3.0, &mean, &covariance).expect("definite");
        assert!((cell.log_marginal() + 3.0).abs() < 1e-14);
        let mut columns = Columns::<4>::new(2, 3);
        columns.set(1, 2, &cell);
        let (found, spread) = columns.cell(1, 2).conditional().expect("definite");
        assert!((found - mean).norm() < 1e-14);
        covariance[(0, 0)] = 0.0;
        covariance[(1, 1)] = 0.0;
        assert!((spread - covariance).norm() < 1e-14);
    }

    #[test]
    fn a_cell_integrates_to_its_marginal() {
        // ∫ exp(l + η n − ½ Λ n²) dn by the trapezoidal rule.
        let mut information = nalgebra::Matrix3::identity();
        information[(2, 2)] = 0.7;
        let cell = Cell::<3> { log: 0.2, shift: State::<3>::new(0.0, 0.0, 1.1), information };
        let step = 0.01;
        let sum: f64 = (-3000..3000)
            .map(|i| f64::from(i) * step)
            .map(|n| libm::exp(0.2 + 1.1 * n - 0.35 * n * n) * step)
            .sum();
        assert!((libm::log(sum) - cell.log_marginal()).abs() < 1e-12);
    }
}
