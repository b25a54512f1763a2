//! Planners that listen where the next turns are expected to teach most.

mod config;
mod planner;
mod rollout;
mod search;
mod steepest_descent;
mod turn;
mod worth;

pub use config::{Criterion, InformationConfig, Objective};
pub use planner::Information;
pub use steepest_descent::{SteepestDescent, SteepestDescentConfig};
pub use turn::{
    ExpectedReading, ExpectedReadings, RssBearingTurn, TARGETS, TurnFisher, TurnFishers,
    TurnInformation,
};

use alloc::vec::Vec;

use foxhunt_core::{BeaconId, Belief, Estimate, PlanError, Reception};
use nalgebra::{Matrix2, Vector2, Vector3};

use crate::planners::spiral;

/// Fewer places than this give a belief's moments and not its shape.
const FEWEST_PLACES: usize = 16;

/// Number of places drawn for a belief that only gives its moments.
const DRAWN_PLACES: u32 = 512;

/// Largest distances of a nearly Gaussian belief's kurtosis and skewness from 8 and from 0.
/// Mardia's standard errors for 2000 particles are 0.2 and below 0.1; two separate modes have 6.
const KURTOSIS_TOLERANCE: f64 = 1.2;
const SKEWNESS_TOLERANCE: f64 = 0.6;

/// A number for each of [`TARGETS`] cells.
type Column = [f64; TARGETS];

/// A part of a belief.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Cell {
    mean: Vector2<f64>,
    covariance: Matrix2<f64>,
    weight: f64,
}

/// Some cells in columns; what fills up the last block has no weight.
#[derive(Clone, Copy, Debug, PartialEq)]
struct CellBlock {
    /// East and North.
    mean: [Column; 2],
    /// East, both and North.
    covariance: [Column; 3],
    weight: Column,
}

/// A belief in a few cells of about equal weight, whose mixture has its mean and covariance.
#[derive(Clone, Debug, PartialEq)]
struct Cells {
    moments: Estimate<2>,
    cells: Vec<Cell>,
    /// The cells in columns.
    blocks: Vec<CellBlock>,
    /// True if it is nearly Gaussian, so that its moments are all there is.
    gaussian: bool,
}

impl Cells {
    fn new(moments: Estimate<2>, cells: Vec<Cell>, gaussian: bool) -> Self {
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
    fn of(belief: &dyn Belief, count: impl FnOnce(bool) -> usize) -> Result<Self, PlanError> {
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

/// Places where the levels of beacons were received: they tell what is known of their power.
///
/// Every reception that an estimator fused comes in, of whichever beacon. A search begins or is
/// resumed without its beacon being named: that is the first target of the next plan, or where a
/// plan does not name it either, the beacon that was received first since; the one before is left
/// aside.
#[derive(Clone, Debug, Default, PartialEq)]
struct LevelRecord {
    of: Vec<Places>,
    /// Beacon that is searched for, where known.
    first: Option<BeaconId>,
    /// Beacon of the search before.
    before: Option<BeaconId>,
    /// True if the target's earlier levels are forgotten once its beacon is known.
    anew: bool,
    /// Places of the targets in the last plan.
    targets: Vec<(BeaconId, Vector2<f64>)>,
}

/// Places where the levels of one beacon were received.
#[derive(Clone, Debug, PartialEq)]
struct Places {
    beacon: BeaconId,
    places: Vec<Vector3<f64>>,
    /// Number of places from before the present search began.
    earlier: usize,
    /// True if anything was received since then, a level or not.
    received: bool,
}

impl LevelRecord {
    fn add(&mut self, reception: &Reception) {
        let beacon = reception.beacon;
        let index = self.of.iter().position(|known| known.beacon == beacon);
        let index = index.unwrap_or_else(|| {
            self.of.push(Places { beacon, places: Vec::new(), earlier: 0, received: false });
            self.of.len() - 1
        });
        let known = &mut self.of[index];
        known.received = true;
        known.places.extend(reception.level.map(|_| reception.receiver.position));
    }

    /// A search begins of a target that nothing is believed of: its levels received before now are
    /// forgotten.
    fn begin(&mut self) {
        self.start(None);
        self.anew = true;
    }

    /// A search goes on for a target that something is believed of already: its levels stay.
    fn resume(&mut self, beacon: Option<BeaconId>) {
        self.start(beacon);
        self.anew = false;
    }

    fn start(&mut self, beacon: Option<BeaconId>) {
        self.before = self.first.or(self.before);
        self.first = beacon;
        self.targets.clear();
        for known in &mut self.of {
            known.earlier = known.places.len();
            known.received = false;
        }
    }

    /// Returns the beacon that is resumed with this mean of its belief: the beacon that the last
    /// plan had nearest to there, or else the only other beacon that was received.
    fn resumed(&self, mean: &Vector2<f64>) -> Option<BeaconId> {
        let off = |target: &&(BeaconId, Vector2<f64>)| (target.1 - mean).norm_squared();
        let others = self.targets.iter().filter(|target| Some(target.0) != self.first);
        if let Some(nearest) = others.min_by(|a, b| off(a).total_cmp(&off(b))) {
            return Some(nearest.0);
        }
        let mut others = self.of.iter().filter(|known| Some(known.beacon) != self.first);
        others.next().filter(|_| others.next().is_none()).map(|known| known.beacon)
    }

    /// Returns the beacon that is searched for, also where the plan does not name it.
    fn first(&self) -> Option<BeaconId> {
        let now = || self.of.iter().filter(|known| known.received);
        let other = || now().find(|known| Some(known.beacon) != self.before);
        self.first.or_else(|| other().or_else(|| now().next()).map(|known| known.beacon))
    }

    /// Takes note of the targets of a plan; the search is for the first of them.
    fn search(&mut self, targets: &[(Option<BeaconId>, Vector2<f64>)]) {
        let known = |(beacon, mean): &(Option<BeaconId>, _)| beacon.map(|beacon| (beacon, *mean));
        self.targets = targets.iter().filter_map(known).collect();
        let Some((Some(first), _)) = targets.first() else { return };
        self.first = Some(*first);
        if core::mem::take(&mut self.anew)
            && let Some(known) = self.of.iter_mut().find(|known| known.beacon == *first)
        {
            known.places.drain(..known.earlier);
            known.earlier = 0;
        }
    }

    /// Returns the places where the levels of a beacon were received.
    fn places(&self, beacon: Option<BeaconId>) -> &[Vector3<f64>] {
        let of = self.of.iter().find(|known| Some(known.beacon) == beacon);
        of.map_or(&[], |known| &known.places)
    }
}

/// Evidence of the power from the levels received so far, if the target is in a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
struct PowerIn {
    level_db: f64,
    level_gradient: Vector2<f64>,
    variance: f64,
}

/// Evidence of the power for many cells.
#[derive(Clone, Copy, Debug, PartialEq)]
struct PowerBlock {
    /// The mean level expected at the places where it was received, weighted with its information,
    /// and its gradient over the target's place.
    level_db: Column,
    level_gradient: [Column; 2],
    /// The variance of the power that is left, in dB².
    variance: Column,
}

/// The power of a transmitter, given each cell of the belief of its place.
#[derive(Clone, Debug, PartialEq)]
struct Power {
    blocks: Vec<PowerBlock>,
}

impl Power {
    /// Given the place, the power is the prior and the mean of received over expected levels,
    /// weighted by their information.
    fn of<S: TurnInformation + ?Sized>(
        turn: &S,
        belief: &Cells,
        received_at: &[Vector3<f64>],
        sigma_db: f64,
    ) -> Self {
        let known = PowerIn { level_db: 0.0, level_gradient: Vector2::zeros(), variance: 0.0 };
        let in_cell = |cell: &Cell| {
            if sigma_db <= 0.0 {
                return known;
            }
            let mut sum = PowerIn { variance: 1.0 / (sigma_db * sigma_db), ..known };
            for place in received_at {
                let fisher = turn.fisher(&cell.mean, place);
                let level = turn.expected(&cell.mean, place).level_db;
                sum.level_db += level * fisher.level_information;
                sum.level_gradient += fisher.level_gradient * fisher.level_information;
                sum.variance += fisher.level_information;
            }
            PowerIn {
                level_db: sum.level_db / sum.variance,
                level_gradient: sum.level_gradient / sum.variance,
                variance: 1.0 / sum.variance,
            }
        };
        let numbers = |cell: &Cell| {
            let power = in_cell(cell);
            [power.level_db, power.level_gradient.x, power.level_gradient.y, power.variance]
        };
        let block = |[level_db, x, y, variance]: [Column; 4]| PowerBlock {
            level_db,
            level_gradient: [x, y],
            variance,
        };
        Self { blocks: blocks(&belief.cells, numbers).into_iter().map(block).collect() }
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

/// Some numbers of each cell in columns. The last cell fills up the last block, so that no loop has
/// a rest.
fn blocks<T, const N: usize>(cells: &[T], numbers: impl Fn(&T) -> [f64; N]) -> Vec<[Column; N]> {
    let block = |cells: &[T]| {
        let mut block = [[0.0; TARGETS]; N];
        for row in 0..TARGETS {
            let numbers = numbers(&cells[row.min(cells.len() - 1)]);
            block.iter_mut().zip(numbers).for_each(|(column, number)| column[row] = number);
        }
        block
    };
    cells.chunks(TARGETS).map(block).collect()
}

/// Σ aᵢ bᵢ, in the same order everywhere.
#[inline(always)]
fn dot(a: &Column, b: &Column) -> f64 {
    const LANES: usize = 8;
    let mut sums = [0.0; LANES];
    for (a, b) in a.as_chunks::<LANES>().0.iter().zip(b.as_chunks::<LANES>().0) {
        for ((sum, a), b) in sums.iter_mut().zip(a).zip(b) {
            *sum += a * b;
        }
    }
    sums.iter().sum()
}

#[cfg(test)]
mod tests {
    use approx::{abs_diff_eq, assert_abs_diff_eq};
    use foxhunt_core::{Level, Pose};

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
        assert_abs_diff_eq!(weight, 1.0, epsilon = 1e-12);
        let mean = cells.cells.iter().map(|c| c.mean * c.weight).sum::<Vector2<f64>>();
        assert!((mean - truth.mean).norm() < 1e-9);
        let spread = |c: &Cell| {
            let off = c.mean - truth.mean;
            (c.covariance + off * off.transpose()) * c.weight
        };
        let covariance = cells.cells.iter().map(spread).sum::<Matrix2<f64>>();
        assert!((covariance - truth.covariance).norm() < 1e-9);
        // Equal places make equal weights.
        assert!(cells.cells.iter().all(|cell| abs_diff_eq!(cell.weight, 0.02, epsilon = 0.002)));
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

    fn reception(beacon: u16, east: f64) -> Reception {
        Reception {
            beacon: BeaconId(beacon),
            receiver: Pose::at(east, 0.0, 3.0),
            level: Some(Level { rss_dbm: -70.0, sigma_db: 4.0 }),
            ..Reception::default()
        }
    }

    #[test]
    fn a_reception_without_a_level_teaches_nothing_of_the_power() {
        let mut all = LevelRecord::default();
        all.begin();
        all.add(&Reception { level: None, ..reception(0, 1.0) });
        assert_eq!(all.first(), Some(BeaconId(0)));
        assert!(all.places(Some(BeaconId(0))).is_empty());
    }

    #[test]
    fn a_target_keeps_its_levels_unless_it_begins_anew() {
        let zero = Some(BeaconId(0));
        let one = Some(BeaconId(1));
        let mut all = LevelRecord::default();
        all.begin();
        assert_eq!(all.first(), None);
        all.add(&reception(0, 1.0));
        all.add(&reception(1, 2.0));
        assert_eq!(all.first(), zero);
        all.search(&[(one, Vector2::new(9.0, 9.0)), (zero, Vector2::zeros())]);
        assert_eq!((all.first(), all.places(one).len()), (one, 1));
        // The other one goes on with what is known of its power.
        assert_eq!(all.resumed(&Vector2::new(8.0, 8.0)), zero);
        all.resume(zero);
        all.search(&[(all.first(), Vector2::zeros())]);
        assert_eq!((all.first(), all.places(zero).len()), (zero, 1));
        // One that is over is still received: the next search is not its own.
        all.begin();
        all.add(&reception(0, 3.0));
        all.add(&reception(1, 4.0));
        assert_eq!(all.first(), one);
        all.search(&[(all.first(), Vector2::zeros())]);
        assert_eq!(all.places(one), [Vector3::new(4.0, 0.0, 3.0)]);
        assert_eq!(all.places(zero).len(), 2);
        all.add(&reception(1, 5.0));
        all.search(&[(all.first(), Vector2::zeros())]);
        assert_eq!(all.places(one).len(), 2);
    }
}
