use alloc::{borrow::Cow, vec, vec::Vec};
use core::f64::consts::TAU;

use foxhunt_core::{Covariance, EstimatorError, Role, State, elementary};
use nalgebra::Vector2;

use super::{
    Lattice,
    reading::{Place, Reading},
};
use crate::{
    count::number,
    vectorised::{Dot, Kernel, Map, Sum, run},
};

/// A number of every cell.
#[derive(Clone, Debug)]
pub(super) enum Column {
    /// One number for all cells.
    Same(f64),
    /// Each its own.
    Each(Vec<f64>),
}

impl Column {
    fn at(&self, index: usize) -> f64 {
        match self {
            Self::Same(value) => *value,
            Self::Each(column) => column[index],
        }
    }

    /// Returns the numbers of `cells` cells, each its own from now on.
    fn each_mut(&mut self, cells: usize) -> &mut [f64] {
        if let Self::Same(value) = *self {
            *self = Self::Each(vec![value; cells]);
        }
        match self {
            Self::Same(_) => unreachable!("each has just become its own"),
            Self::Each(column) => column,
        }
    }

    /// Adds a factor times the product of two numbers of each of `cells` cells.
    pub(super) fn add_product(&mut self, cells: usize, factor: f64, x: &Self, y: &Self) {
        match (&mut *self, x, y) {
            (Self::Same(sum), Self::Same(x), Self::Same(y)) => *sum += factor * (x * y),
            _ if x.is_zero() || y.is_zero() => {}
            _ => add_product(self.each_mut(cells), factor, x, y),
        }
    }

    /// Returns the product with another number of each of `cells` cells, as a factor and a column.
    pub(super) fn times<'a>(&self, cells: usize, other: &'a Self) -> (f64, Cow<'a, Self>) {
        match self {
            Self::Same(factor) => (*factor, Cow::Borrowed(other)),
            Self::Each(_) => {
                let mut product = Self::Same(0.0);
                product.add_product(cells, 1.0, self, other);
                (1.0, Cow::Owned(product))
            }
        }
    }

    /// Returns true if all cells share a zero.
    pub(super) fn is_zero(&self) -> bool {
        matches!(self, Self::Same(value) if value.abs() <= 0.0)
    }
}

/// Adds a factor times the product of two numbers of every cell.
pub(super) fn add_product(sums: &mut [f64], factor: f64, x: &Column, y: &Column) {
    match (x, y) {
        (Column::Same(x), Column::Same(y)) => {
            let more = factor * (x * y);
            run(Map { columns: [], of: |_: [f64; 0], sum| sum + more, out: sums });
        }
        (Column::Same(same), Column::Each(each)) | (Column::Each(each), Column::Same(same)) => {
            let factor = factor * same;
            if factor.abs() > 0.0 {
                run(Map { columns: [each], of: |[x]: [f64; 1], sum| sum + factor * x, out: sums });
            }
        }
        (Column::Each(x), Column::Each(y)) => {
            run(Map {
                columns: [x, y],
                of: |[x, y]: [f64; 2], sum| sum + factor * (x * y),
                out: sums,
            });
        }
    }
}

/// Belief in each cell of a lattice, one column for each number.
///
/// The first two of the state's `N` components are the cell's place. The others, n, are Gaussian
/// given the place: ln p(x, n) = l + ηᵀ n − ½ nᵀ Λ n, so that l, η and Λ are sums over the
/// observations, as smooth over the lattice as these. n counts from the prior's mean.
#[derive(Clone, Debug, Default)]
pub(super) struct Columns<const N: usize> {
    hypotheses: Vec<Hypothesis>,
}

/// The columns under one factor of the doubted noise.
#[derive(Clone, Debug, Default)]
pub(super) struct Hypothesis {
    /// l.
    pub logs: Vec<f64>,
    /// η.
    pub shifts: Vec<Vec<f64>>,
    /// The rows of Λ up to its diagonal: the same in all cells where the measurement has one slope
    /// over n, as a level has over a reference power.
    pub information: Vec<Column>,
}

impl Hypothesis {
    fn copy_from(&mut self, other: &Self) {
        self.logs.clone_from(&other.logs);
        self.shifts.clone_from(&other.shifts);
        self.information.clone_from(&other.information);
    }
}

/// One cell under one hypothesis: l, and η and Λ in the components behind the place, where the
/// place itself stands as 0 and I.
///
/// One component behind the place, as an unknown reference power is, is so common, and cells are so
/// numerous, that its 1 × 1 matrices are not factored.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cell<const N: usize> {
    pub log: f64,
    pub shift: State<N>,
    pub information: Covariance<N>,
}

impl<const N: usize> Cell<N> {
    /// ln p(x): n integrated out. −∞ where Λ is not positive definite.
    fn log_marginal(&self) -> f64 {
        if N == 2 {
            return self.log;
        }
        if N == 3 {
            let shift = self.shift[2];
            let information = self.information[(2, 2)];
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
    fn conditional(&self) -> Option<(State<N>, Covariance<N>)> {
        if N == 3 {
            let variance = 1.0 / self.information[(2, 2)];
            let mut mean = State::zeros();
            let mut covariance = Covariance::zeros();
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
    /// As many columns as `hypotheses` need over `cells`; l and η are 0, Λ is `information`.
    pub(super) fn new(hypotheses: usize, cells: usize, information: &Covariance<N>) -> Self {
        let shifts = vec![vec![0.0; cells]; N - 2];
        let information = (2..N).flat_map(|i| (2..=i).map(move |j| information[(i, j)]));
        let information = information.map(Column::Same).collect();
        let hypothesis = Hypothesis { logs: vec![0.0; cells], shifts, information };
        Self { hypotheses: vec![hypothesis; hypotheses] }
    }

    /// Becomes a copy in the memory it has.
    pub(super) fn copy_from(&mut self, other: &Self) {
        self.hypotheses.resize_with(other.hypotheses.len(), Hypothesis::default);
        for (own, other) in self.hypotheses.iter_mut().zip(&other.hypotheses) {
            own.copy_from(other);
        }
    }

    pub(super) fn hypotheses(&self) -> &[Hypothesis] {
        &self.hypotheses
    }

    pub(super) fn hypotheses_mut(&mut self) -> &mut [Hypothesis] {
        &mut self.hypotheses
    }

    /// Adds a constant to every log-density.
    pub(super) fn shift(&mut self, by: f64) {
        if by.abs() <= 0.0 {
            return;
        }
        for hypothesis in &mut self.hypotheses {
            run(Map { columns: [], of: |_: [f64; 0], log| log + by, out: &mut hypothesis.logs });
        }
    }

    fn cell(&self, hypothesis: usize, index: usize) -> Cell<N> {
        let Hypothesis { logs, shifts, information } = &self.hypotheses[hypothesis];
        let mut cell =
            Cell { log: logs[index], shift: State::zeros(), information: Covariance::identity() };
        (2..N).for_each(|i| cell.shift[i] = shifts[i - 2][index]);
        for ((i, j), column) in behind().zip(information) {
            cell.information[(i, j)] = column.at(index);
            cell.information[(j, i)] = cell.information[(i, j)];
        }
        cell
    }

    pub(super) fn set(&mut self, hypothesis: usize, index: usize, cell: &Cell<N>) {
        let Hypothesis { logs, shifts, information } = &mut self.hypotheses[hypothesis];
        logs[index] = cell.log;
        (2..N).for_each(|i| shifts[i - 2][index] = cell.shift[i]);
        for ((i, j), column) in behind().zip(information) {
            let value = cell.information[(i, j)];
            match column {
                Column::Same(same) if same.to_bits() == value.to_bits() => {}
                _ => column.each_mut(logs.len())[index] = value,
            }
        }
    }

    /// Λ, where all cells share it: with N > 3 it is factored once then, and not in every cell.
    fn shared(&self, hypothesis: usize) -> Option<Cell<N>> {
        let Hypothesis { information, .. } = &self.hypotheses[hypothesis];
        let is_same = |column: &Column| matches!(column, Column::Same(_));
        let shared = N > 3 && information.iter().all(is_same);
        shared.then(|| Cell { log: 0.0, shift: State::zeros(), ..self.cell(hypothesis, 0) })
    }

    /// η of a cell; 0 in the first two components.
    fn shift_of(&self, hypothesis: usize, index: usize) -> State<N> {
        let mut shift = State::zeros();
        let shifts = &self.hypotheses[hypothesis].shifts;
        (2..N).for_each(|i| shift[i] = shifts[i - 2][index]);
        shift
    }

    /// ln p(x) of every cell.
    pub(super) fn log_marginals(&self, hypothesis: usize, out: &mut [f64]) {
        let Hypothesis { logs, shifts, information } = &self.hypotheses[hypothesis];
        if N == 2 {
            return out.copy_from_slice(logs);
        }
        if let Some(shared) = self.shared(hypothesis) {
            let Some(factor) = shared.information.cholesky() else {
                return out.fill(f64::NEG_INFINITY);
            };
            let at_zero = shared.log_marginal();
            for (index, (out, log)) in out.iter_mut().zip(logs).enumerate() {
                let shift = self.shift_of(hypothesis, index);
                let white = factor.l_dirty().solve_lower_triangular_unchecked(&shift);
                *out = log + at_zero + 0.5 * white.norm_squared();
            }
            return;
        }
        if N > 3 {
            let cells = out.iter_mut().enumerate();
            return cells.for_each(|(i, log)| *log = self.cell(hypothesis, i).log_marginal());
        }
        match &information[0] {
            Column::Same(information) => {
                let of = |[log, shift]: [f64; 2], _| log + log_integral(shift, *information);
                run(Map { columns: [logs, &shifts[0]], of, out });
            }
            Column::Each(information) => {
                let of =
                    |[log, shift, information]: [f64; 3], _| log + log_integral(shift, information);
                run(Map { columns: [logs, &shifts[0], information], of, out });
            }
        }
    }

    /// Sets `out` to the mean of the further components in every cell, 0 without information.
    pub(super) fn means(&self, hypothesis: usize, out: &mut [Vec<f64>]) {
        let Hypothesis { shifts, information, .. } = &self.hypotheses[hypothesis];
        if N == 3 {
            let shifts = &shifts[0];
            let out = &mut out[0];
            match &information[0] {
                Column::Same(information) => {
                    let of = |[shift]: [f64; 1], _| mean_behind(shift, *information);
                    run(Map { columns: [shifts], of, out });
                }
                Column::Each(information) => {
                    let of = |[shift, information]: [f64; 2], _| mean_behind(shift, information);
                    run(Map { columns: [shifts, information], of, out });
                }
            }
        } else if let Some(shared) = self.shared(hypothesis) {
            let within = shared.conditional().map_or(Covariance::zeros(), |(_, within)| within);
            for index in 0..out[0].len() {
                let mean = within * self.shift_of(hypothesis, index);
                (2..N).for_each(|i| out[i - 2][index] = mean[i]);
            }
        } else if N > 3 {
            for index in 0..out[0].len() {
                let conditional = self.cell(hypothesis, index).conditional();
                let mean = conditional.map_or(State::zeros(), |(mean, _)| mean);
                (2..N).for_each(|i| out[i - 2][index] = mean[i]);
            }
        }
    }

    /// The sum of the covariances of the further components, each times its cell's weight; 0 in
    /// the first two components.
    pub(super) fn spread(&self, hypothesis: usize, weights: &[f64]) -> Covariance<N> {
        let mut spread = Covariance::zeros();
        let information = &self.hypotheses[hypothesis].information;
        if N == 3 {
            spread[(2, 2)] = match &information[0] {
                Column::Same(information) if *information > 0.0 => run(Sum(weights)) / information,
                Column::Same(_) => 0.0,
                Column::Each(information) => {
                    let of = |[information]: [f64; 1], _| {
                        let variance = 1.0 / information;
                        if information > 0.0 { variance } else { 0.0 }
                    };
                    let mut variances = vec![0.0; weights.len()];
                    run(Map { columns: [information], of, out: &mut variances });
                    run(Dot(weights, &variances))
                }
            };
        } else if let Some(shared) = self.shared(hypothesis) {
            let within = shared.conditional().map_or(Covariance::zeros(), |(_, within)| within);
            spread = within * run(Sum(weights));
        } else if N > 3 {
            for (index, weight) in weights.iter().enumerate().filter(|(_, w)| **w > 0.0) {
                let conditional = self.cell(hypothesis, index).conditional();
                spread += conditional.map_or(Covariance::zeros(), |(_, within)| within * *weight);
            }
        }
        spread
    }

    /// Gives every cell the density e^`log_one` times its weight, and its further components the
    /// covariance `more`. A weight too small for its number leaves the density what it was.
    pub(super) fn diffuse(
        &mut self,
        hypothesis: usize,
        weights: &[f64],
        log_one: f64,
        more: &Covariance<N>,
    ) -> Result<(), EstimatorError> {
        let no_factor = EstimatorError::NotPositiveDefinite { role: Role::Posterior };
        if let Some(shared) = self.shared(hypothesis) {
            let (_, within) = shared.conditional().ok_or(no_factor)?;
            let mut covariance = within + more;
            (0..2).for_each(|i| covariance[(i, i)] = 1.0);
            let wider = Cell::of(0.0, &State::zeros(), &covariance).ok_or(no_factor)?;
            let before = shared.log_marginal();
            for (index, weight) in weights.iter().enumerate() {
                let shift = self.shift_of(hypothesis, index);
                let mean = within * shift;
                let log = self.hypotheses[hypothesis].logs[index];
                let log = log_density(*weight, log_one, log + before + 0.5 * shift.dot(&mean));
                let shift = wider.information * mean;
                let log = log + wider.log - 0.5 * shift.dot(&mean);
                let Hypothesis { logs, shifts, .. } = &mut self.hypotheses[hypothesis];
                logs[index] = log;
                (2..N).for_each(|i| shifts[i - 2][index] = shift[i]);
            }
            let information = &mut self.hypotheses[hypothesis].information;
            for ((i, j), column) in behind().zip(information) {
                *column = Column::Same(wider.information[(i, j)]);
            }
            return Ok(());
        }
        if N > 3 {
            for (index, weight) in weights.iter().enumerate() {
                let cell = self.cell(hypothesis, index);
                let (mean, within) = cell.conditional().ok_or(no_factor)?;
                let mut covariance = within + more;
                (0..2).for_each(|i| covariance[(i, i)] = 1.0);
                let log = log_density(*weight, log_one, cell.log_marginal());
                let cell = Cell::of(log, &mean, &covariance).ok_or(no_factor)?;
                self.set(hypothesis, index, &cell);
            }
            return Ok(());
        }
        let Hypothesis { logs, shifts, information } = &mut self.hypotheses[hypothesis];
        let Some((shifts, information)) = shifts.first_mut().zip(information.first_mut()) else {
            let of = |[weight]: [f64; 1], log| log_density(weight, log_one, log);
            run(Map { columns: [weights], of, out: logs });
            return Ok(());
        };
        let more = more[(2, 2)];
        match information {
            Column::Same(information) => {
                let before = *information;
                if before.is_nan() || before <= 0.0 {
                    return Err(no_factor);
                }
                let information_at = |_| before;
                run(Diffusion { weights, log_one, shifts, information_at, more, logs });
                *information = wider(before, more);
                let ratio = *information / before;
                run(Map { columns: [], of: |_: [f64; 0], shift| shift * ratio, out: shifts });
            }
            Column::Each(information) => {
                if !information.iter().all(|information| *information > 0.0) {
                    return Err(no_factor);
                }
                let information_at = |index: usize| information[index];
                run(Diffusion { weights, log_one, shifts, information_at, more, logs });
                let of = |[before]: [f64; 1], shift| shift * (wider(before, more) / before);
                run(Map { columns: [information], of, out: shifts });
                run(Map {
                    columns: [],
                    of: |_: [f64; 0], before| wider(before, more),
                    out: information,
                });
            }
        }
        Ok(())
    }

    /// Columns that are read between cells. With one Λ for several components they are ln p(x) and
    /// the mean: l and η nearly cancel there, and their values read between bearings a turn apart
    /// do not.
    fn readable(&self, hypothesis: usize) -> Cow<'_, Hypothesis> {
        let own = &self.hypotheses[hypothesis];
        if self.shared(hypothesis).is_none() {
            return Cow::Borrowed(own);
        }
        let mut readable = own.clone();
        self.log_marginals(hypothesis, &mut readable.logs);
        self.means(hypothesis, &mut readable.shifts);
        Cow::Owned(readable)
    }

    /// Makes l and η of what is [readable](Self::readable).
    fn read_back(&mut self, hypothesis: usize) {
        let Some(shared) = self.shared(hypothesis) else { return };
        let at_zero = shared.log_marginal();
        for index in 0..self.hypotheses[hypothesis].logs.len() {
            let mean = self.shift_of(hypothesis, index);
            let mut shift = shared.information * mean;
            shift.fixed_rows_mut::<2>(0).fill(0.0);
            let Hypothesis { logs, shifts, .. } = &mut self.hypotheses[hypothesis];
            logs[index] -= at_zero + 0.5 * shift.dot(&mean);
            (2..N).for_each(|i| shifts[i - 2][index] = shift[i]);
        }
    }

    /// Makes `out` the same belief over other cells. Beyond the old ones l is what it is on their
    /// border, and what `fall` makes of the way from there, which is never positive.
    pub(super) fn over(
        &self,
        from: &Lattice,
        to: &Lattice,
        fall: impl Fn(&Vector2<f64>) -> f64,
        out: &mut Self,
    ) {
        out.hypotheses.resize_with(self.hypotheses.len(), Hypothesis::default);
        let readable: Vec<_> = (0..self.hypotheses.len()).map(|j| self.readable(j)).collect();
        let mut logs = (Vec::new(), Vec::new());
        let mut others = (Vec::new(), Vec::new());
        for ((to_fill, hypothesis), readable) in
            out.hypotheses.iter_mut().zip(&self.hypotheses).zip(&readable)
        {
            let Hypothesis { logs: logs_to_fill, shifts, information } = to_fill;
            shifts.resize_with(N - 2, Vec::new);
            information.clone_from(&hypothesis.information);
            logs_to_fill.resize(to.len(), 0.0);
            logs.0.push(&readable.logs[..]);
            logs.1.push(&mut logs_to_fill[..]);
            for (column, to_fill) in readable.shifts.iter().zip(shifts) {
                to_fill.resize(to.len(), 0.0);
                others.0.push(&column[..]);
                others.1.push(&mut to_fill[..]);
            }
            for (column, to_fill) in hypothesis.information.iter().zip(information) {
                if let (Column::Each(column), Column::Each(to_fill)) = (column, to_fill) {
                    to_fill.resize(to.len(), 0.0);
                    others.0.push(column);
                    others.1.push(&mut to_fill[..]);
                }
            }
        }
        let (origin, steps) = to.in_coordinates_of(from);
        run(Reading {
            origin,
            steps,
            sides: [from.side(), to.side()],
            logs: (&logs.0, &mut logs.1),
            others: (&others.0, &mut others.1),
        });
        (0..self.hypotheses.len()).for_each(|j| out.read_back(j));
        let last = number(from.side()) - 0.5;
        let beyond = |index: usize| {
            let cell = Vector2::new(number(index % to.side()), number(index / to.side()));
            let at = origin + steps * cell;
            at - at.map(|c| c.clamp(-0.5, last))
        };
        // The old cells are convex: they hold all that lies between new ones that they hold.
        let corners = [0, to.side() - 1, to.len() - to.side(), to.len() - 1];
        if corners.into_iter().all(|corner| beyond(corner).norm_squared() <= 0.0) {
            return;
        }
        for index in 0..to.len() {
            let beyond = beyond(index);
            if beyond.norm_squared() > 0.0 {
                let fall = fall(&(from.steps() * beyond));
                out.hypotheses.iter_mut().for_each(|hypothesis| hypothesis.logs[index] += fall);
            }
        }
    }
}

impl<const N: usize> Columns<N> {
    /// Puts the nearest old cell's belief into each new cell beside a cliff, where the old cells
    /// about it disagree about a component behind the place by more than they are certain of it: to
    /// read η and l between them would make a peak of what none of them believes.
    pub(super) fn keep_cliffs(&self, from: &Lattice, to: &Lattice, out: &mut Self) {
        let (origin, steps) = to.in_coordinates_of(from);
        for index in 0..to.len() {
            let cell = Vector2::new(number(index % to.side()), number(index / to.side()));
            let at = origin + steps * cell;
            let last = number(from.side() - 1);
            if at.iter().any(|c| !(-0.5..=last + 0.5).contains(c)) {
                continue;
            }
            let place = Place::at(&at, from.side());
            let nearest = place.nearest(from.side());
            let disagree = |hypothesis: &Hypothesis| {
                hypothesis.shifts.iter().enumerate().any(|(i, shifts)| {
                    // The diagonal of Λ among its rows up to that.
                    let information = hypothesis.information[i * (i + 3) / 2].at(nearest);
                    let range = place.range(shifts, from.side());
                    range * range > CLIFF * information
                })
            };
            if !self.hypotheses.iter().any(disagree) {
                continue;
            }
            for (new, old) in out.hypotheses.iter_mut().zip(&self.hypotheses) {
                new.logs[index] = old.logs[nearest];
                for (new, old) in new.shifts.iter_mut().zip(&old.shifts) {
                    new[index] = old[nearest];
                }
                for (new, old) in new.information.iter_mut().zip(&old.information) {
                    if let (Column::Each(new), Column::Each(old)) = (new, old) {
                        new[index] = old[nearest];
                    }
                }
            }
        }
    }
}

/// Squared spread of a component's mean among 16 cells, in its variances, up to which it is read
/// between them: two standard deviations.
const CLIFF: f64 = 4.0;

/// The components behind the place in pairs, as the rows of Λ up to its diagonal.
fn behind() -> impl Iterator<Item = (usize, usize)> {
    (2..).flat_map(|i| (2..=i).map(move |j| (i, j)))
}

/// Returns the mean of the single component behind the place, 0 without information.
#[inline(always)]
fn mean_behind(shift: f64, information: f64) -> f64 {
    let mean = shift * (1.0 / information);
    if information > 0.0 { mean } else { 0.0 }
}

/// The log-density of a cell with a weight, one of 1 having `log_one`; what it was `before` where
/// the weight is too small for its number.
#[inline(always)]
fn log_density(weight: f64, log_one: f64, before: f64) -> f64 {
    let log = log_one + elementary::ln(weight);
    if weight >= f64::MIN_POSITIVE { log } else { before }
}

/// Change of l when a cell has a weight and the one component behind the place becomes less
/// certain, its mean staying.
struct Diffusion<'a, I> {
    weights: &'a [f64],
    log_one: f64,
    /// η and Λ before.
    shifts: &'a [f64],
    information_at: I,
    /// Addition to the component's variance.
    more: f64,
    logs: &'a mut [f64],
}

impl<I: Fn(usize) -> f64> Kernel for Diffusion<'_, I> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let columns = self.weights.iter().zip(self.shifts);
        for (index, (log, (weight, shift))) in self.logs.iter_mut().zip(columns).enumerate() {
            let information = (self.information_at)(index);
            let wider = wider(information, self.more);
            let before = *log + log_integral(*shift, information);
            let after = log_density(*weight, self.log_one, before);
            *log = after - log_integral(shift * (wider / information), wider);
        }
    }
}

/// Returns Λ of the single component behind the place when its variance grows by `more`.
#[inline(always)]
fn wider(information: f64, more: f64) -> f64 {
    1.0 / (1.0 / information + more)
}

/// ln ∫ exp(η n − ½ Λ n²) dn over the one component behind the place.
#[inline(always)]
fn log_integral(shift: f64, information: f64) -> f64 {
    let integral = 0.5 * (shift * shift * (1.0 / information) - elementary::ln(information / TAU));
    if information > 0.0 { integral } else { f64::NEG_INFINITY }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
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
        assert_abs_diff_eq!(cell.log_marginal(), -3.0, epsilon = 1e-14);
        let mut columns = Columns::<4>::new(2, 3, &Matrix4::identity());
        columns.set(1, 2, &cell);
        let (found, spread) = columns.cell(1, 2).conditional().expect("definite");
        assert!((found - mean).norm() < 1e-14);
        covariance[(0, 0)] = 0.0;
        covariance[(1, 1)] = 0.0;
        assert!((spread - covariance).norm() < 1e-14);
    }

    /// Cells that share Λ and cells that each have the same one.
    #[test]
    fn shared_information_is_as_each_cells_own() {
        let information = nalgebra::SMatrix::<f64, 5, 5>::from_fn(|i, j| match (i, j) {
            _ if i == j => 2.0,
            (2.., 2..) => 0.3,
            _ => 0.0,
        });
        let mut shared = Columns::<5>::new(1, 4, &information);
        for (row, shifts) in shared.hypotheses[0].shifts.iter_mut().enumerate() {
            shifts.iter_mut().enumerate().for_each(|(i, s)| *s = number(row + 2 * i) - 2.5);
        }
        shared.hypotheses[0].logs = vec![0.1, -0.2, 0.3, 0.0];
        let mut each = shared.clone();
        each.hypotheses[0].information.iter_mut().for_each(|column| {
            column.each_mut(4);
        });
        let close = |shared: &Columns<5>, each: &Columns<5>| {
            let marginals = [shared, each].map(|columns| {
                let mut out = vec![0.0; 4];
                columns.log_marginals(0, &mut out);
                out
            });
            let means = [shared, each].map(|columns| {
                let mut out = vec![vec![0.0; 4]; 3];
                columns.means(0, &mut out);
                out
            });
            let weights = [0.4, 0.1, 0.3, 0.2];
            let spreads = [shared, each].map(|columns| columns.spread(0, &weights));
            let pairs = marginals[0].iter().zip(&marginals[1]);
            let behind = means[0].iter().flatten().zip(means[1].iter().flatten());
            pairs.chain(behind).all(|(a, b)| (a - b).abs() < 1e-12)
                && (spreads[0] - spreads[1]).norm() < 1e-12
        };
        assert!(close(&shared, &each));
        let mut more = Covariance::zeros();
        (2..5).for_each(|i| more[(i, i)] = 0.1 * number(i));
        let weights = [0.5, 0.25, 0.0, 1.0];
        shared.diffuse(0, &weights, -1.0, &more).expect("definite");
        each.diffuse(0, &weights, -1.0, &more).expect("definite");
        assert!(shared.shared(0).is_some() && each.shared(0).is_none());
        assert!(close(&shared, &each));
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
        assert_abs_diff_eq!(libm::log(sum), cell.log_marginal(), epsilon = 1e-12);
    }
}
