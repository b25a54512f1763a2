//! Two paths, a direct wave and a reflection, laid against a turn and searched for.

use alloc::vec::Vec;
use core::f64::consts::{LN_2, TAU};

use foxhunt_core::{
    angle, elementary,
    vectorised::{self, Kernel},
};
use nalgebra::{SMatrix, SVector};

use super::{
    super::{NODES, Node, Posterior, SAME_LOOK, wrapped},
    Fit,
    tables::{AmplitudeTable, DB, Fading},
};
use crate::Antenna;

/// Unknowns of two paths: the bearing, the level, the reflection's bearing, and its amplitude over
/// the direct one's, in phase and in quadrature.
const UNKNOWNS: usize = 5;
pub(super) const BEARING: usize = 0;
const LEVEL: usize = 1;
const REFLECTION: usize = 2;
const IN_PHASE: usize = 3;
const QUADRATURE: usize = 4;

type Vector = SVector<f64, UNKNOWNS>;

type Matrix = SMatrix<f64, UNKNOWNS, UNKNOWNS>;

/// σ of the reflected amplitude's parts before a turn: 0.5 of the direct one in the root mean
/// square, and seldom more than it.
const AMPLITUDE_SIGMA: f64 = 0.35;

/// The inverse variance of a uniform density over a turn.
const TURN_PRECISION: f64 = 12.0 / (TAU * TAU);

/// In one round no direction moves farther, in radians: the pattern there is another one.
const LONGEST: f64 = 0.35;

/// Number of looks in one wide vector.
const LANES: usize = 4;

type Lanes = [f64; LANES];

/// Number of looks that show where two paths may come from; with half as many, directions that
/// compete were lost.
const COARSE: usize = 64;

/// Less than looks are apart, in radians.
const BEFORE: f64 = 0.5 * SAME_LOOK;

/// A look's offset, its mean, and 1 / the variance of the mean.
type Measured = (f64, f64, f64);

/// The slopes along the unknowns, and the residual of two paths, over σ.
const COLUMNS: usize = UNKNOWNS + 1;
const REST: usize = UNKNOWNS;
const PRODUCTS: usize = COLUMNS * (COLUMNS + 1) / 2;

/// Directions of a reflection that a search starts from, each with either sign.
const STARTS: u16 = 12;
const ROUNDS: u32 = 10;

/// Number of starts that are followed, the best-fitting ones: the others find next to nothing more.
const PROMISING: usize = 16;

/// A descent ends where a round gains less.
const TOLERANCE: f64 = 0.05;

/// Cost above the least beyond which nodes are not followed: e⁻¹⁵ of the best likelihood.
const HOPELESS: f64 = 30.0;

/// Number of nodes to either side that are known however unlikely they are: a narrow peak lies
/// between such.
const NEAREST: u16 = 2;

/// Maximum number of fits that are followed along the bearing.
const FOLLOWED: usize = 4;

/// A cost that is larger than the best by this is not followed.
const TOO_DEAR: f64 = 20.0;

/// A reflected amplitude below this is that of a fit without a reflection.
const VANISHING: f64 = 1e-5;

/// Before a turn there is a reflection that matters with this probability.
const PROBABLE: f64 = 0.2;

/// Neighbouring boresights, of a turn's 128, that count as one: fading is alike over about 15°.
const NEIGHBOURS: f64 = 6.0;

/// The direct wave with one reflection, added as amplitudes: P = |a(θ − φ) + z a(θ′ −
/// φ)|², with the antenna's amplitude a, the reflection's bearing θ′ and its complex amplitude
/// z, the same all round.
#[derive(Debug)]
pub(super) struct TwoPaths<'a> {
    amplitude: &'a AmplitudeTable,
    /// Every look.
    fine: Vec<Block>,
    /// Neighbours taken for one look: as good to find out where to look closer.
    coarse: Vec<Block>,
}

/// Some looks in columns; unused lanes have zero weight.
#[derive(Clone, Copy, Debug, Default)]
struct Block {
    /// In turns.
    offset: Lanes,
    mean_dbm: Lanes,
    /// 1 / σ of the mean.
    root: Lanes,
}

/// Two paths laid against a turn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Paths {
    pub unknowns: Vector,
    /// The weighted sum of squares of the residuals, and of the amplitude over its prior.
    cost: f64,
    normal: Matrix,
    pull: Vector,
}

/// The products of the [columns](COLUMNS), summed over all looks, below the diagonal and on it.
struct Products<'a> {
    amplitude: &'a AmplitudeTable,
    looks: &'a [Block],
    unknowns: &'a Vector,
}

impl Kernel for Products<'_> {
    type Output = [f64; PRODUCTS];

    #[inline(always)]
    fn run(self) -> Self::Output {
        let mut sums = [[0.0; LANES]; PRODUCTS];
        for block in self.looks {
            let columns = columns(self.amplitude, block, self.unknowns);
            // Row by row, each up to the diagonal.
            let mut sums = sums.iter_mut();
            for i in 0..COLUMNS {
                for (j, sum) in (0..=i).zip(&mut sums) {
                    for (lane, sum) in sum.iter_mut().enumerate() {
                        *sum += columns[i][lane] * columns[j][lane];
                    }
                }
            }
        }
        let mut totals = [0.0; PRODUCTS];
        for (total, [a, b, c, d]) in totals.iter_mut().zip(sums) {
            *total = (a + b) + (c + d);
        }
        totals
    }
}

impl<'a> TwoPaths<'a> {
    pub(super) fn new<A>(fit: &Fit<'_, A>, amplitude: &'a AmplitudeTable) -> Self {
        let looks = fit.looks.looks.iter().zip(&fit.variances);
        let mut looks: Vec<Measured> =
            looks.map(|(l, v)| (l.offset, l.mean_dbm, 1.0 / v)).collect();
        let fine = blocks(&looks, 1);
        let together = looks.len() / COARSE;
        if together < 2 {
            return Self { amplitude, coarse: fine.clone(), fine };
        }
        // One turn from just before the first boresight on: at its end there is none, of which
        // rounding would decide whether it comes first or last.
        looks.iter_mut().for_each(|look| look.0 = wrapped(look.0 + BEFORE) - BEFORE);
        looks.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        Self { amplitude, coarse: blocks(&looks, together), fine }
    }

    /// The two paths with these unknowns.
    fn at(&self, looks: &[Block], unknowns: &Vector) -> Paths {
        let sums = vectorised::run(Products { amplitude: self.amplitude, looks, unknowns });
        let product = |i: usize, j: usize| sums[i * (i + 1) / 2 + j];
        let mut normal = Matrix::from_fn(|i, j| product(i.max(j), i.min(j)));
        let mut pull = Vector::from_fn(|i, _| product(REST, i));
        let mut cost = product(REST, REST);
        let prior = 1.0 / (AMPLITUDE_SIGMA * AMPLITUDE_SIGMA);
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
    fn descend(
        &self,
        looks: &[Block],
        mut best: Paths,
        fixed: usize,
        rounds: u32,
        tolerance: f64,
    ) -> Paths {
        let mut damping = 1e-2;
        for _ in 0..rounds {
            let mut normal = best.normal;
            let mut pull = best.pull;
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
            let next = self.at(looks, &(best.unknowns + step));
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

    /// Residual of each look's mean about the two paths, in dB.
    pub(super) fn residuals(&self, paths: &Paths) -> Vec<f64> {
        let rest = |block: &Block| {
            let rest = columns(self.amplitude, block, &paths.unknowns)[REST];
            let looks = rest.into_iter().zip(block.root).filter(|(_, root)| *root > 0.0);
            looks.map(|(rest, root)| rest / root)
        };
        self.fine.iter().flat_map(rest).collect()
    }
}

impl Paths {
    /// The reflected amplitude over the direct one.
    pub(super) fn ratio(&self) -> f64 {
        libm::hypot(self.unknowns[IN_PHASE], self.unknowns[QUADRATURE])
    }

    /// The log density at the bearing, with the other unknowns integrated out by Laplace's method:
    /// the level under a flat prior, as a single path has it.
    fn node(&self, inflation: f64) -> Node {
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

impl TwoPaths<'_> {
    /// The places where the two paths fit best, best first.
    pub(super) fn search(&self, bearing: f64, level: f64) -> Vec<Paths> {
        let mut starts: Vec<Paths> = Vec::new();
        for start in 0..STARTS {
            let reflection = bearing + TAU * (f64::from(start) + 0.5) / f64::from(STARTS);
            for in_phase in [0.3, -0.3] {
                let start = Vector::from([bearing, level, reflection, in_phase, 0.15]);
                starts.push(self.at(&self.coarse, &start));
            }
        }
        starts.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        let promising = starts.into_iter().take(PROMISING);
        let descend = |start| self.descend(&self.coarse, start, 0, ROUNDS, TOLERANCE);
        let found = promising.map(descend).collect();
        // What looks alike from afar may differ from near, and what is dear may be cheap.
        let mut near = distinct(found, 2 * FOLLOWED, 2.0 * TOO_DEAR);
        for paths in &mut near {
            let start = self.at(&self.fine, &paths.unknowns);
            *paths = self.descend(&self.fine, start, 0, ROUNDS, TOLERANCE);
        }
        let mut kept = distinct(near, FOLLOWED, TOO_DEAR);
        // The result must not depend on the start that led there, nor on how much is left of a
        // reflection that is none, as the fits at other bearings go on from there.
        for paths in &mut kept {
            *paths = self.descend(&self.fine, *paths, 0, 2 * ROUNDS, TOLERANCE * 1e-9);
            if paths.ratio() < VANISHING {
                paths.unknowns[IN_PHASE] = VANISHING;
                *paths = self.at(&self.fine, &paths.unknowns);
            }
        }
        kept
    }

    /// The log density of the two paths; where they are hopeless, a lowest one.
    pub(super) fn nodes(&self, found: &[Paths], inflation: f64) -> Vec<Node> {
        let mut nodes: Vec<Option<Node>> = (0..NODES).map(|_| None).collect();
        let least = found.first().map_or(0.0, |paths| paths.cost);
        let step = TAU / f64::from(NODES);
        for paths in found {
            let first = libm::ceil(paths.unknowns[BEARING] / step);
            for (mut index, direction) in [(first, 1.0), (first - 1.0, -1.0)] {
                let mut unknowns = paths.unknowns;
                for gone in 0..NODES / 2 {
                    unknowns[BEARING] = index * step;
                    let start = self.at(&self.fine, &unknowns);
                    let here = self.descend(&self.fine, start, 1, 3, TOLERANCE);
                    unknowns = here.unknowns;
                    if gone > NEAREST && (here.cost - least) / inflation > HOPELESS {
                        break;
                    }
                    let place = &mut nodes[node_of(index)];
                    let node = here.node(inflation);
                    if place.is_none_or(|other| node.log_density > other.log_density) {
                        *place = Some(node);
                    }
                    index += direction;
                }
            }
        }
        let logs = nodes.iter().flatten().map(|node| node.log_density);
        let lowest = logs.fold(f64::NAN, f64::min);
        let hopeless = found.first().map_or(Node::default(), |paths| paths.node(inflation));
        let hopeless = Node { log_density: lowest, ..hopeless };
        nodes.into_iter().map(|node| node.unwrap_or(hopeless)).collect()
    }
}

/// Looks in blocks, `together` neighbours taken for one.
fn blocks(looks: &[Measured], together: usize) -> Vec<Block> {
    let merged = |group: &[Measured]| {
        let total: f64 = group.iter().map(|(_, _, precision)| precision).sum();
        let mut offset = 0.0;
        let mut mean_dbm = 0.0;
        for (at, mean, precision) in group {
            offset += precision * at / total;
            mean_dbm += precision * mean / total;
        }
        (offset / TAU, mean_dbm, libm::sqrt(total))
    };
    let block = |looks: &[Measured]| {
        let mut block = Block::default();
        for (lane, group) in looks.chunks(together).enumerate() {
            (block.offset[lane], block.mean_dbm[lane], block.root[lane]) = merged(group);
        }
        block
    };
    looks.chunks(together * LANES).map(block).collect()
}

/// The [columns](COLUMNS) along a block's looks.
#[inline(always)]
fn columns(amplitude: &AmplitudeTable, looks: &Block, unknowns: &Vector) -> [Lanes; COLUMNS] {
    let x = unknowns[IN_PHASE];
    let y = unknowns[QUADRATURE];
    let bearing = unknowns[BEARING] / TAU;
    let reflection = unknowns[REFLECTION] / TAU;
    let mut columns = [[0.0; LANES]; COLUMNS];
    for (lane, offset) in looks.offset.iter().enumerate() {
        let root = looks.root[lane];
        let (direct, direct_slope) = amplitude.with_slope(bearing - offset);
        let (other, other_slope) = amplitude.with_slope(reflection - offset);
        let re = direct + x * other;
        let im = y * other;
        let power = (re * re + im * im).max(1e-12);
        let rest = looks.mean_dbm[lane] - unknowns[LEVEL] - 0.5 * DB * elementary::ln(power);
        let factor = root * DB / power;
        columns[BEARING][lane] = factor * re * direct_slope;
        columns[LEVEL][lane] = root;
        columns[REFLECTION][lane] = factor * (re * x + im * y) * other_slope;
        columns[IN_PHASE][lane] = factor * re * other;
        columns[QUADRATURE][lane] = factor * im * other;
        columns[REST][lane] = root * rest;
    }
    columns
}

/// Paths that differ in a direction, the best first: at most `most`, each costing less than
/// `too_dear` more than the best.
fn distinct(mut found: Vec<Paths>, most: usize, too_dear: f64) -> Vec<Paths> {
    found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let mut kept: Vec<Paths> = Vec::new();
    for paths in found {
        let near = |other: &Paths, which: usize, reach: f64| {
            angle::distance(other.unknowns[which], paths.unknowns[which]) < reach
        };
        let same = |other: &Paths| near(other, BEARING, 0.03) && near(other, REFLECTION, 0.15);
        let best = kept.first().map_or(paths.cost, |best| best.cost);
        if paths.cost < best + too_dear && kept.len() < most && !kept.iter().any(same) {
            kept.push(paths);
        }
    }
    kept
}

/// A node's number from a count that goes round.
fn node_of(index: f64) -> usize {
    let turns = index / f64::from(NODES);
    let place = libm::round((turns - libm::floor(turns)) * f64::from(NODES));
    #[expect(clippy::cast_possible_truncation, reason = "it lies between 0 and NODES")]
    #[expect(clippy::cast_sign_loss, reason = "as above")]
    let place = place as usize;
    place % usize::from(NODES)
}

/// The posterior of one path or two.
pub(super) fn mixture(single: Vec<Node>, double: &[Node]) -> Posterior {
    // The level of a single path is integrated out like those of two.
    let weigh = |node: Node| Node {
        log_density: node.log_density
            + 0.5 * libm::log(node.level_variance)
            + libm::log((1.0 - PROBABLE) / PROBABLE),
        ..node
    };
    let single: Vec<Node> = single.into_iter().map(weigh).collect();
    Posterior::new(&single).or(Posterior::new(double))
}

/// The turn with variances as large as the strength of fading makes likely that leaves `residuals`
/// behind; `None` where the noise explains them.
pub(super) fn faded<A: Antenna>(
    fit: &Fit<'_, A>,
    fadings: &[Fading],
    bearing: f64,
    residuals: &[f64],
) -> Option<Vec<f64>> {
    let with = |fading: &Fading, factor: f64| -> Vec<f64> {
        let looks = fit.looks.looks.iter().zip(&fit.variances);
        looks.map(|(look, v)| v + factor * fading.variance(bearing - look.offset)).collect()
    };
    let misfit = |variances: &[f64]| -> f64 {
        variances.iter().zip(residuals).map(|(v, r)| libm::log(*v) + r * r / v).sum()
    };
    let mut best = misfit(&fit.variances) - 2.0;
    let mut chosen = None;
    for fading in fadings {
        let log = misfit(&with(fading, 1.0));
        if log < best {
            (best, chosen) = (log, Some(fading));
        }
    }
    chosen.map(|fading| with(fading, NEIGHBOURS))
}
