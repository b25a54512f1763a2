use alloc::vec::Vec;
use core::f64::consts::{LN_2, TAU};

use nalgebra::{SMatrix, SVector};

use super::{fit::Fit, gain_table::GainTable, looks::Look, posterior::Node};
use crate::Antenna;

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
pub(super) struct TwoPaths<'a, A> {
    pub(super) fit: &'a Fit<'a, A>,
    pub(super) amplitude: &'a GainTable,
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

/// What two paths leave along one look, in dB, and how it changes with the unknowns.
struct Term {
    rest: f64,
    slopes: Vector,
}

impl<A: Antenna> TwoPaths<'_, A> {
    fn term(&self, look: &Look, unknowns: &Vector) -> Term {
        let (x, y) = (unknowns[IN_PHASE], unknowns[QUADRATURE]);
        let (direct, direct_slope) = self.amplitude.with_slope(unknowns[BEARING] - look.offset);
        let (other, other_slope) = self.amplitude.with_slope(unknowns[REFLECTION] - look.offset);
        let (re, im) = (direct + x * other, y * other);
        let power = (re * re + im * im).max(1e-12);
        let factor = DB / power;
        Term {
            rest: look.mean_dbm - unknowns[LEVEL] - 0.5 * DB * libm::log(power),
            slopes: Vector::from([
                factor * re * direct_slope,
                1.0,
                factor * (re * x + im * y) * other_slope,
                factor * re * other,
                factor * im * other,
            ]),
        }
    }

    fn at(&self, unknowns: &Vector) -> Paths {
        let prior = 1.0 / (AMPLITUDE_SIGMA * AMPLITUDE_SIGMA);
        let (mut normal, mut pull, mut cost) = (Matrix::zeros(), Vector::zeros(), 0.0);
        for (look, variance) in self.fit.looks.looks.iter().zip(&self.fit.variances) {
            let Term { rest, slopes } = self.term(look, unknowns);
            let scaled = slopes / *variance;
            cost += rest * rest / variance;
            pull += scaled * rest;
            normal += scaled * slopes.transpose();
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
        start: &Vector,
        fixed: usize,
        rounds: u32,
        tolerance: f64,
    ) -> Paths {
        let mut best = self.at(start);
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
            let next = self.at(&(best.unknowns + step));
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
        let looks = self.fit.looks.looks.iter();
        looks.map(|look| self.term(look, &paths.unknowns).rest).collect()
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
