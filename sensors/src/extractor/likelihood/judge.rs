use alloc::vec::Vec;

use super::{
    amplitude_table::AmplitudeTable,
    fading::Fading,
    fit::Fit,
    gaussian,
    misfit::Misfit,
    posterior::{Node, Posterior, summit},
    reflection, student,
    two_paths::{BEARING, Paths, TwoPaths},
};
use crate::Antenna;

/// A posterior over a turn of bearings, and how well the readings are met.
pub(super) struct Judged {
    pub(super) posterior: Posterior,
    /// The root mean square of the residuals at the best bearing, in dB.
    pub(super) residual_db: f64,
    /// Factor on all variances.
    pub(super) inflation: f64,
}

pub(super) fn gaussian<A: Antenna>(fit: &Fit<'_, A>) -> Judged {
    let nodes = gaussian::nodes(fit, 1.0);
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
        let nodes = gaussian::nodes(&fit, 1.0);
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
    let degrees = if degrees > 0.0 && degrees.is_finite() { degrees } else { 1.0 };
    let nodes = student::nodes(fit, degrees, 1.0);
    let (offset, level) = summit(&nodes);
    let mut residuals = fit.residuals(offset, level);
    // What has no weight in the fit has none in its quality.
    let mut trusted = 0.0;
    let mut trusts = 0.0;
    for (rest, look) in residuals.iter_mut().zip(&fit.looks.looks) {
        let trust = student::trust(*rest, fit.single_variance, degrees, look.count);
        trusted += trust * *rest * *rest;
        trusts += trust;
        *rest *= libm::sqrt(trust);
    }
    let misfit = Misfit::new(fit, offset, &residuals, ONE_PATH);
    let nodes = student::nodes(fit, degrees, misfit.inflation());
    let posterior = Posterior::new(&nodes);
    let residual_db = libm::sqrt(trusted / trusts);
    Judged { posterior, residual_db, inflation: misfit.inflation() }
}

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

/// Error of the bearing by unresolved reflections, in rad for each unit of the amplitude of the one
/// found: the others have an eighth of it, which leaves 20 log₁₀ e / 8√2 = 0.77 dB; a dB left
/// within the main lobe comes with an error of 0.078 rad.
const UNRESOLVED: f64 = 0.06;

pub(super) fn reflection<A: Antenna>(
    fit: &Fit<'_, A>,
    amplitude: &AmplitudeTable,
    fadings: &[Fading],
) -> Judged {
    let single = gaussian::nodes(fit, 1.0);
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
    match reflection::faded(fit, fadings, best.unknowns[BEARING], &residuals) {
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
    let single = tempered(fit, gaussian::nodes(fit, 1.0), inflation);
    let posterior = reflection::mixture(single, &two.nodes(found, inflation))
        .blurred(UNRESOLVED * best.ratio());
    Judged { posterior, residual_db: misfit.residual_db, inflation }
}

/// The nodes for variances that are larger by a factor.
fn tempered<A: Antenna>(fit: &Fit<'_, A>, nodes: Vec<Node>, inflation: f64) -> Vec<Node> {
    if inflation <= 1.0 {
        return nodes;
    }
    if fit.silence.is_some() {
        return gaussian::nodes(fit, inflation);
    }
    let temper = |node: Node| Node {
        log_density: node.log_density / inflation,
        level: node.level,
        level_variance: node.level_variance * inflation,
    };
    nodes.into_iter().map(temper).collect()
}
