//! Likelihood of levels along a path, about a log-distance law with correlated shadowing.

use nalgebra::{Vector2, Vector3};

/// Number of earlier readings on which each is conditioned (Vecchia 1988): the nearest.
const NEIGHBOURS: usize = 8;

/// Mean and σ of the prior of the path-loss exponent: wide, as antennas bend the law too.
const EXPONENT: [f64; 2] = [2.6, 1.3];

/// Sum of squares of the prior of σ: half a reading of 4 dB.
const PRIOR_SQUARES: f64 = 8.0;

/// Shadowing: distance in metres over which its correlation falls to 1/e, and share of the variance
/// that is each reading's own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shadowing {
    pub(super) length_m: f64,
    pub(super) own_share: f64,
}

/// Places of readings, each with its nearest neighbours among the earlier ones.
pub(super) struct Neighbours {
    places: Vec<Vector3<f64>>,
    nearest: Vec<[usize; NEIGHBOURS]>,
}

impl Neighbours {
    pub(super) fn new(places: Vec<Vector3<f64>>) -> Self {
        let of = |index: usize| {
            let mut kept = [(f64::INFINITY, 0); NEIGHBOURS];
            let here = places.get(index).copied().unwrap_or_default();
            for (other, place) in places.iter().take(index).enumerate() {
                let square = (place - here).norm_squared();
                // The earlier of two that are as near stays, so that the order decides.
                if square >= kept[NEIGHBOURS - 1].0 {
                    continue;
                }
                let mut slot = NEIGHBOURS - 1;
                while slot > 0 && kept[slot - 1].0 > square {
                    kept[slot] = kept[slot - 1];
                    slot -= 1;
                }
                kept[slot] = (square, other);
            }
            kept.map(|(_, other)| other)
        };
        let nearest = (0..places.len()).map(of).collect();
        Self { places, nearest }
    }

    /// Returns the linear map that makes readings with this shadowing independent.
    pub(super) fn whitener(&self, shadowing: Shadowing) -> Whitener<'_> {
        let Shadowing { length_m, own_share } = shadowing;
        let shared = 1.0 - own_share;
        let covariance =
            |a: Vector3<f64>, b: Vector3<f64>| shared * (-(a - b).norm() / length_m).exp();
        let mut weights = vec![[0.0; NEIGHBOURS]; self.places.len()];
        let mut inverse_sigmas = vec![1.0; self.places.len()];
        let mut ln_determinant = 0.0;
        let rows = self.nearest.iter().zip(&self.places).enumerate();
        for ((index, (nearest, here)), (weights, inverse_sigma)) in
            rows.zip(weights.iter_mut().zip(&mut inverse_sigmas))
        {
            let count = index.min(NEIGHBOURS);
            let near = nearest.map(|other| self.places.get(other).copied().unwrap_or_default());
            let to_here = near.map(|place| covariance(place, *here));
            let mut factor = [[0.0; NEIGHBOURS]; NEIGHBOURS];
            for row in 0..count {
                for column in 0..=row {
                    let sum: f64 = (0..column).map(|k| factor[row][k] * factor[column][k]).sum();
                    factor[row][column] = if row == column {
                        (1.0 + 1e-9 - sum).max(1e-9).sqrt()
                    } else {
                        (covariance(near[row], near[column]) - sum) / factor[column][column]
                    };
                }
            }
            let mut half = [0.0; NEIGHBOURS];
            for row in 0..count {
                let sum: f64 = (0..row).map(|k| factor[row][k] * half[k]).sum();
                half[row] = (to_here[row] - sum) / factor[row][row];
            }
            let explained: f64 = half.iter().map(|value| value * value).sum();
            let variance = (1.0 - explained).max(1e-6);
            for row in (0..count).rev() {
                let sum: f64 = (row + 1..count).map(|k| factor[k][row] * weights[k]).sum();
                weights[row] = (half[row] - sum) / factor[row][row];
            }
            *inverse_sigma = 1.0 / variance.sqrt();
            ln_determinant += variance.ln();
        }
        Whitener { neighbours: self, weights, inverse_sigmas, ln_determinant }
    }
}

/// Linear map that makes readings with correlated errors independent, with errors of σ.
pub(super) struct Whitener<'a> {
    neighbours: &'a Neighbours,
    weights: Vec<[f64; NEIGHBOURS]>,
    inverse_sigmas: Vec<f64>,
    ln_determinant: f64,
}

impl Whitener<'_> {
    fn whitened(&self, values: &[f64], out: &mut Vec<f64>) {
        out.clear();
        let rows = self.neighbours.nearest.iter().zip(&self.weights).zip(&self.inverse_sigmas);
        out.extend(values.iter().zip(rows).map(|(value, ((nearest, weights), inverse))| {
            let known = nearest.iter().zip(weights);
            let known: f64 = known.map(|(other, w)| w * values.get(*other).unwrap_or(&0.0)).sum();
            (value - known) * inverse
        }));
    }

    /// Returns the readings as their likelihood over a place takes them.
    pub(super) fn readings(&self, levels_db: &[f64]) -> Readings<'_> {
        let mut ones = Vec::new();
        let mut levels = Vec::new();
        self.whitened(&vec![1.0; levels_db.len()], &mut ones);
        self.whitened(levels_db, &mut levels);
        let count = dot(&ones, &ones);
        let mean = dot(&ones, &levels) / count;
        levels.iter_mut().zip(&ones).for_each(|(level, one)| *level -= mean * one);
        let total = dot(&levels, &levels);
        Readings { whitener: self, ones, levels, count, total, losses: Vec::new(), own: Vec::new() }
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Readings made independent, less their mean.
pub(super) struct Readings<'a> {
    whitener: &'a Whitener<'a>,
    ones: Vec<f64>,
    levels: Vec<f64>,
    count: f64,
    total: f64,
    losses: Vec<f64>,
    own: Vec<f64>,
}

/// Region in which a place is looked for, and the finest step in metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    pub(super) middle: Vector2<f64>,
    pub(super) half_m: f64,
    pub(super) up_m: f64,
    pub(super) finest_m: f64,
}

impl Readings<'_> {
    /// Log-likelihood of a transmitter at a place, with the most likely power, exponent and σ.
    pub(super) fn at(&mut self, place: Vector2<f64>, up_m: f64) -> f64 {
        let target = place.push(up_m);
        self.losses.clear();
        let loss = |receiver: &Vector3<f64>| {
            -5.0 / std::f64::consts::LN_10 * (target - receiver).norm_squared().max(1.0).ln()
        };
        self.losses.extend(self.whitener.neighbours.places.iter().map(loss));
        self.whitener.whitened(&self.losses, &mut self.own);
        let mean = dot(&self.ones, &self.own) / self.count;
        let square = dot(&self.own, &self.own) - mean * mean * self.count;
        let product = dot(&self.own, &self.levels);
        let exponent = if square > 1e-9 { (product / square).max(0.0) } else { 0.0 };
        let left = self.total - 2.0 * exponent * product + exponent * exponent * square;
        let freedom = f64::from(u32::try_from(self.levels.len()).unwrap_or(u32::MAX)) - 2.0;
        let off = (exponent - EXPONENT[0]) / EXPONENT[1];
        -0.5 * (self.whitener.ln_determinant
            + freedom * (left.max(0.0) + PRIOR_SQUARES).ln()
            + off * off)
    }

    /// Returns the most likely place in a square, and its log-likelihood.
    pub(super) fn search(&mut self, search: &Search) -> (Vector2<f64>, f64) {
        let step = search.half_m / 5.0;
        let mut best = (search.middle, f64::NEG_INFINITY);
        for x in -5..=5_i32 {
            for y in -5..=5_i32 {
                let place = search.middle + Vector2::new(f64::from(x), f64::from(y)) * step;
                let value = self.at(place, search.up_m);
                if value > best.1 {
                    best = (place, value);
                }
            }
        }
        self.refine(best.0, step * 0.5, search)
    }

    /// Returns the most likely place near another one, by ever smaller steps.
    pub(super) fn refine(
        &mut self,
        from: Vector2<f64>,
        step_m: f64,
        search: &Search,
    ) -> (Vector2<f64>, f64) {
        let mut best = (from, self.at(from, search.up_m));
        let mut step = step_m;
        let mut tries = 0;
        while step >= search.finest_m && tries < 60 {
            tries += 1;
            let middle = best.0;
            for (x, y) in [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, -1), (1, -1), (-1, 1)] {
                let place = middle + Vector2::new(f64::from(x), f64::from(y)) * step;
                let off = (place - search.middle).amax();
                let value = self.at(place, search.up_m);
                if off <= search.half_m && value > best.1 {
                    best = (place, value);
                }
            }
            if best.0 == middle {
                step *= 0.5;
            }
        }
        best
    }
}
