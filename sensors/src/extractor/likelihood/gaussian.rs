use alloc::vec::Vec;

use super::{
    fit::{Fit, NODES, node_offset},
    posterior::Node,
};
use crate::Antenna;

/// The log likelihood of Gaussian residuals over a turn of bearings, the level profiled out, each
/// variance `inflation` times what the looks say.
pub(super) fn nodes<A: Antenna>(fit: &Fit<'_, A>, inflation: f64) -> Vec<Node> {
    let (reference, _) = fit.looks.spread();
    let mut gains = Vec::new();
    let node = |node| {
        let offset = node_offset(node);
        fit.gains(offset, &mut gains);
        let (mut ones, mut sum, mut squares) = (0.0, 0.0, 0.0);
        for ((look, gain), variance) in fit.looks.looks.iter().zip(&gains).zip(&fit.variances) {
            let (weight, rest) = (1.0 / variance, look.mean_dbm - reference - gain);
            ones += weight;
            sum += weight * rest;
            squares += weight * rest * rest;
        }
        let log_density = -0.5 * (squares - sum * sum / ones) / inflation;
        let (information, weighted) = (ones / inflation, (sum + reference * ones) / inflation);
        fit.node(offset, (log_density, information, weighted), |_| 0.0)
    };
    (0..NODES).map(node).collect()
}
