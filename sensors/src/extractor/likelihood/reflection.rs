use alloc::vec::Vec;
use core::f64::consts::TAU;

use foxhunt_core::angle;

use super::{
    fit::Fit,
    posterior::{NODES, Node, Posterior},
    two_paths::{BEARING, IN_PHASE, Paths, REFLECTION, TwoPaths, Vector},
};
use crate::Antenna;

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
    fadings: &[super::fading::Fading],
    bearing: f64,
    residuals: &[f64],
) -> Option<Vec<f64>> {
    let with = |fading: &super::fading::Fading, factor: f64| -> Vec<f64> {
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

/// Neighbouring boresights, of a turn's 128, that count as one: fading is alike over about 15°.
const NEIGHBOURS: f64 = 6.0;
