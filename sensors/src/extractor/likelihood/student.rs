use alloc::vec::Vec;

use super::{
    fit::Fit,
    posterior::{NODES, Node, node_offset},
};
use crate::Antenna;

/// Rounds of reweighting at a node.
const ROUNDS: u32 = 4;

/// The weight that a reading of Student's t has over a Gaussian one (Lange, Little & Taylor 1989),
/// at a look's residual in dB. Single readings are of that kind; the scatter of a look's `count`
/// readings about their mean is taken to be the usual one.
pub(super) fn trust(rest: f64, variance: f64, degrees: f64, count: f64) -> f64 {
    (degrees + 1.0) / (base(degrees, count) + rest * rest / variance)
}

fn base(degrees: f64, count: f64) -> f64 {
    degrees + (count - 1.0) / count
}

/// The log likelihood of readings with Student's t of `degrees` degrees of freedom, in units of
/// their σ, the level profiled out by iterated reweighting.
pub(super) fn nodes<A: Antenna>(fit: &Fit<'_, A>, degrees: f64, inflation: f64) -> Vec<Node> {
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
                let trust =
                    if round == 0 { 1.0 } else { trust(rest - level, variance, degrees, count) };
                ones += trust * count / variance;
                sum += trust * count / variance * rest;
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
