use std::collections::BTreeMap;

use foxhunt_core::{Belief, Estimate};
use nalgebra::{Matrix2, Vector2};

/// Below this many samples a belief is taken for one place.
const LEAST_SAMPLES: usize = 100;

/// Probability of the likeliest samples that are looked at; the others join parts by their tails.
const HELD: f64 = 0.995;

/// Parts of less probability than this are not reported.
const LEAST_PROBABILITY: f64 = 0.01;

/// Connected part of a belief.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Part {
    /// Probability that the transmitter is in it.
    pub probability: f64,
    /// Mean and covariance within it, in metres.
    pub estimate: Estimate<2>,
}

impl Part {
    /// Returns the density at the mean of a Gaussian with the part's probability and moments.
    pub(crate) fn density(&self) -> f64 {
        let area = self.estimate.covariance.determinant().sqrt();
        self.probability / (std::f64::consts::TAU * area)
    }
}

/// Returns the parts of a belief that do not touch, the densest first; a single part stands for a
/// belief in one piece, or one that its moments give.
///
/// The likeliest samples are sorted into squares, which are so large that neighbouring samples of a
/// grid come into the same square or into adjacent ones.
pub(crate) fn parts(belief: &dyn Belief) -> Vec<Part> {
    let whole = vec![Part { probability: 1.0, estimate: belief.position() }];
    let mut samples: Vec<(Vector2<f64>, f64)> = Vec::new();
    belief.visit_positions(&mut |place, weight| samples.push((*place, weight)));
    if samples.len() < LEAST_SAMPLES {
        return whole;
    }
    samples.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut held = 0.0;
    let kept = samples.iter().position(|(_, weight)| {
        held += weight;
        held >= HELD
    });
    samples.truncate(kept.map_or(samples.len(), |last| last + 1));
    let Some((low, cell_m)) = squares(&samples) else { return whole };
    let mut sums: BTreeMap<(i64, i64), Sums> = BTreeMap::new();
    for (place, weight) in &samples {
        #[expect(clippy::cast_possible_truncation, reason = "at most as many as samples")]
        let at = ((place - low) / cell_m).map(|c| c as i64);
        sums.entry((at.x, at.y)).or_default().add(&(place - low), *weight);
    }
    let mut found = Vec::new();
    while let Some((first, sum)) = sums.pop_first() {
        let mut part = sum;
        let mut open = vec![first];
        while let Some((column, row)) = open.pop() {
            for at in (-1..=1).flat_map(|x| (-1..=1).map(move |y| (column + x, row + y))) {
                if let Some(sum) = sums.remove(&at) {
                    part.join(&sum);
                    open.push(at);
                }
            }
        }
        found.push(part);
    }
    let probable = found.into_iter().filter(|part| part.weight >= LEAST_PROBABILITY * held);
    let mut parts: Vec<Part> = probable.map(|part| part.part(low, cell_m, held)).collect();
    parts.sort_by(|a, b| b.density().total_cmp(&a.density()));
    if parts.len() < 2 { whole } else { parts }
}

/// Returns the south-western corner and the side of the squares; `None` where all samples are in
/// one place.
fn squares(samples: &[(Vector2<f64>, f64)]) -> Option<(Vector2<f64>, f64)> {
    let low = samples.iter().fold(Vector2::repeat(f64::INFINITY), |low, (at, _)| low.inf(at));
    let high = samples.iter().fold(Vector2::repeat(-f64::INFINITY), |high, (at, _)| high.sup(at));
    let side = (high - low).max();
    let count = f64::from(u32::try_from(samples.len()).unwrap_or(u32::MAX));
    // Samples that filled the whole bounding box would be half a square apart.
    let cell_m = 2.0 * side / count.sqrt();
    (cell_m > 0.0 && cell_m.is_finite()).then_some((low, cell_m))
}

/// Sums over samples: of weights, and of weighted places and their squares.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    weight: f64,
    first: Vector2<f64>,
    second: Matrix2<f64>,
}

impl Sums {
    fn add(&mut self, place: &Vector2<f64>, weight: f64) {
        self.weight += weight;
        self.first += place * weight;
        self.second += place * place.transpose() * weight;
    }

    fn join(&mut self, other: &Self) {
        self.weight += other.weight;
        self.first += other.first;
        self.second += other.second;
    }

    /// Returns the part; `held` is the probability of all samples.
    fn part(&self, low: Vector2<f64>, cell_m: f64, held: f64) -> Part {
        let mean = self.first / self.weight;
        // A sample is anywhere in its own cell, whose side is about half a square.
        let within = Matrix2::from_diagonal_element(cell_m * cell_m / 48.0);
        let covariance = self.second / self.weight - mean * mean.transpose() + within;
        let estimate = Estimate { mean: low + mean, covariance };
        Part { probability: self.weight / held, estimate }
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use std::f64::consts::TAU;

    use super::*;

    /// Lattice of 40 × 40 places about each centre, with a Gaussian's weights.
    struct Hills(Vec<(Vector2<f64>, f64)>);

    impl Belief for Hills {
        fn position(&self) -> Estimate<2> {
            Estimate::isotropic(Vector2::zeros(), 1.0)
        }

        fn visit_positions(&self, visit: &mut dyn FnMut(&Vector2<f64>, f64)) {
            for (centre, probability) in &self.0 {
                for (i, j) in (-20..20).flat_map(|i| (-20..20).map(move |j| (i, j))) {
                    let away = Vector2::new(f64::from(i) + 0.5, f64::from(j) + 0.5) * 2.0;
                    let density = (-0.5 * away.norm_squared() / 100.0).exp() / (TAU * 100.0);
                    visit(&(centre + away), probability * density * 4.0);
                }
            }
        }
    }

    #[test]
    fn two_hills_are_two_parts_and_one_is_whole() {
        let [west, east] = [-100.0, 100.0].map(|x| Vector2::new(x, 30.0));
        let found = parts(&Hills(vec![(west, 0.3), (east, 0.7)]));
        let [first, second] = &found[..] else { panic!("{found:?}") };
        for (part, centre, probability) in [(first, east, 0.7), (second, west, 0.3)] {
            assert!((part.estimate.mean - centre).norm() < 0.5, "{part:?}");
            assert_abs_diff_eq!(part.probability, probability, epsilon = 0.01);
            let variance = part.estimate.covariance[(0, 0)];
            assert!((85.0..110.0).contains(&variance), "{part:?}");
        }
        let one = parts(&Hills(vec![(west, 1.0)]));
        assert_eq!(one.len(), 1, "{one:?}");
        assert_eq!(one[0].estimate, Estimate::isotropic(Vector2::zeros(), 1.0));
    }

    #[test]
    fn a_gaussian_is_one_part() {
        let gaussian = Estimate::isotropic(Vector2::new(3.0, 4.0), 2.0);
        assert_eq!(parts(&gaussian), [Part { probability: 1.0, estimate: gaussian }]);
    }
}
