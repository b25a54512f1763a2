use alloc::vec::Vec;
use core::f64::consts::{LN_2, TAU};

use foxhunt_core::elementary;
use nalgebra::{SMatrix, SVector};

use super::{fit::Fit, gain_table::GainTable, posterior::Node};

/// Unknowns of two paths: the bearing, the level, the reflection's bearing, and its amplitude over
/// the direct one's, in phase and in quadrature.
pub(super) const UNKNOWNS: usize = 5;
pub(super) const BEARING: usize = 0;
const LEVEL: usize = 1;
pub(super) const REFLECTION: usize = 2;
const IN_PHASE: usize = 3;
const QUADRATURE: usize = 4;

type Vector = SVector<f64, UNKNOWNS>;
type Matrix = SMatrix<f64, UNKNOWNS, UNKNOWNS>;

/// σ of the reflected amplitude's parts before a turn: 0.5 of the direct one in the root mean
/// square, and seldom more than it.
const AMPLITUDE_SIGMA: f64 = 0.35;

/// The inverse variance of a uniform density over a turn.
const TURN_PRECISION: f64 = 12.0 / (TAU * TAU);

/// 20 log₁₀ e.
pub(super) const DB: f64 = 20.0 * core::f64::consts::LOG10_E;

/// In one round no direction moves farther, in radians: the pattern there is another one.
const LONGEST: f64 = 0.35;

/// The direct wave with one reflection, added as amplitudes: P = |a(θ − φ) + z a(θ′ −
/// φ)|², with the antenna's amplitude a, the reflection's bearing θ′ and its complex amplitude
/// z, the same all round.
#[derive(Debug)]
pub(super) struct TwoPaths<'a> {
    amplitude: &'a GainTable,
    /// Every look.
    pub(super) fine: Columns,
    /// Neighbours taken for one look: as good to find out where to look closer.
    pub(super) coarse: Columns,
}

/// Looks in columns.
#[derive(Clone, Debug, Default)]
pub(super) struct Columns {
    offset: Vec<f64>,
    mean_dbm: Vec<f64>,
    /// 1 / the variance of the mean.
    precision: Vec<f64>,
}

/// So many looks show where two paths may come from; with half as many, directions that compete
/// were lost.
const COARSE: usize = 64;

impl Columns {
    fn push(&mut self, offset: f64, mean_dbm: f64, precision: f64) {
        self.offset.push(offset);
        self.mean_dbm.push(mean_dbm);
        self.precision.push(precision);
    }

    fn of<A>(fit: &Fit<'_, A>) -> Self {
        let mut columns = Self::default();
        for (look, variance) in fit.looks.looks.iter().zip(&fit.variances) {
            columns.push(look.offset, look.mean_dbm, 1.0 / variance);
        }
        columns
    }

    /// The same with neighbours taken together.
    fn coarse(&self) -> Self {
        let together = self.offset.len() / COARSE;
        if together < 2 {
            return self.clone();
        }
        let mut order: Vec<usize> = (0..self.offset.len()).collect();
        order.sort_unstable_by(|a, b| self.offset[*a].total_cmp(&self.offset[*b]));
        let mut columns = Self::default();
        for group in order.chunks(together) {
            let sum = |of: &dyn Fn(usize) -> f64| -> f64 {
                group.iter().map(|i| self.precision[*i] * of(*i)).sum()
            };
            let precision = sum(&|_| 1.0);
            let offset = sum(&|i| self.offset[i]) / precision;
            columns.push(offset, sum(&|i| self.mean_dbm[i]) / precision, precision);
        }
        columns
    }
}

/// Two paths laid against a turn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Paths {
    pub(super) unknowns: Vector,
    /// The weighted sum of squares of the residuals, and of the amplitude over its prior.
    pub(super) cost: f64,
    normal: Matrix,
    pull: Vector,
}

/// What two paths leave along one look, in dB, and how it changes with the unknowns but the level.
struct Term {
    rest: f64,
    slopes: [f64; 4],
}

/// The unknowns that [`Term::slopes`] are of.
const SLOPES: [usize; 4] = [BEARING, REFLECTION, IN_PHASE, QUADRATURE];

impl<'a> TwoPaths<'a> {
    pub(super) fn new<A>(fit: &Fit<'_, A>, amplitude: &'a GainTable) -> Self {
        let fine = Columns::of(fit);
        Self { amplitude, coarse: fine.coarse(), fine }
    }

    #[inline]
    fn term(&self, offset: f64, mean_dbm: f64, unknowns: &Vector) -> Term {
        let (x, y) = (unknowns[IN_PHASE], unknowns[QUADRATURE]);
        let (direct, direct_slope) = self.amplitude.with_slope(unknowns[BEARING] - offset);
        let (other, other_slope) = self.amplitude.with_slope(unknowns[REFLECTION] - offset);
        let (re, im) = (direct + x * other, y * other);
        let power = (re * re + im * im).max(1e-12);
        let factor = DB / power;
        Term {
            rest: mean_dbm - unknowns[LEVEL] - 0.5 * DB * elementary::ln(power),
            slopes: [
                factor * re * direct_slope,
                factor * (re * x + im * y) * other_slope,
                factor * re * other,
                factor * im * other,
            ],
        }
    }

    fn at(&self, looks: &Columns, unknowns: &Vector) -> Paths {
        let prior = 1.0 / (AMPLITUDE_SIGMA * AMPLITUDE_SIGMA);
        // The level's slope is 1: its products with the others are their sums.
        let (mut ones, mut rests, mut cost) = (0.0, 0.0, 0.0);
        let (mut sums, mut pulls, mut products) = ([0.0; 4], [0.0; 4], [[0.0; 4]; 4]);
        let columns = looks.offset.iter().zip(&looks.mean_dbm).zip(&looks.precision);
        for ((offset, mean_dbm), precision) in columns {
            let Term { rest, slopes } = self.term(*offset, *mean_dbm, unknowns);
            let weighted = precision * rest;
            ones += precision;
            rests += weighted;
            cost += weighted * rest;
            for i in 0..4 {
                let scaled = precision * slopes[i];
                sums[i] += scaled;
                pulls[i] += slopes[i] * weighted;
                for j in 0..=i {
                    products[i][j] += scaled * slopes[j];
                }
            }
        }
        let (mut normal, mut pull) = (Matrix::zeros(), Vector::zeros());
        (normal[(LEVEL, LEVEL)], pull[LEVEL]) = (ones, rests);
        for (i, row) in SLOPES.into_iter().enumerate() {
            pull[row] = pulls[i];
            (normal[(row, LEVEL)], normal[(LEVEL, row)]) = (sums[i], sums[i]);
            for (j, column) in SLOPES.into_iter().enumerate().take(i + 1) {
                (normal[(row, column)], normal[(column, row)]) = (products[i][j], products[i][j]);
            }
        }
        for part in [IN_PHASE, QUADRATURE] {
            cost += unknowns[part] * unknowns[part] * prior;
            normal[(part, part)] += prior;
            pull[part] -= prior * unknowns[part];
        }
        normal[(REFLECTION, REFLECTION)] += TURN_PRECISION;
        Paths { unknowns: *unknowns, cost, normal, pull }
    }

    /// Damped Gauss-Newton steps (Marquardt 1963) in the unknowns from `fixed` on; those before it
    /// stay. Ends where a round gains less than the tolerance.
    pub(super) fn descend(
        &self,
        looks: &Columns,
        start: &Vector,
        fixed: usize,
        rounds: u32,
        tolerance: f64,
    ) -> Paths {
        let mut best = self.at(looks, start);
        let mut damping = 1e-2;
        for _ in 0..rounds {
            let (mut normal, mut pull) = (best.normal, best.pull);
            for i in 0..UNKNOWNS {
                normal[(i, i)] *= 1.0 + damping;
            }
            for i in 0..fixed {
                normal.fill_row(i, 0.0);
                normal.fill_column(i, 0.0);
                normal[(i, i)] = 1.0;
                pull[i] = 0.0;
            }
            let Some(factor) = normal.cholesky() else { break };
            let mut step = factor.solve(&pull);
            let longest = step[BEARING].abs().max(step[REFLECTION].abs());
            if longest > LONGEST {
                step *= LONGEST / longest;
            }
            let next = self.at(looks, &(best.unknowns + step));
            if next.cost < best.cost {
                let gained = best.cost - next.cost;
                best = next;
                damping *= 0.2;
                if gained < tolerance {
                    break;
                }
            } else {
                damping = (damping * 10.0).max(1e-2);
            }
        }
        best
    }

    /// What the two paths leave of each look's mean, in dB.
    pub(super) fn residuals(&self, paths: &Paths) -> Vec<f64> {
        let looks = self.fine.offset.iter().zip(&self.fine.mean_dbm);
        looks.map(|(offset, mean)| self.term(*offset, *mean, &paths.unknowns).rest).collect()
    }
}

impl Paths {
    /// The reflected amplitude over the direct one.
    pub(super) fn ratio(&self) -> f64 {
        libm::hypot(self.unknowns[IN_PHASE], self.unknowns[QUADRATURE])
    }

    /// The log density at the bearing, with the other unknowns integrated out by Laplace's method:
    /// the level under a flat prior, as a single path has it.
    pub(super) fn node(&self, inflation: f64) -> Node {
        let nowhere = Node { log_density: f64::NEG_INFINITY, ..Node::default() };
        let Some(factor) = self.normal.fixed_view::<4, 4>(1, 1).into_owned().cholesky() else {
            return nowhere;
        };
        let lower = factor.l_dirty();
        let half_log_det: f64 = (0..4).map(|i| libm::log(lower[(i, i)])).sum();
        let level_variance = factor.solve(&SVector::<f64, 4>::x())[0] * inflation;
        let amplitude_prior = -2.0 * libm::log(AMPLITUDE_SIGMA) - libm::log(TAU);
        let direction_prior = -libm::log(TAU);
        // The wave that lags and the one that leads by as much fit alike.
        let volume = 1.5 * libm::log(TAU * inflation) + 0.5 * libm::log(inflation) + LN_2;
        let log_density =
            volume + amplitude_prior + direction_prior - 0.5 * self.cost / inflation - half_log_det;
        Node { log_density, level: self.unknowns[LEVEL], level_variance }
    }
}
