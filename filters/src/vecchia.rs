//! Readings along a path whose errors are correlated by place, made independent by Vecchia's
//! approximation: each given the nearest of the earlier ones (Vecchia 1988, "Estimation and model
//! identification for continuous spatial processes").

use alloc::vec::Vec;

use foxhunt_core::{Pose, elementary};
use nalgebra::{SMatrix, SVector};

/// Correlation of two readings, `C_ij = (1 − nugget) exp(−D_ij/ℓ) + nugget δ_ij / n_i`, D the
/// distance and n the number of readings behind each (Gudmundson 1991, "Correlation model for
/// shadow fading in mobile radio systems").
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Correlation {
    /// ℓ, the distance in metres over which the correlation falls to 1/e.
    pub length_m: f64,
    /// The share of the variance that is each reading's own, from 0 to 1.
    pub nugget: f64,
}

/// Receivers, each with the number of readings behind its value.
#[derive(Clone, Copy, Debug)]
pub struct Receivers<'a> {
    /// The poses, of which the positions count, in metres.
    pub poses: &'a [Pose],
    /// The number of readings behind each value, at least as many as poses.
    pub counts: &'a [f64],
}

impl Correlation {
    /// The correlation of the readings of two receivers.
    pub(crate) fn shared(&self, a: &Pose, b: &Pose) -> f64 {
        (1.0 - self.nugget) * elementary::exp(-(a.position - b.position).norm() / self.length_m)
    }

    /// The variance of a value, of 1 for a single reading.
    pub(crate) fn variance(&self, count: f64) -> f64 {
        1.0 - self.nugget + self.nugget / count
    }

    /// The weights of the readings `near` in the mean of one at `receiver`, and its variance given
    /// them; `None` where the correlation is not positive definite.
    pub(crate) fn given<const N: usize>(
        &self,
        near: &[u32],
        of: Receivers<'_>,
        receiver: &Pose,
        count: f64,
    ) -> Option<(SVector<f64, N>, f64)> {
        // Rows and columns beyond the neighbours stay those of the unit matrix.
        let mut among = SMatrix::<f64, N, N>::identity();
        let mut with = SVector::<f64, N>::zeros();
        for (row, a) in near.iter().enumerate() {
            let a = *a as usize;
            let at = of.poses.get(a)?;
            with[row] = self.shared(at, receiver);
            among[(row, row)] = self.variance(*of.counts.get(a)?);
            for (column, b) in near.iter().enumerate().take(row) {
                among[(row, column)] = self.shared(at, of.poses.get(*b as usize)?);
            }
        }
        // The factor reads the lower triangle alone.
        let weights = among.cholesky()?.solve(&with);
        let variance = self.variance(count) - weights.dot(&with);
        (variance > LEAST_VARIANCE).then_some((weights, variance))
    }
}

/// The `N` nearest readings of each one, or fewer, among the earlier ones or among others.
#[derive(Clone, Debug, Default)]
pub struct Neighbours<const N: usize> {
    /// Indices of the neighbours of all readings, one reading behind the other.
    indices: Vec<u32>,
    /// The end of each reading's part of `indices`.
    ends: Vec<usize>,
}

impl<const N: usize> Neighbours<N> {
    /// Finds the nearest earlier readings of each, by place; of two that are as near the earlier
    /// one.
    #[must_use]
    pub fn new(receivers: &[Pose]) -> Self {
        let mut neighbours = Self::default();
        for (i, receiver) in receivers.iter().enumerate() {
            neighbours.add(receiver, receivers.get(..i).unwrap_or_default());
        }
        neighbours
    }

    /// Finds the nearest of the others for each.
    pub(crate) fn among<'a>(receivers: impl Iterator<Item = &'a Pose>, others: &[Pose]) -> Self {
        let mut neighbours = Self::default();
        receivers.for_each(|receiver| neighbours.add(receiver, others));
        neighbours
    }

    fn add(&mut self, receiver: &Pose, others: &[Pose]) {
        let mut nearest = [(f64::INFINITY, 0); N];
        for (other, number) in others.iter().zip(0_u32..) {
            let square = (other.position - receiver.position).norm_squared();
            if nearest.last().is_some_and(|last| square < last.0) {
                let at = nearest.partition_point(|(known, _)| *known <= square);
                nearest[at..].rotate_right(1);
                nearest[at] = (square, number);
            }
        }
        self.indices.extend(nearest.iter().take(others.len()).map(|(_, number)| *number));
        self.ends.push(self.indices.len());
    }

    /// The neighbours of each reading.
    pub(crate) fn each(&self) -> impl Iterator<Item = &[u32]> {
        let begins = core::iter::once(0).chain(self.ends.iter().copied());
        let parts = begins.zip(&self.ends);
        parts.map(|(begin, end)| self.indices.get(begin..*end).unwrap_or_default())
    }
}

/// The inverse factor of the readings' correlation: each reading given its nearest earlier ones.
/// Exact up to `N` + 1 readings.
#[derive(Clone, Debug)]
pub struct Whitener<const N: usize> {
    neighbours: Neighbours<N>,
    /// The weight of each of `neighbours`' indices in the mean of its reading.
    weights: Vec<f64>,
    /// 1 / the standard deviation of each reading given its neighbours.
    scales: Vec<f64>,
    /// ½ ln |C|.
    half_log_determinant: f64,
}

impl<const N: usize> Whitener<N> {
    /// Factors a correlation; `None` where it is not positive definite.
    #[must_use]
    pub fn new(
        receivers: Receivers<'_>,
        neighbours: &Neighbours<N>,
        correlation: Correlation,
    ) -> Option<Self> {
        let mut weights = Vec::with_capacity(neighbours.indices.len());
        let mut scales = Vec::with_capacity(receivers.poses.len());
        let mut half_log_determinant = 0.0;
        let each = receivers.poses.iter().zip(receivers.counts);
        for ((receiver, count), near) in each.zip(neighbours.each()) {
            let (solved, variance) = correlation.given::<N>(near, receivers, receiver, *count)?;
            weights.extend(solved.iter().take(near.len()));
            scales.push(1.0 / libm::sqrt(variance));
            half_log_determinant += 0.5 * libm::log(variance);
        }
        Some(Self { neighbours: neighbours.clone(), weights, scales, half_log_determinant })
    }

    /// Adds a reading that is independent of all others, behind them.
    pub(crate) fn with_independent(mut self, variance: f64) -> Self {
        self.neighbours.ends.push(self.neighbours.indices.len());
        self.scales.push(1.0 / libm::sqrt(variance));
        self.half_log_determinant += 0.5 * libm::log(variance);
        self
    }

    /// ½ ln |C|.
    #[must_use]
    pub fn half_log_determinant(&self) -> f64 {
        self.half_log_determinant
    }

    /// Replaces X by L⁻¹ X: what of each row its neighbours do not tell, in its own σ. A row is a
    /// reading's `L` right-hand sides.
    pub fn whiten<const L: usize>(&self, x: &mut [[f64; L]]) {
        // From the last to the first, as each needs the earlier rows as they were.
        let Neighbours { indices, ends } = &self.neighbours;
        for (i, (end, scale)) in ends.iter().zip(&self.scales).enumerate().rev() {
            let begin = i.checked_sub(1).and_then(|before| ends.get(before)).copied();
            let part = begin.unwrap_or(0)..*end;
            let near = indices.get(part.clone()).unwrap_or_default();
            let weights = self.weights.get(part).unwrap_or_default();
            let Some((earlier, open)) = x.split_at_mut_checked(i) else { continue };
            let Some(target) = open.first_mut() else { continue };
            let mut sum = *target;
            for (index, weight) in near.iter().zip(weights) {
                let Some(known) = earlier.get(*index as usize) else { continue };
                for (sum, known) in sum.iter_mut().zip(known) {
                    *sum -= weight * known;
                }
            }
            *target = sum.map(|sum| sum * scale);
        }
    }
}

/// The variance of a reading given its neighbours, of 1, below which it is rounding.
const LEAST_VARIANCE: f64 = 1e-12;

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use nalgebra::DMatrix;

    use super::*;

    const LANES: usize = 16;

    #[test]
    fn the_whitened_product_is_that_of_the_inverse_correlation() {
        let receivers: Vec<_> = [(0.0, 0.0), (10.0, 5.0), (40.0, -3.0), (12.0, 5.0), (0.0, 30.0)]
            .map(|(east, north)| Pose::at(east, north, 20.0 + east))
            .to_vec();
        let of = Receivers { poses: &receivers, counts: &[1.0; 5] };
        let correlation = Correlation { length_m: 25.0, nugget: 0.2 };
        let whitener = Whitener::new(of, &Neighbours::<12>::new(&receivers), correlation)
            .expect("positive definite");
        let mut x = [[0.0; LANES]; 5];
        for (phase, entry) in (0..80_u8).zip(x.as_flattened_mut()) {
            *entry = libm::sin(0.7 * f64::from(phase) + 0.1 * f64::from(phase % 7));
        }
        // Written out anew, from the model's definition.
        let c = DMatrix::from_fn(5, 5, |i, j| {
            let apart = receivers[i].position - receivers[j].position;
            let apart_m = libm::sqrt(apart.dot(&apart));
            0.8 * libm::exp(-apart_m / 25.0) + if i == j { 0.2 } else { 0.0 }
        });
        let dense = DMatrix::from_fn(5, LANES, |i, k| x[i][k]);
        let expected = dense.transpose() * c.clone().lu().solve(&dense).expect("regular");
        whitener.whiten(&mut x);
        let white = DMatrix::from_fn(5, LANES, |i, k| x[i][k]);
        assert!((white.transpose() * white - expected).norm() < 1e-12);
        assert_abs_diff_eq!(
            2.0 * whitener.half_log_determinant(),
            libm::log(c.determinant()),
            epsilon = 1e-12
        );
    }

    #[test]
    fn coinciding_places_need_a_nugget() {
        let receivers = [Pose::at(1.0, 2.0, 3.0); 2];
        let near = Neighbours::<12>::new(&receivers);
        let of = Receivers { poses: &receivers, counts: &[1.0; 2] };
        let with = |nugget| Whitener::new(of, &near, Correlation { length_m: 25.0, nugget });
        assert!(with(0.0).is_none());
        assert!(with(0.1).is_some());
    }

    #[test]
    fn the_neighbours_are_the_nearest_of_those_before() {
        let at = |i: u16| Pose::at(f64::from((i * 37) % 101), f64::from((i * 53) % 89), 0.0);
        let receivers: Vec<_> = (0..60).map(at).collect();
        for (i, near) in Neighbours::<12>::new(&receivers).each().enumerate() {
            let apart = |j: usize| (receivers[j].position - receivers[i].position).norm();
            let mut all: Vec<f64> = (0..i).map(apart).collect();
            all.sort_by(f64::total_cmp);
            all.truncate(12);
            let found: Vec<f64> = near.iter().map(|j| apart(*j as usize)).collect();
            assert_eq!(found, all, "{i}");
        }
    }

    #[test]
    fn a_mean_of_many_readings_has_less_noise_of_its_own() {
        let receivers = [Pose::at(0.0, 0.0, 0.0), Pose::at(1e4, 0.0, 0.0)];
        let near = Neighbours::<12>::new(&receivers);
        let of = Receivers { poses: &receivers, counts: &[1.0, 4.0] };
        let whitener = Whitener::new(of, &near, Correlation { length_m: 20.0, nugget: 0.8 });
        let mut x = [[1.0; LANES]; 2];
        whitener.expect("positive definite").whiten(&mut x);
        let variances = x.map(|row| 1.0 / (row[0] * row[0]));
        assert_abs_diff_eq!(variances[0], 1.0, epsilon = 1e-12);
        assert_abs_diff_eq!(variances[1], 0.4, epsilon = 1e-12);
    }
}
