//! The posterior that a turn is expected to leave of a belief.

#[cfg(test)]
mod tests;

use alloc::vec::Vec;
use core::f64::consts::{PI, TAU};

use foxhunt_core::{
    angle,
    elementary::{exp, ln, sqrt},
    vectorised::{self, Kernel},
};
use nalgebra::{Matrix2, Vector3};

use super::{
    CellBlock, Cells, Column, ExpectedReadings, Power, PowerBlock, TARGETS, TurnFishers,
    TurnInformation, dot,
};
use crate::shape::number;

/// A bearing without information is uniform on the circle, whose variance is π²/3.
const UNIFORM: f64 = PI * PI / 3.0;

/// Number of cells weighed at once: half a block, which often is one of two modes.
const PART: usize = 16;

/// A weight of less than e⁻⁵⁰ of a cell's own is lost in rounding.
const NEGLIGIBLE: f64 = -50.0;

/// The posterior that a turn is expected to leave of a belief: one for each belief and power.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct ExpectedPosterior {
    /// Expected information, in nats.
    pub nats: f64,
    /// Expected posterior if the target is in a cell, for each block of cells.
    pub left: Vec<Left>,
    /// Contribution of each drone where it is; most formations differ from the last one in a single
    /// drone.
    drones: Vec<Drone>,
    /// Knowledge of all drones together about each cell, where cells are compared.
    known: Vec<Known>,
    /// Kept from one formation to the next, as to clear it takes time.
    given: Given,
}

/// Expected posterior if the target is in one of a block of cells.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Left {
    /// The posterior variances along its principal axes, the larger one first.
    pub axes: [Column; 2],
    /// The square of how far the farthest drone is from the cell over ground.
    pub farthest2: Column,
}

/// Contribution of a drone at a place.
#[derive(Clone, Debug, Default, PartialEq)]
struct Drone {
    place: Option<Vector3<f64>>,
    /// Information on a target in each cell.
    taught: Vec<Taught>,
    /// Readings expected from each cell, where cells are compared by them.
    readings: Vec<Readings>,
    /// For each cell, and each block of cells, the parts of the divergence of these from it.
    pairs: Vec<Pairs>,
}

/// The sums of the information about East, both and North.
const PLACE: [usize; 3] = [0, 1, 2];

/// The sums of the level's gradient over East and North, weighted with its information.
const GRADIENT: [usize; 2] = [3, 4];

/// The sum of the level's information.
const LEVEL: usize = 5;

/// Information of a turn on a target in each of some cells: the power known, and the parts to take
/// off that for the power in doubt.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Taught {
    /// Sums over drones, by [`PLACE`], [`GRADIENT`] and [`LEVEL`]: in one array they are added as
    /// one column, which takes a fifth fewer instructions than three.
    sums: [Column; 6],
    /// The square of the distance over ground.
    distance2: Column,
}

/// The numbers that are read of each of some cells: value, variance and 1 / variance; bearings
/// within ±π.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Readings {
    level: [Column; 3],
    bearing: [Column; 3],
    /// The sum of the logarithms of both variances.
    log_variance: Column,
}

/// Knowledge of all drones together about each of some cells.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Known {
    /// The covariance that is left within it: East, both and North.
    within: [Column; 3],
    /// The sum of the logarithms of the variances of all readings.
    log_variance: Column,
    /// Share of the power's doubt to take off the divergence from it.
    shared: Column,
}

/// The weights that all cells keep if the target is in one of some cells: their sums, and their
/// first and second moments about that cell.
#[derive(Clone, Copy, Debug)]
struct Kept {
    weight: Column,
    /// East and North.
    mean: [Column; 2],
    /// East, both and North.
    square: [Column; 3],
}

/// Parts of the Kullback-Leibler divergence of what is read of each of some cells from what is read
/// of another: twice that, the power known and without the logarithms of variances, and the
/// difference of the levels, weighted. The numbers are taken for independent Gaussians, bearings as
/// well.
type Pairs = [Column; 2];

/// Room for the results of a model for a block of cells.
#[derive(Clone, Debug, Default, PartialEq)]
struct Given {
    fishers: TurnFishers,
    expected: ExpectedReadings,
}

/// The variances along the principal axes of the inverse of a positive definite matrix with this
/// determinant, given as East, both and North; infinite for one that is not.
#[inline(always)]
fn axes_of_inverse(xx: f64, xy: f64, yy: f64, determinant: f64) -> [f64; 2] {
    let centre = 0.5 * (xx + yy);
    let half = 0.5 * (xx - yy);
    let larger = centre + sqrt(half * half + xy * xy);
    let definite = (determinant > 0.0) & (determinant < f64::INFINITY) & (centre > 0.0);
    // The smaller eigenvalue as determinant over the larger one, where a difference would cancel.
    let axes = [larger / determinant, 1.0 / larger];
    axes.map(|axis| if definite { axis } else { f64::INFINITY })
}

/// The variances along the principal axes of a covariance.
pub(super) fn axes(covariance: &Matrix2<f64>) -> [f64; 2] {
    axes_of(covariance[(0, 0)], covariance[(0, 1)], covariance[(1, 1)])
}

#[inline(always)]
fn axes_of(xx: f64, xy: f64, yy: f64) -> [f64; 2] {
    let half = 0.5 * (xx - yy);
    let larger = 0.5 * (xx + yy) + sqrt(half * half + xy * xy);
    [larger, ((xx * yy - xy * xy) / larger).max(0.0)]
}

/// Sets what a drone teaches at a place.
struct Teach<'a> {
    fishers: &'a TurnFishers,
    cells: &'a CellBlock,
    power: &'a PowerBlock,
    place: &'a Vector3<f64>,
    taught: &'a mut Taught,
}

impl Kernel for Teach<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { fishers, cells, power, place, taught } = self;
        for i in 0..TARGETS {
            let x = fishers.level_gradient[0][i] - power.level_gradient[0][i];
            let y = fishers.level_gradient[1][i] - power.level_gradient[1][i];
            let information = fishers.level_information[i];
            taught.sums[PLACE[0]][i] = fishers.bearing[0][i] + x * x * information;
            taught.sums[PLACE[1]][i] = fishers.bearing[1][i] + x * y * information;
            taught.sums[PLACE[2]][i] = fishers.bearing[2][i] + y * y * information;
            taught.sums[GRADIENT[0]][i] = x * information;
            taught.sums[GRADIENT[1]][i] = y * information;
            taught.sums[LEVEL][i] = information;
            let east = cells.mean[0][i] - place.x;
            let north = cells.mean[1][i] - place.y;
            taught.distance2[i] = east * east + north * north;
        }
    }
}

/// Sets what a drone would read.
struct Read<'a> {
    expected: &'a ExpectedReadings,
    fishers: &'a TurnFishers,
    cells: &'a CellBlock,
    power: &'a PowerBlock,
    readings: &'a mut Readings,
}

impl Kernel for Read<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self { expected, fishers, cells, power, readings } = self;
        let [xx, xy, yy] = &cells.covariance;
        for i in 0..TARGETS {
            let x = fishers.level_gradient[0][i] - power.level_gradient[0][i];
            let y = fishers.level_gradient[1][i] - power.level_gradient[1][i];
            let spread = x * x * xx[i] + 2.0 * x * y * xy[i] + y * y * yy[i];
            let level = expected.level_sigma_db[i] * expected.level_sigma_db[i] + spread;
            // The information is the square of the bearing's gradient over its variance.
            let [b_xx, b_xy, b_yy] = &fishers.bearing;
            let spread = b_xx[i] * xx[i] + 2.0 * b_xy[i] * xy[i] + b_yy[i] * yy[i];
            let variance = expected.bearing_sigma[i] * expected.bearing_sigma[i];
            let bearing = (variance + variance * spread).min(UNIFORM);
            readings.level[0][i] = expected.level_db[i] - power.level_db[i];
            readings.level[1][i] = level;
            readings.level[2][i] = 1.0 / level;
            readings.bearing[1][i] = bearing;
            readings.bearing[2][i] = 1.0 / bearing;
            readings.log_variance[i] = ln(level * bearing);
        }
        readings.bearing[0] = expected.bearing.map(angle::wrap);
    }
}

/// Sets how readings distinguish the cells.
struct Compare<'a> {
    /// Number of cells.
    cells: usize,
    readings: &'a [Readings],
    pairs: &'a mut [Pairs],
}

impl Kernel for Compare<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        for (j, row) in self.pairs.chunks_mut(self.readings.len()).take(self.cells).enumerate() {
            let from = &self.readings[j / TARGETS];
            let j = j % TARGETS;
            let [level, bearing] =
                [&from.level, &from.bearing].map(|number| [number[0][j], number[2][j]]);
            for (of, [twice, weighted]) in self.readings.iter().zip(row) {
                for i in 0..TARGETS {
                    let off = of.level[0][i] - level[0];
                    let way = (of.bearing[0][i] - bearing[0]).abs();
                    let other = TAU - way;
                    let way = if way < other { way } else { other };
                    weighted[i] = off * level[1];
                    twice[i] = (of.level[1][i] * level[1] + off * weighted[i])
                        + (of.bearing[1][i] + way * way) * bearing[1];
                }
            }
        }
    }
}

impl Taught {
    const ZERO: Self = Self { sums: [[0.0; TARGETS]; 6], distance2: [0.0; TARGETS] };

    /// Returns the information of all drones, the power in doubt taken off, and the farthest one's
    /// distance.
    ///
    /// Levels have the covariance σ² I + τ 1 1ᵀ with the power in doubt, which they share; its
    /// inverse is by Sherman and Morrison. Their gradients are of the difference to the levels
    /// received before.
    #[inline(always)]
    fn of_all(drones: &[Drone], block: usize, power: &PowerBlock) -> Self {
        let mut all = Self::ZERO;
        for drone in drones {
            let taught = &drone.taught[block];
            let parts = all.sums.as_flattened_mut().iter_mut().zip(taught.sums.as_flattened());
            parts.for_each(|(sum, part)| *sum += part);
            for (most, square) in all.distance2.iter_mut().zip(&taught.distance2) {
                *most = if *square > *most { *square } else { *most };
            }
        }
        for i in 0..TARGETS {
            let variance = power.variance[i];
            let shared = variance / (1.0 + variance * all.sums[LEVEL][i]);
            let [x, y] = GRADIENT.map(|k| all.sums[k][i]);
            all.sums[PLACE[0]][i] -= x * x * shared;
            all.sums[PLACE[1]][i] -= x * y * shared;
            all.sums[PLACE[2]][i] -= y * y * shared;
        }
        all
    }
}

impl Kept {
    const ZERO: Self =
        Self { weight: [0.0; TARGETS], mean: [[0.0; TARGETS]; 2], square: [[0.0; TARGETS]; 3] };
}

#[inline(always)]
fn add(sum: &mut Column, part: &Column) {
    sum.iter_mut().zip(part).for_each(|(sum, part)| *sum += part);
}

/// Sets the expected posterior by Fisher information, and returns the expected nats.
struct ByFisher<'a> {
    belief: &'a Cells,
    power: &'a Power,
    prior: &'a Matrix2<f64>,
    drones: &'a [Drone],
    left: &'a mut [Left],
}

impl Kernel for ByFisher<'_> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let prior = self.prior;
        let [xx, xy, yy] = [prior[(0, 0)], prior[(0, 1)], prior[(1, 1)]];
        let before = ln(prior.determinant());
        let mut nats = 0.0;
        for (block, left) in self.left.iter_mut().enumerate() {
            let all = Taught::of_all(self.drones, block, &self.power.blocks[block]);
            let mut learned = [0.0; TARGETS];
            for (i, learned) in learned.iter_mut().enumerate() {
                let [t_xx, t_xy, t_yy] = PLACE.map(|k| all.sums[k][i]);
                let [xx, xy, yy] = [xx + t_xx, xy + t_xy, yy + t_yy];
                let determinant = xx * yy - xy * xy;
                let axes = axes_of_inverse(xx, xy, yy, determinant);
                left.axes[0][i] = axes[0];
                left.axes[1][i] = axes[1];
                *learned = 0.5 * (ln(determinant) - before);
            }
            left.farthest2 = all.distance2;
            nats += dot(&learned, &self.belief.blocks[block].weight);
        }
        nats
    }
}

/// Sets the expected posterior by the mutual information, and returns the expected nats.
struct ByEntropy<'a> {
    belief: &'a Cells,
    power: &'a Power,
    drones: &'a [Drone],
    left: &'a mut [Left],
    /// Knowledge of all drones together about each cell.
    known: &'a mut [Known],
}

impl Kernel for ByEntropy<'_> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let Self { belief, power, drones, left, known } = self;
        let mut nats = 0.0;
        for (block, left) in left.iter_mut().enumerate() {
            let cells = &belief.blocks[block];
            let power = &power.blocks[block];
            let all = Taught::of_all(drones, block, power);
            let mut learned = [0.0; TARGETS];
            let known = &mut known[block];
            for (i, learned) in learned.iter_mut().enumerate() {
                // (P⁻¹ + T)⁻¹ = (I + P T)⁻¹ P.
                let [xx, xy, yy] = [0, 1, 2].map(|k: usize| cells.covariance[k][i]);
                let [t_xx, t_xy, t_yy] = PLACE.map(|k| all.sums[k][i]);
                let [a, b] = [1.0 + xx * t_xx + xy * t_xy, xx * t_xy + xy * t_yy];
                let [c, d] = [xy * t_xx + yy * t_xy, 1.0 + xy * t_xy + yy * t_yy];
                let determinant = a * d - b * c;
                let inverse = 1.0 / determinant;
                known.within[0][i] = (d * xx - b * xy) * inverse;
                known.within[1][i] = 0.5 * ((d + a) * xy - b * yy - c * xx) * inverse;
                known.within[2][i] = (a * yy - c * xy) * inverse;
                *learned = 0.5 * ln(determinant.max(1.0));
            }
            nats += dot(&learned, &cells.weight);
            left.farthest2 = all.distance2;
            let mut information = [0.0; TARGETS];
            known.log_variance = [0.0; TARGETS];
            for drone in drones {
                let readings = &drone.readings[block];
                add(&mut information, &readings.level[2]);
                add(&mut known.log_variance, &readings.log_variance);
            }
            for (i, information) in information.iter().enumerate() {
                let variance = power.variance[i];
                // Sherman and Morrison again: what all levels have in common may be the power.
                known.shared[i] = variance / (1.0 + variance * information);
            }
        }
        for (block, left) in left.iter_mut().enumerate() {
            let mut kept = Kept::ZERO;
            for first in (0..TARGETS).step_by(PART) {
                weigh(belief, drones, known, block, first, &mut kept);
            }
            let mut learned = [0.0; TARGETS];
            for (i, learned) in learned.iter_mut().enumerate() {
                let inverse = 1.0 / kept.weight[i];
                let [x, y] = [0, 1].map(|k: usize| kept.mean[k][i] * inverse);
                let [xx, xy, yy] = [0, 1, 2].map(|k: usize| kept.square[k][i] * inverse);
                let axes = axes_of(xx - x * x, xy - x * y, yy - y * y);
                left.axes[0][i] = axes[0];
                left.axes[1][i] = axes[1];
                *learned = ln(kept.weight[i]);
            }
            nats -= dot(&learned, &belief.blocks[block].weight);
        }
        nats
    }
}

/// Sets the [`Kept`] of a part of a block.
#[inline(always)]
fn weigh(
    belief: &Cells,
    drones: &[Drone],
    known: &[Known],
    block: usize,
    first: usize,
    kept: &mut Kept,
) {
    let of = &belief.blocks[block];
    let of_known = &known[block];
    let two_each = 2.0 * number(drones.len());
    let mut weights = [0.0; PART];
    let mut means = [[0.0; PART]; 2];
    let mut squares = [[0.0; PART]; 3];
    for (j, cell) in belief.cells.iter().enumerate() {
        let pair = j * belief.blocks.len() + block;
        let from = &known[j / TARGETS];
        let j = j % TARGETS;
        let rest = from.log_variance[j] - two_each;
        let shared = from.shared[j];
        let within = [from.within[0][j], from.within[1][j], from.within[2][j]];
        let mut twice = [0.0; PART];
        let mut weighted = [0.0; PART];
        for drone in drones {
            let pairs = &drone.pairs[pair];
            for i in 0..PART {
                twice[i] += pairs[0][first + i];
                weighted[i] += pairs[1][first + i];
            }
        }
        let mut exponents = [0.0; PART];
        let mut negligible = true;
        for i in 0..PART {
            let twice = twice[i] + (rest - of_known.log_variance[first + i]);
            exponents[i] = 0.5 * (weighted[i] * weighted[i] * shared - twice);
            negligible &= exponents[i] < NEGLIGIBLE;
        }
        if negligible {
            continue;
        }
        for i in 0..PART {
            let weight = exp(exponents[i]) * cell.weight;
            let x = cell.mean.x - of.mean[0][first + i];
            let y = cell.mean.y - of.mean[1][first + i];
            weights[i] += weight;
            means[0][i] += weight * x;
            means[1][i] += weight * y;
            squares[0][i] += weight * (within[0] + x * x);
            squares[1][i] += weight * (within[1] + x * y);
            squares[2][i] += weight * (within[2] + y * y);
        }
    }
    let part = first..first + PART;
    kept.weight[part.clone()].copy_from_slice(&weights);
    for (column, mean) in kept.mean.iter_mut().zip(&means) {
        column[part.clone()].copy_from_slice(mean);
    }
    for (column, square) in kept.square.iter_mut().zip(&squares) {
        column[part.clone()].copy_from_slice(square);
    }
}

impl ExpectedPosterior {
    /// By Fisher information: in each cell the posterior information is that of the whole belief,
    /// taken for Gaussian, and that of all drones about a target there. What is learned is half the
    /// expected log-determinant (Chaloner & Verdinelli 1995).
    pub(super) fn by_fisher<S: TurnInformation + ?Sized>(
        &mut self,
        turn: &S,
        belief: &Cells,
        power: &Power,
        prior: &Matrix2<f64>,
        places: &[Vector3<f64>],
    ) {
        self.move_to(turn, belief, power, places, false);
        self.leave_by_fisher(belief, power, prior);
    }

    fn leave_by_fisher(&mut self, belief: &Cells, power: &Power, prior: &Matrix2<f64>) {
        let drones = &self.drones;
        let left = &mut self.left;
        self.nats = vectorised::run(ByFisher { belief, power, prior, drones, left });
    }

    /// By the mutual information of reading and place: which cell it is, by the pairwise
    /// divergences D of what would be read, −Σᵢ wᵢ ln Σⱼ wⱼ exp(−Dᵢⱼ) (Kolchinsky
    /// & Tracey 2017, with the Kullback-Leibler divergence of Gaussians), and where in the cell, by
    /// Fisher information. D is additive over the drones but for the power in doubt, which they
    /// share and which takes off the means' part alone; the spread of a cell adds to the noise of
    /// what is read from it.
    ///
    /// If the target is in cell i, the other cells keep the weights wⱼ exp(−Dᵢⱼ): with them the
    /// posterior covariance is that of a mixture.
    pub(super) fn by_entropy<S: TurnInformation + ?Sized>(
        &mut self,
        turn: &S,
        belief: &Cells,
        power: &Power,
        places: &[Vector3<f64>],
    ) {
        self.move_to(turn, belief, power, places, true);
        self.leave_by_entropy(belief, power);
    }

    fn leave_by_entropy(&mut self, belief: &Cells, power: &Power) {
        let drones = &self.drones;
        let left = &mut self.left;
        let known = &mut self.known;
        known.resize_with(left.len(), Known::default);
        self.nats = vectorised::run(ByEntropy { belief, power, drones, left, known });
    }

    /// Sets the contributions of the drones that are not where they were.
    fn move_to<S: TurnInformation + ?Sized>(
        &mut self,
        turn: &S,
        belief: &Cells,
        power: &Power,
        places: &[Vector3<f64>],
        compared: bool,
    ) {
        // Made where they are wanted: mostly the numbers are as before, and one drone has moved.
        self.left.resize_with(belief.blocks.len(), Left::default);
        self.drones.resize_with(places.len(), Drone::default);
        for (drone, place) in self.drones.iter_mut().zip(places) {
            if drone.place != Some(*place) {
                drone.move_to(turn, belief, power, place, compared, &mut self.given);
            }
        }
    }
}

impl Drone {
    /// Sets what it contributes at a place.
    fn move_to<S: TurnInformation + ?Sized>(
        &mut self,
        turn: &S,
        belief: &Cells,
        power: &Power,
        place: &Vector3<f64>,
        compared: bool,
        Given { fishers, expected }: &mut Given,
    ) {
        let blocks = belief.blocks.len();
        self.place = Some(*place);
        self.taught.resize_with(blocks, || Taught::ZERO);
        if compared {
            self.readings.resize_with(blocks, Readings::default);
            self.pairs.resize_with(belief.cells.len() * blocks, Pairs::default);
        }
        for (block, (cells, power)) in belief.blocks.iter().zip(&power.blocks).enumerate() {
            turn.fisher_of_all(&cells.mean, place, fishers);
            let fishers = &*fishers;
            let taught = &mut self.taught[block];
            vectorised::run(Teach { fishers, cells, power, place, taught });
            if compared {
                turn.expected_of_all(&cells.mean, place, expected);
                let expected = &*expected;
                let readings = &mut self.readings[block];
                vectorised::run(Read { expected, fishers, cells, power, readings });
            }
        }
        if compared {
            let cells = belief.cells.len();
            let readings = &self.readings;
            vectorised::run(Compare { cells, readings, pairs: &mut self.pairs });
        }
    }
}
