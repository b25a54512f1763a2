//! Posteriors of bearings by the model of the residuals: Gaussian, Student's t, or two paths.

use alloc::vec::Vec;

use foxhunt_core::vectorised::{self, Kernel};

use super::{
    super::{NODES, Node, Posterior, node_offset, summit},
    Fit, Misfit,
    tables::{AmplitudeTable, Fading},
    two_paths::{BEARING, Paths, TwoPaths, faded, mixture},
};
use crate::Antenna;

const COUNT: usize = NODES as usize;

/// Rounds of reweighting at a node.
const ROUNDS: u32 = 4;

/// Fitted are a level and a bearing, or three more.
const ONE_PATH: f64 = 2.0;
const TWO_PATHS: f64 = 5.0;

/// A single path that leaves no more than this of what the noise promises, and no correlation, is
/// not requested a second one: σ of a mean square over a hundred looks is 0.14.
const FITS: f64 = 1.2;

/// Two paths are laid against the pattern of a level antenna. One that is tilted by more than this,
/// in radians, is not: 8° move a lobe of 70° up or down by 0.2 dB.
const STEEP: f64 = 0.14;

/// With fewer looks two paths meet anything.
const FEWEST: f64 = 16.0;

/// Error of the bearing by unresolved reflections, in rad for each unit of the amplitude of the
/// reflection found: the others have an eighth of it, which leaves 20 log₁₀ e / 8√2 =
/// 0.77 dB; a dB left within the main lobe comes with an error of 0.078 rad.
const UNRESOLVED: f64 = 0.06;

/// Residuals of the looks' means above a reference, at each node: their weighted sum and sum of
/// squares over the looks, and the sum of weights.
struct Rests<'a, A> {
    fit: &'a Fit<'a, A>,
    reference: f64,
}

impl<A: Antenna> Kernel for Rests<'_, A> {
    type Output = ([f64; COUNT], [f64; COUNT], f64);

    #[inline(always)]
    fn run(self) -> Self::Output {
        let mut gains = [0.0; COUNT];
        let mut ones = 0.0;
        let mut sums = [0.0; COUNT];
        let mut squares = [0.0; COUNT];
        for (look, variance) in self.fit.looks.looks.iter().zip(&self.fit.variances) {
            let weight = 1.0 / variance;
            let rest = look.mean_dbm - self.reference;
            ones += weight;
            self.fit.gains_of(look, &mut gains);
            for ((gain, sum), square) in gains.iter().zip(&mut sums).zip(&mut squares) {
                let rest = rest - gain;
                *sum += weight * rest;
                *square += weight * rest * rest;
            }
        }
        (sums, squares, ones)
    }
}

/// A posterior over a turn of bearings, and how well the readings are met.
pub(super) struct Judged {
    pub posterior: Posterior,
    /// The root mean square of the residuals at the best bearing, in dB.
    pub residual_db: f64,
    /// Factor on all variances.
    pub inflation: f64,
}

/// The log likelihood of Gaussian residuals over a turn of bearings, the level profiled out, each
/// variance `inflation` times that of the look.
pub(super) fn gaussian_nodes<A: Antenna>(fit: &Fit<'_, A>, inflation: f64) -> Vec<Node> {
    let (reference, _) = fit.looks.spread();
    let (sums, squares, ones) = vectorised::run(Rests { fit, reference });
    let node = |(node, (sum, squares)): (u16, (&f64, &f64))| {
        let log_density = -0.5 * (squares - sum * sum / ones) / inflation;
        let information = ones / inflation;
        let weighted = (sum + reference * ones) / inflation;
        fit.node(node_offset(node), (log_density, information, weighted), |_| 0.0)
    };
    (0..NODES).zip(sums.iter().zip(&squares)).map(node).collect()
}

/// The weight that a reading of Student's t has over a Gaussian one (Lange, Little & Taylor 1989),
/// at a look's residual in dB. Single readings are of that kind; the scatter of a look's `count`
/// readings about their mean is taken to be the usual one.
fn trust(rest: f64, variance: f64, degrees: f64, count: f64) -> f64 {
    (degrees + 1.0) / (base(degrees, count) + rest * rest / variance)
}

fn base(degrees: f64, count: f64) -> f64 {
    degrees + (count - 1.0) / count
}

/// The log likelihood of readings with Student's t of `degrees` degrees of freedom, in units of
/// their σ, the level profiled out by iterated reweighting.
fn student_nodes<A: Antenna>(fit: &Fit<'_, A>, degrees: f64, inflation: f64) -> Vec<Node> {
    let (reference, _) = fit.looks.spread();
    let variance = fit.single_variance;
    let mut gains = Vec::new();
    let node = |node| {
        let offset = node_offset(node);
        fit.gains(offset, &mut gains);
        let rest = || {
            let looks = fit.looks.looks.iter().zip(&gains);
            looks.map(|(look, gain)| (look.mean_dbm - reference - gain, look.count))
        };
        let mut level = 0.0;
        let mut ones = 0.0;
        for round in 0..ROUNDS {
            let mut sum = 0.0;
            ones = 0.0;
            for (rest, count) in rest() {
                let weight =
                    if round == 0 { 1.0 } else { trust(rest - level, variance, degrees, count) };
                ones += weight * count / variance;
                sum += weight * count / variance * rest;
            }
            level = sum / ones;
        }
        let log = |(rest, count): (f64, f64)| {
            let off = rest - level;
            count * libm::log1p(off * off / (variance * base(degrees, count)))
        };
        let log_density = -0.5 * (degrees + 1.0) * rest().map(log).sum::<f64>() / inflation;
        let information = ones / inflation;
        let weighted = information * (level + reference);
        fit.node(offset, (log_density, information, weighted), |_| 0.0)
    };
    (0..NODES).map(node).collect()
}

pub(super) fn gaussian<A: Antenna>(fit: &Fit<'_, A>) -> Judged {
    let nodes = gaussian_nodes(fit, 1.0);
    let (offset, level) = summit(&nodes);
    let misfit = Misfit::new(fit, offset, &fit.residuals(offset, level), ONE_PATH);
    let posterior = Posterior::new(&tempered(fit, nodes, misfit.inflation()));
    Judged { posterior, residual_db: misfit.residual_db, inflation: misfit.inflation() }
}

/// The posterior over the elevations as well, with the fit of the likeliest. All are judged with
/// the noise that the one explaining most leaves behind: a wrong elevation must not excuse itself
/// by what it leaves.
pub(super) fn elevations<'a, A: Antenna>(
    first: Fit<'a, A>,
    others: impl Iterator<Item = Fit<'a, A>>,
) -> (Fit<'a, A>, Judged) {
    let weighed = |fit: Fit<'a, A>| {
        let nodes = gaussian_nodes(&fit, 1.0);
        let (offset, level) = summit(&nodes);
        let misfit = Misfit::new(&fit, offset, &fit.residuals(offset, level), ONE_PATH);
        (fit, nodes, misfit)
    };
    let first = weighed(first);
    let others: Vec<_> = others.map(weighed).collect();
    let inflations = others.iter().map(|(_, _, misfit)| misfit.inflation());
    let inflation = inflations.fold(first.2.inflation(), f64::min);
    let posterior = |(fit, nodes, misfit): (Fit<'a, A>, Vec<Node>, Misfit)| {
        let posterior = Posterior::new(&tempered(&fit, nodes, inflation));
        (fit, Judged { posterior, residual_db: misfit.residual_db, inflation })
    };
    let (mut best, mut judged) = posterior(first);
    let mut all = judged.posterior.clone();
    for (fit, other) in others.into_iter().map(posterior) {
        all = all.or(other.posterior.clone());
        if other.posterior.log_mass() > judged.posterior.log_mass() {
            (best, judged) = (fit, other);
        }
    }
    (best, Judged { posterior: all, ..judged })
}

pub(super) fn student<A: Antenna>(fit: &Fit<'_, A>, degrees: f64) -> Judged {
    let nodes = student_nodes(fit, degrees, 1.0);
    let (offset, level) = summit(&nodes);
    let mut residuals = fit.residuals(offset, level);
    // What has no weight in the fit has none in its quality.
    let mut trusted = 0.0;
    let mut trusts = 0.0;
    for (rest, look) in residuals.iter_mut().zip(&fit.looks.looks) {
        let trust = trust(*rest, fit.single_variance, degrees, look.count);
        trusted += trust * *rest * *rest;
        trusts += trust;
        *rest *= libm::sqrt(trust);
    }
    let misfit = Misfit::new(fit, offset, &residuals, ONE_PATH);
    let nodes = student_nodes(fit, degrees, misfit.inflation());
    let posterior = Posterior::new(&nodes);
    let residual_db = libm::sqrt(trusted / trusts);
    Judged { posterior, residual_db, inflation: misfit.inflation() }
}

pub(super) fn reflection<A: Antenna>(
    fit: &Fit<'_, A>,
    amplitude: &AmplitudeTable,
    fadings: &[Fading],
) -> Judged {
    let single = gaussian_nodes(fit, 1.0);
    let (offset, level) = summit(&single);
    let misfit = Misfit::new(fit, offset, &fit.residuals(offset, level), ONE_PATH);
    let few = fit.looks.len() < FEWEST;
    let fits = misfit.inflation() < FITS;
    // Near the floor only the strongest readings are received: they leave more than noise.
    if few || fits || fit.looks.tilt > STEEP || fit.is_censored(offset, level) {
        let posterior = Posterior::new(&tempered(fit, single, misfit.inflation()));
        let inflation = misfit.inflation();
        return Judged { posterior, residual_db: misfit.residual_db, inflation };
    }
    let fit = &fit.measured(fit.variances.clone());
    let two = TwoPaths::new(fit, amplitude);
    let found = two.search(offset, level);
    let Some(best) = found.first() else { return gaussian(fit) };
    let residuals = two.residuals(best);
    match faded(fit, fadings, best.unknowns[BEARING], &residuals) {
        None => one_or_two(fit, &two, &found),
        Some(variances) => {
            let fit = fit.measured(variances);
            let two = TwoPaths::new(&fit, amplitude);
            one_or_two(&fit, &two, &two.search(offset, level))
        }
    }
}

fn one_or_two<A: Antenna>(fit: &Fit<'_, A>, two: &TwoPaths<'_>, found: &[Paths]) -> Judged {
    let Some(best) = found.first() else { return gaussian(fit) };
    let misfit = Misfit::new(fit, best.unknowns[BEARING], &two.residuals(best), TWO_PATHS);
    let inflation = misfit.inflation();
    let single = tempered(fit, gaussian_nodes(fit, 1.0), inflation);
    let posterior =
        mixture(single, &two.nodes(found, inflation)).blurred(UNRESOLVED * best.ratio());
    Judged { posterior, residual_db: misfit.residual_db, inflation }
}

/// The nodes for variances that are larger by a factor.
fn tempered<A: Antenna>(fit: &Fit<'_, A>, nodes: Vec<Node>, inflation: f64) -> Vec<Node> {
    if inflation <= 1.0 {
        return nodes;
    }
    if fit.silence.is_some() {
        return gaussian_nodes(fit, inflation);
    }
    let temper = |node: Node| Node {
        log_density: node.log_density / inflation,
        level: node.level,
        level_variance: node.level_variance * inflation,
    };
    nodes.into_iter().map(temper).collect()
}
