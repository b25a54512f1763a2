use alloc::vec::Vec;

use foxhunt_core::{Belief, Estimate, PlanError};
use nalgebra::{Matrix2, Vector2};

use super::columns::{Column, blocks};
use crate::spiral::spiral;

/// Fewer places than this give a belief's moments and not its shape.
const FEWEST_PLACES: usize = 16;

/// Number of places drawn for a belief that only gives its moments.
const DRAWN_PLACES: u32 = 512;

/// Largest distances of a nearly Gaussian belief's kurtosis and skewness from 8 and from 0.
/// Mardia's standard errors for 2000 particles are 0.2 and below 0.1; two separate modes have 6.
const KURTOSIS_TOLERANCE: f64 = 1.2;
const SKEWNESS_TOLERANCE: f64 = 0.6;

/// A part of a belief.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cell {
    pub(super) mean: Vector2<f64>,
    pub(super) covariance: Matrix2<f64>,
    pub(super) weight: f64,
}

/// Some cells in columns; what fills up the last block has no weight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct CellBlock {
    /// East and North.
    pub(super) mean: [Column; 2],
    /// East, both and North.
    pub(super) covariance: [Column; 3],
    pub(super) weight: Column,
}

/// A belief in a few cells of about equal weight, whose mixture has its mean and covariance.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cells {
    pub(super) moments: Estimate<2>,
    pub(super) cells: Vec<Cell>,
    /// The cells in columns.
    pub(super) blocks: Vec<CellBlock>,
    /// True if it is nearly Gaussian, so that its moments are all there is.
    pub(super) gaussian: bool,
}

impl Cells {
    pub(super) fn new(moments: Estimate<2>, cells: Vec<Cell>, gaussian: bool) -> Self {
        let numbers = |cell: &Cell| {
            let mean = cell.mean;
            let covariance = cell.covariance;
            let [xx, xy, yy] = [covariance[(0, 0)], covariance[(0, 1)], covariance[(1, 1)]];
            [mean.x, mean.y, xx, xy, yy, cell.weight]
        };
        let block = |[x, y, xx, xy, yy, weight]: [Column; 6]| CellBlock {
            mean: [x, y],
            covariance: [xx, xy, yy],
            weight,
        };
        let mut blocks: Vec<_> = blocks(&cells, numbers).into_iter().map(block).collect();
        let weights = blocks.iter_mut().flat_map(|block| &mut block.weight);
        weights.skip(cells.len()).for_each(|weight| *weight = 0.0);
        Self { moments, cells, blocks, gaussian }
    }

    /// At most as many cells as `count` makes of whether it is nearly Gaussian: the places are
    /// halved by weight across their wider axis again and again, as in a k-d tree (Bentley 1975).
    /// Nothing is drawn at random.
    pub(super) fn of(
        belief: &dyn Belief,
        count: impl FnOnce(bool) -> usize,
    ) -> Result<Self, PlanError> {
        let moments = belief.position();
        let [east, north] = [moments.mean.x, moments.mean.y];
        let numbers = moments.mean.iter().chain(moments.covariance.iter());
        if !numbers.copied().all(f64::is_finite) {
            return Err(PlanError::NotFinite { east, north });
        }
        let mut places = Vec::new();
        belief.visit_positions(&mut |place, weight| {
            if weight > 0.0 && place.x.is_finite() && place.y.is_finite() {
                places.push((*place, weight));
            }
        });
        let shaped = places.len() >= FEWEST_PLACES;
        let gaussian = !shaped || is_gaussian(&places);
        if !shaped {
            places.clear();
            draw(&moments, &mut places);
        }
        let total: f64 = places.iter().map(|(_, weight)| weight).sum();
        for (_, weight) in &mut places {
            *weight /= total;
        }
        let count = count(gaussian);
        let mut cells = Vec::with_capacity(count);
        split(&mut places, count, &mut cells);
        let moments = if shaped { moments_of(&places) } else { moments };
        Ok(Self::new(moments, cells, gaussian))
    }
}

/// Places that lie as a Gaussian has them.
fn draw(moments: &Estimate<2>, places: &mut Vec<(Vector2<f64>, f64)>) {
    let factor = moments.covariance.cholesky().map(|factor| factor.unpack());
    let factor = factor.unwrap_or_else(Matrix2::zeros);
    places.extend(spiral(moments.mean, factor, DRAWN_PLACES).map(|place| (place, 1.0)));
}

/// Mean and covariance of places whose weights sum to 1.
fn moments_of(places: &[(Vector2<f64>, f64)]) -> Estimate<2> {
    let total: f64 = places.iter().map(|(_, weight)| weight).sum();
    let mean = places.iter().map(|(place, weight)| place * *weight).sum::<Vector2<f64>>() / total;
    let square = |(place, weight): &(Vector2<f64>, f64)| {
        let off = place - mean;
        off * off.transpose() * *weight
    };
    let covariance = places.iter().map(square).sum::<Matrix2<f64>>() / total;
    Estimate { mean, covariance }
}

/// Returns true if skewness and kurtosis are about a Gaussian's (Mardia 1970): 0 and p (p + 2) = 8.
fn is_gaussian(places: &[(Vector2<f64>, f64)]) -> bool {
    let moments = moments_of(places);
    let Some(factor) = moments.covariance.cholesky() else { return false };
    let lower = factor.l();
    let mut skew = [0.0; 4];
    let mut kurtosis = 0.0;
    let mut total = 0.0;
    for (place, weight) in places {
        let off = place - moments.mean;
        let x = off.x / lower[(0, 0)];
        let y = (off.y - lower[(1, 0)] * x) / lower[(1, 1)];
        let square = x * x + y * y;
        kurtosis += weight * square * square;
        for (sum, cube) in skew.iter_mut().zip([x * x * x, x * x * y, x * y * y, y * y * y]) {
            *sum += weight * cube;
        }
        total += weight;
    }
    let [xxx, xxy, xyy, yyy] = skew.map(|sum| sum / total);
    let skewness = xxx * xxx + 3.0 * xxy * xxy + 3.0 * xyy * xyy + yyy * yyy;
    (kurtosis / total - 8.0).abs() < KURTOSIS_TOLERANCE && skewness < SKEWNESS_TOLERANCE
}

/// Appends `count` cells of the places, fewer if there are fewer places.
fn split(places: &mut [(Vector2<f64>, f64)], count: usize, cells: &mut Vec<Cell>) {
    let moments = moments_of(places);
    if count <= 1 || places.len() <= 1 {
        let weight = places.iter().map(|(_, weight)| weight).sum();
        cells.push(Cell { mean: moments.mean, covariance: moments.covariance, weight });
        return;
    }
    let axis = usize::from(moments.covariance[(1, 1)] > moments.covariance[(0, 0)]);
    let lower = count / 2;
    let upper = count - count / 2;
    let share = |part: usize| f64::from(u32::try_from(part).unwrap_or(u32::MAX));
    let total: f64 = places.iter().map(|(_, weight)| weight).sum();
    let middle = first_with(places, axis, total * share(lower) / share(count));
    let middle = middle.clamp(1, places.len() - 1);
    let (below, above) = places.split_at_mut(middle);
    split(below, lower, cells);
    split(above, upper, cells);
}

/// Returns the number of places along an axis until their weights sum to `wanted`; these come first
/// then. Halves are selected and not sorted, which takes time in proportion to their number.
fn first_with(places: &mut [(Vector2<f64>, f64)], axis: usize, mut wanted: f64) -> usize {
    let mut from = 0;
    let mut to = places.len();
    while to - from > 1 {
        let half = (to - from) / 2;
        let range = &mut places[from..to];
        range.select_nth_unstable_by(half, |(a, u), (b, v)| {
            let (along, across) =
                (a[axis].total_cmp(&b[axis]), a[1 - axis].total_cmp(&b[1 - axis]));
            along.then(across).then(u.total_cmp(v))
        });
        let weight: f64 = range[..half].iter().map(|(_, weight)| weight).sum();
        if weight >= wanted {
            to = from + half;
        } else {
            wanted -= weight;
            from += half;
        }
    }
    to
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Places of equal weight.
    struct Cloud(Vec<Vector2<f64>>);

    impl Belief for Cloud {
        fn position(&self) -> Estimate<2> {
            moments_of(&self.0.iter().map(|place| (*place, 1.0)).collect::<Vec<_>>())
        }

        fn visit_positions(&self, visit: &mut dyn FnMut(&Vector2<f64>, f64)) {
            let weight = 1.0 / f64::from(u32::try_from(self.0.len()).expect("few places"));
            for place in &self.0 {
                visit(place, weight);
            }
        }
    }

    fn gaussian(mean: Vector2<f64>, sigma: f64) -> Vec<Vector2<f64>> {
        let mut places = Vec::new();
        draw(&Estimate::isotropic(mean, sigma), &mut places);
        places.into_iter().map(|(place, _)| place).collect()
    }

    #[test]
    fn the_mixture_keeps_both_moments() {
        let mut places = gaussian(Vector2::new(3.0, -4.0), 2.0);
        places.extend(gaussian(Vector2::new(20.0, 9.0), 5.0));
        let cloud = Cloud(places);
        let cells = Cells::of(&cloud, |_| 50).expect("finite");
        assert_eq!(cells.cells.len(), 50);
        let truth = cloud.position();
        let weight: f64 = cells.cells.iter().map(|cell| cell.weight).sum();
        assert!((weight - 1.0).abs() < 1e-12);
        let mean = cells.cells.iter().map(|c| c.mean * c.weight).sum::<Vector2<f64>>();
        assert!((mean - truth.mean).norm() < 1e-9);
        let spread = |c: &Cell| {
            let off = c.mean - truth.mean;
            (c.covariance + off * off.transpose()) * c.weight
        };
        let covariance = cells.cells.iter().map(spread).sum::<Matrix2<f64>>();
        assert!((covariance - truth.covariance).norm() < 1e-9);
        // Equal places make equal weights.
        assert!(cells.cells.iter().all(|cell| (cell.weight - 0.02).abs() < 0.002));
    }

    #[test]
    fn the_places_show_the_shape() {
        let one = Cloud(gaussian(Vector2::zeros(), 3.0));
        assert!(Cells::of(&one, |_| 64).expect("finite").gaussian);
        let mut places = gaussian(Vector2::zeros(), 3.0);
        places.extend(gaussian(Vector2::new(40.0, 0.0), 3.0));
        assert!(!Cells::of(&Cloud(places), |_| 64).expect("finite").gaussian);
        let ring = (0..200).map(f64::from).map(|i| Vector2::new(libm::cos(i), libm::sin(i)));
        assert!(!Cells::of(&Cloud(ring.collect()), |_| 64).expect("finite").gaussian);
        // Four cubature points are a Gaussian, and many cells are made of it.
        let moments = Estimate::isotropic(Vector2::new(1.0, 2.0), 7.0);
        let cells = Cells::of(&moments, |_| 64).expect("finite");
        assert!(cells.gaussian && cells.cells.len() == 64);
        assert_eq!(cells.moments, moments);
    }

    #[test]
    fn one_heavy_place_and_nonsense() {
        let mut places: Vec<_> = gaussian(Vector2::zeros(), 1.0);
        places.extend(core::iter::repeat_n(Vector2::new(5.0, 5.0), 2000));
        assert!(Cells::of(&Cloud(places), |_| 64).is_ok());
        let nowhere = Estimate { mean: Vector2::repeat(f64::NAN), covariance: Matrix2::zeros() };
        assert!(Cells::of(&nowhere, |_| 64).is_err());
        let point = Estimate { mean: Vector2::zeros(), covariance: Matrix2::zeros() };
        assert!(Cells::of(&point, |_| 64).is_ok());
    }
}
