use alloc::vec::Vec;

use foxhunt_core::vectorised::{self, Kernel};

use super::{
    fit::Fit,
    posterior::{NODES, Node, node_offset},
};
use crate::Antenna;

const COUNT: usize = NODES as usize;

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

/// The log likelihood of Gaussian residuals over a turn of bearings, the level profiled out, each
/// variance `inflation` times that of the look.
pub(super) fn nodes<A: Antenna>(fit: &Fit<'_, A>, inflation: f64) -> Vec<Node> {
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
