//! Likelihood of levels along a path, about a log-distance law with correlated shadowing.

use foxhunt_core::Pose;
use foxhunt_filters::vecchia::{Correlation, Neighbours, Receivers, Whitener};
use nalgebra::Vector2;

use super::super::loss_db;

/// Number of earlier readings on which each is conditioned: the nearest.
const NEIGHBOURS: usize = 8;

/// Mean and σ of the prior of the path-loss exponent: wide, as antennas bend the law too.
const EXPONENT: [f64; 2] = [2.6, 1.3];

/// Sum of squares of the prior of σ: half a reading of 4 dB.
const PRIOR_SQUARES: f64 = 8.0;

/// Places of readings along a path, in the order of time.
pub(super) struct Places {
    poses: Vec<Pose>,
    /// Number of readings behind each level.
    counts: Vec<f64>,
    neighbours: Neighbours<NEIGHBOURS>,
}

impl Places {
    pub(super) fn new(poses: Vec<Pose>) -> Self {
        Self { counts: vec![1.0; poses.len()], neighbours: Neighbours::new(&poses), poses }
    }

    /// Returns the readings with levels at these places, as their likelihood over a transmitter's
    /// place takes them; `None` where places coincide and nothing of the variance is each
    /// reading's own.
    pub(super) fn readings(
        &self,
        levels_db: &[f64],
        shadowing: Correlation,
    ) -> Option<Readings<'_>> {
        let receivers = Receivers { poses: &self.poses, counts: &self.counts };
        let whitener = Whitener::new(receivers, &self.neighbours, shadowing)?;
        // A column of ones and the levels.
        let mut rows: Vec<[f64; 2]> = levels_db.iter().map(|level| [1.0, *level]).collect();
        whitener.whiten(&mut rows);
        let ones: Vec<f64> = rows.iter().map(|[one, _]| *one).collect();
        let mut levels: Vec<f64> = rows.iter().map(|[_, level]| *level).collect();
        let count = dot(&ones, &ones);
        let mean = dot(&ones, &levels) / count;
        levels.iter_mut().zip(&ones).for_each(|(level, one)| *level -= mean * one);
        let total = dot(&levels, &levels);
        Some(Readings { poses: &self.poses, whitener, ones, levels, count, total, own: Vec::new() })
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Readings made independent, less their mean.
pub(super) struct Readings<'a> {
    poses: &'a [Pose],
    whitener: Whitener<NEIGHBOURS>,
    ones: Vec<f64>,
    levels: Vec<f64>,
    count: f64,
    total: f64,
    /// Losses over the way to a place, scratch space.
    own: Vec<[f64; 1]>,
}

/// Region in which a place is looked for, and the finest step in metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    pub middle: Vector2<f64>,
    pub half_m: f64,
    pub up_m: f64,
    pub finest_m: f64,
}

impl Readings<'_> {
    /// Log-likelihood of a transmitter at a place, with the most likely power, exponent and σ.
    pub(super) fn at(&mut self, place: Vector2<f64>, up_m: f64) -> f64 {
        let target = place.push(up_m);
        let loss = |receiver: &Pose| [loss_db(&(target - receiver.position))];
        self.own.clear();
        self.own.extend(self.poses.iter().map(loss));
        self.whitener.whiten(&mut self.own);
        let own = self.own.as_flattened();
        let mean = dot(&self.ones, own) / self.count;
        let square = dot(own, own) - mean * mean * self.count;
        let product = dot(own, &self.levels);
        let exponent = if square > 1e-9 { (product / square).max(0.0) } else { 0.0 };
        let left = self.total - 2.0 * exponent * product + exponent * exponent * square;
        let freedom = f64::from(u32::try_from(self.levels.len()).unwrap_or(u32::MAX)) - 2.0;
        let off = (exponent - EXPONENT[0]) / EXPONENT[1];
        -0.5 * (2.0 * self.whitener.half_log_determinant()
            + freedom * libm::log(left.max(0.0) + PRIOR_SQUARES)
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
