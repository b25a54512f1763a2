use alloc::vec::Vec;

use foxhunt_core::{
    Axis, Covariance, Estimate, State,
    angle::{self, Resultant},
};

use super::{
    divided::{Divided, Threads},
    white::CHUNK,
};
use crate::vectorised::{self, Kernel};

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
    pub(super) fn add_chunk(
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
    pub(super) fn and(mut self, other: &Self) -> Self {
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
            let part = self.columns.each_ref().map(|column| &column[first..first + weights.len()]);
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

#[cfg(test)]
mod tests {
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
        assert!((estimate.covariance[(1, 1)] - variance([0.5, 0.25, 0.25])).abs() < 1e-14);
        assert!((estimate.covariance[(0, 0)] - 2.75).abs() < 1e-14);
    }

    #[test]
    fn a_stray_first_particle_does_not_split_the_others() {
        // About 3.0, −0.3 and 0.1 lie on different sides.
        let columns = [alloc::vec![3.0, -0.3, 0.1]];
        let estimate = moments(&columns, &[0.0, 0.5, 0.5], &[Axis::Angle], Threads::One);
        assert!((estimate.mean[0] + 0.1).abs() < 1e-14, "{}", estimate.mean);
        assert!((estimate.covariance[0] - 0.04).abs() < 1e-14, "{}", estimate.covariance);
    }
}
