//! Steps of a cloud, and the moments of what comes of them.

use alloc::vec::Vec;

use foxhunt_core::{
    Axis, Covariance, Estimate, MeasurementModel, MotionModel, State,
    angle::{self, Resultant},
    columns,
};

#[cfg(feature = "parallel")]
use super::on_threads;
use super::{
    CHUNK, Divided, Evidence, Modelled, Multiply, Threads, one_by_one, take_first,
    white::{self, Draws},
};
use crate::vectorised::{self, Kernel};

/// Carries a cloud on into other columns, a chunk after the other, each with random numbers of its
/// own. Returns the moments of what comes of it, if its weights are known and no axis is an angle.
pub(super) struct Step<'a, F, const N: usize> {
    pub key: u64,
    pub from: &'a [Vec<f64>; N],
    pub to: [&'a mut [f64]; N],
    /// The first particle in `to`, at the beginning of a chunk.
    pub first: usize,
    /// Indices of the particles to copy; `None` keeps each one.
    pub ancestors: Option<&'a [u32]>,
    /// Sets them apart first.
    pub kernel: Option<&'a white::Kernel<N>>,
    /// Moves them then, for so long.
    pub motion: Option<(&'a F, f64)>,
    pub axes: [Axis; N],
    /// Weights of the resulting particles.
    pub weights: Option<&'a [f64]>,
}

impl<F: MotionModel<N>, const N: usize> Kernel for Step<'_, F, N> {
    type Output = Option<Moments<N>>;

    #[inline(always)]
    fn run(mut self) -> Option<Moments<N>> {
        let count = self.to[0].len();
        let mut draws = Draws::new(self.key);
        let mut white = [[0.0; CHUNK]; N];
        let weights = self.weights.filter(|_| !self.axes.contains(&Axis::Angle));
        let mut moments = Moments::default();
        for begin in (0..count).step_by(CHUNK) {
            let range = begin..count.min(begin + CHUNK);
            let chunk = (self.first + begin) / CHUNK;
            let mut to = columns::rows_mut(&mut self.to, range.clone());
            for (to, from) in to.iter_mut().zip(self.from) {
                match self.ancestors {
                    None => {
                        let first = self.first + begin;
                        to.copy_from_slice(&from[first..first + range.len()]);
                    }
                    Some(ancestors) => {
                        for (to, ancestor) in to.iter_mut().zip(&ancestors[range.clone()]) {
                            *to = from[*ancestor as usize];
                        }
                    }
                }
            }
            if let Some(kernel) = self.kernel {
                draws.fill_white(2 * chunk, &mut white, range.len());
                kernel.spread_columns(&mut to, &white);
            }
            if let Some((motion, dt)) = self.motion {
                draws.fill_white(2 * chunk + 1, &mut white, range.len());
                let white = columns::rows(&white, 0..range.len());
                motion.move_columns(columns::slices_mut(&mut to), white, dt);
            }
            for (column, axis) in to.iter_mut().zip(self.axes) {
                if axis == Axis::Angle {
                    column.iter_mut().for_each(|x| *x = angle::wrap(*x));
                }
            }
            if let Some(weights) = weights {
                // The draws have been used.
                let to = columns::slices(&to);
                moments.add_chunk(to, &weights[range], [None; N], &mut white);
            }
        }
        weights.map(|_| moments)
    }
}

impl<F: MotionModel<N>, const N: usize> Divided for Step<'_, F, N> {
    fn particles(&self) -> usize {
        self.to[0].len()
    }

    fn split_at(mut self, particles: usize) -> (Self, Self) {
        let to = self.to.each_mut().map(|column| take_first(column, particles));
        let ancestors = self.ancestors.map(|ancestors| ancestors.split_at(particles));
        let weights = self.weights.map(|weights| weights.split_at(particles));
        let first = Self {
            to,
            ancestors: ancestors.map(|(first, _)| first),
            weights: weights.map(|(first, _)| first),
            ..self
        };
        let second = Self {
            to: self.to,
            first: self.first + particles,
            ancestors: ancestors.map(|(_, second)| second),
            weights: weights.map(|(_, second)| second),
            ..self
        };
        (first, second)
    }

    fn join(first: Self::Output, second: Self::Output) -> Self::Output {
        first.zip(second).map(|(first, second)| first.and(&second))
    }
}

/// Functions and threads that work on a cloud. Functions, as models may be used on other threads
/// only where they are `Sync`, which is no bound of the filter.
#[derive(Clone, Debug)]
pub(super) struct Workers<F, H, const N: usize, const M: usize> {
    pub step: fn(Step<'_, F, N>) -> Option<Moments<N>>,
    pub multiply: fn(Multiply<'_, Modelled<'_, H, N, M>>) -> Evidence,
    pub threads: Threads,
}

impl<F: MotionModel<N>, H: MeasurementModel<N, M>, const N: usize, const M: usize>
    Workers<F, H, N, M>
{
    /// The thread that steps the filter.
    pub(super) fn one() -> Self {
        Self {
            step: |work| one_by_one(work),
            multiply: |work| one_by_one(work),
            threads: Threads::One,
        }
    }

    /// The threads of the current pool.
    #[cfg(feature = "parallel")]
    pub(super) fn pool() -> Self
    where
        F: Sync,
        H: Sync,
    {
        Self {
            step: |work| on_threads(work),
            multiply: |work| on_threads(work),
            threads: Threads::Pool,
        }
    }
}

/// The weight of some particles, their mean, and their weighted squares about it.
pub(super) struct Moments<const N: usize> {
    weight: f64,
    mean: State<N>,
    scatter: Covariance<N>,
}

impl<const N: usize> Default for Moments<N> {
    fn default() -> Self {
        Self { weight: 0.0, mean: State::zeros(), scatter: Covariance::zeros() }
    }
}

impl<const N: usize> Moments<N> {
    /// Adds the particles of a chunk, each angle about its origin; `space` is for their deviations.
    #[inline(always)]
    fn add_chunk(
        &mut self,
        columns: [&[f64]; N],
        weights: &[f64],
        origin: [Option<f64>; N],
        space: &mut [[f64; CHUNK]; N],
    ) {
        let mut part = Self { weight: vectorised::sum(weights), ..Self::default() };
        for (row, column) in columns.into_iter().enumerate() {
            let deviations = &mut space[row][..weights.len()];
            let mean = match origin[row] {
                None => vectorised::dot(column, weights),
                Some(origin) => {
                    for (deviation, x) in deviations.iter_mut().zip(column) {
                        *deviation = angle::wrap(x - origin);
                    }
                    vectorised::dot(deviations, weights)
                }
            };
            let mean = if part.weight > 0.0 { mean / part.weight } else { 0.0 };
            part.mean[row] = mean;
            match origin[row] {
                None => {
                    for (deviation, x) in deviations.iter_mut().zip(column) {
                        *deviation = x - mean;
                    }
                }
                Some(_) => deviations.iter_mut().for_each(|deviation| *deviation -= mean),
            }
        }
        let mut weighted = [0.0; CHUNK];
        let weighted = &mut weighted[..weights.len()];
        for row in 0..N {
            for ((weighted, own), weight) in weighted.iter_mut().zip(&space[row]).zip(weights) {
                *weighted = own * weight;
            }
            for (column, other) in space.iter().enumerate().take(row + 1) {
                let product = vectorised::dot(weighted, &other[..weights.len()]);
                part.scatter[(row, column)] = product;
                part.scatter[(column, row)] = product;
            }
        }
        self.add(&part);
    }

    /// Returns the estimate, if all weights have been added.
    pub(super) fn estimate(&self) -> Estimate<N> {
        Estimate { mean: self.mean, covariance: self.scatter }
    }

    /// Merges the moments of two disjoint sets of particles.
    fn and(mut self, other: &Self) -> Self {
        self.add(other);
        self
    }

    /// Adds the moments of other particles (Chan, Golub & LeVeque 1979).
    fn add(&mut self, other: &Self) {
        let weight = self.weight + other.weight;
        if weight > 0.0 {
            let apart = other.mean - self.mean;
            self.mean += apart * (other.weight / weight);
            self.scatter += other.scatter;
            self.scatter += apart * (apart * (self.weight * other.weight / weight)).transpose();
            self.weight = weight;
        }
    }
}

/// Sums up the moments of a cloud from a particle on, its angles about an origin.
struct Sum<'a, const N: usize> {
    columns: &'a [Vec<f64>; N],
    first: usize,
    weights: &'a [f64],
    origin: [Option<f64>; N],
}

impl<const N: usize> Kernel for Sum<'_, N> {
    type Output = Moments<N>;

    #[inline(always)]
    fn run(self) -> Moments<N> {
        let mut all = Moments::default();
        let mut space = [[0.0; CHUNK]; N];
        for (chunk, weights) in self.weights.chunks(CHUNK).enumerate() {
            let first = self.first + chunk * CHUNK;
            let part = columns::rows(self.columns, first..first + weights.len());
            all.add_chunk(part, weights, self.origin, &mut space);
        }
        all
    }
}

impl<const N: usize> Divided for Sum<'_, N> {
    fn particles(&self) -> usize {
        self.weights.len()
    }

    fn split_at(self, particles: usize) -> (Self, Self) {
        let (before, weights) = self.weights.split_at(particles);
        let first = self.first + particles;
        (Self { weights: before, ..self }, Self { weights, first, ..self })
    }

    fn join(first: Moments<N>, second: Moments<N>) -> Moments<N> {
        first.and(&second)
    }
}

/// The weighted mean and covariance of states in columns.
///
/// Deviations on an angle are taken about the direction of the cloud's resultant, so that neither
/// ±π nor a stray particle matters; where the directions cancel, about the first state.
pub(super) fn moments<const N: usize>(
    columns: &[Vec<f64>; N],
    weights: &[f64],
    axes: &[Axis; N],
    threads: Threads,
) -> Estimate<N> {
    let origin = core::array::from_fn(|row| match axes[row] {
        Axis::Linear => None,
        Axis::Angle => {
            let mut resultant = Resultant::default();
            columns[row].iter().zip(weights).for_each(|(angle, w)| resultant.add(*angle, *w));
            Some(resultant.direction(1e-9).unwrap_or(columns[row][0]))
        }
    });
    let mut estimate = threads.run(Sum { columns, first: 0, weights, origin }).estimate();
    for (mean, origin) in estimate.mean.iter_mut().zip(origin) {
        *mean = origin.map_or(*mean, |origin| angle::wrap(*mean + origin));
    }
    estimate
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use foxhunt_core::nalgebra::Vector2;

    use super::*;

    #[test]
    fn moments_of_a_cloud_across_the_cut() {
        let axes = [Axis::Linear, Axis::Angle];
        let columns = [alloc::vec![1.0, 3.0, 5.0], alloc::vec![-3.1, 3.1, 3.0]];
        let estimate = moments(&columns, &[0.5, 0.25, 0.25], &axes, Threads::One);
        // By hand: the angles are −3.1, −3.1832 and −3.2832, unwrapped.
        let turned: [f64; 3] = [-3.1, 3.1 - core::f64::consts::TAU, 3.0 - core::f64::consts::TAU];
        let angle = 0.5 * turned[0] + 0.25 * (turned[1] + turned[2]);
        let mean = Vector2::new(2.5, foxhunt_core::angle::wrap(angle));
        assert!((estimate.mean - mean).norm() < 1e-14, "{}", estimate.mean);
        let variance = |w: [f64; 3]| -> f64 {
            w.iter().zip(turned).map(|(w, t)| w * (t - angle) * (t - angle)).sum()
        };
        assert_abs_diff_eq!(
            estimate.covariance[(1, 1)],
            variance([0.5, 0.25, 0.25]),
            epsilon = 1e-14
        );
        assert_abs_diff_eq!(estimate.covariance[(0, 0)], 2.75, epsilon = 1e-14);
    }

    #[test]
    fn a_skewed_cloud_has_its_mean_across_the_cut() {
        // The resultant looks short of π, the mean lies beyond it.
        let columns = [alloc::vec![2.885, -2.318]];
        let estimate = moments(&columns, &[0.75, 0.25], &[Axis::Angle], Threads::One);
        let mean = 0.75 * 2.885 + 0.25 * (core::f64::consts::TAU - 2.318);
        assert_abs_diff_eq!(estimate.mean[0], mean - core::f64::consts::TAU, epsilon = 1e-14);
    }

    #[test]
    fn a_stray_first_particle_does_not_split_the_others() {
        // About 3.0, −0.3 and 0.1 lie on different sides.
        let columns = [alloc::vec![3.0, -0.3, 0.1]];
        let estimate = moments(&columns, &[0.0, 0.5, 0.5], &[Axis::Angle], Threads::One);
        assert_abs_diff_eq!(estimate.mean[0], -0.1, epsilon = 1e-14);
        assert_abs_diff_eq!(estimate.covariance[0], 0.04, epsilon = 1e-14);
    }
}
