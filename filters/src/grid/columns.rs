use alloc::{vec, vec::Vec};
use core::f64::consts::TAU;

use foxhunt_core::{Covariance, State};
use nalgebra::Vector2;

use super::Lattice;
use crate::count::number;

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
        let column = |j: usize| {
            let cells = self.hypotheses[j][0].len();
            (0..cells).map(|i| self.cell(j, i).log_marginal()).collect()
        };
        (0..self.hypotheses()).map(column).collect()
    }

    /// The same belief over other cells. Beyond the old ones l is what it is on their border, and
    /// what `fall` makes of the way from there, which is never positive.
    pub(super) fn over(
        &self,
        from: &Lattice,
        to: &Lattice,
        fall: impl Fn(&Vector2<f64>) -> f64,
    ) -> Self {
        let mut columns = Self::new(self.hypotheses(), to.len());
        let last = number(from.side()) - 0.5;
        for index in 0..to.len() {
            let place = to.place(index);
            let at = from.coordinates(&place);
            let inside = at.map(|c| c.clamp(-0.5, last));
            let fall = if (at - inside).norm_squared() > 0.0 {
                fall(&(from.steps() * (at - inside)))
            } else {
                0.0
            };
            let pairs = columns.hypotheses.iter_mut().zip(&self.hypotheses);
            for (new, old) in pairs {
                for (new, old) in new.iter_mut().zip(old) {
                    new[index] = from.read(old, &at);
                }
                new[0][index] += fall;
            }
        }
        columns
    }
}

/// ln p(x) of every cell, whatever the hypothesis.
pub(super) fn log_densities(marginals: &[Vec<f64>]) -> Vec<f64> {
    let Some((first, others)) = marginals.split_first() else { return Vec::new() };
    let mut total = first.clone();
    for other in others {
        for (sum, log) in total.iter_mut().zip(other) {
            *sum = log_add(*sum, *log);
        }
    }
    total
}

/// ln(eᵃ + eᵇ).
fn log_add(a: f64, b: f64) -> f64 {
    let (low, high) = if a < b { (a, b) } else { (b, a) };
    // Below, the smaller one is lost in the sum.
    if low < high - 40.0 { high } else { high + libm::log1p(libm::exp(low - high)) }
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
