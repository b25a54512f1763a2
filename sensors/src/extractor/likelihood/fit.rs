use alloc::vec::Vec;

use foxhunt_core::Sweep;

use super::{
    gain_table::GainTable,
    looks::{Look, Looks},
    posterior::{NODES, Node, node_offset},
    silence::{Silence, normal_cdf},
};
use crate::Antenna;

/// A turn laid against a known antenna: the data that all ways of judging residuals share.
#[derive(Debug)]
pub(super) struct Fit<'a, A> {
    pub(super) antenna: &'a A,
    pub(super) table: &'a GainTable,
    pub(super) looks: Looks,
    /// The variance of each look's mean in dB², without the misfit of the pattern.
    pub(super) variances: Vec<f64>,
    /// The variance of a single reading.
    pub(super) single_variance: f64,
    pub(super) silence: Option<Silence>,
}

/// The Fisher information about its mean of a reading whose mean lies `above` σ above the floor,
/// censored below it, over that of one that is always received: P(z > −x) − x φ(x) + φ(x)²/Φ(−x).
fn uncensored(above: f64) -> f64 {
    let below = normal_cdf(-above);
    if below < 1e-12 {
        return 1.0;
    }
    let density = libm::exp(-0.5 * above * above) / libm::sqrt(core::f64::consts::TAU);
    1.0 - below - above * density + density * density / below
}

impl<'a, A: Antenna> Fit<'a, A> {
    pub(super) fn new(
        antenna: &'a A,
        table: &'a GainTable,
        looks: Looks,
        sweep: &Sweep<'_>,
        sample_variance: f64,
        misfit_variance: f64,
    ) -> Self {
        let of_mean = |count: f64| sample_variance / count + misfit_variance;
        let variances = looks.looks.iter().map(|look| of_mean(look.count)).collect();
        let silence = Silence::new(sweep, &looks);
        let single_variance = sample_variance + misfit_variance;
        Self { antenna, table, looks, variances, single_variance, silence }
    }

    /// The turn's received looks, with other variances.
    pub(super) fn measured(&self, variances: Vec<f64>) -> Self {
        Self { variances, looks: self.looks.clone(), silence: None, ..*self }
    }

    /// Returns true if some of the silence may be weakness, for a signal from `offset`.
    pub(super) fn is_censored(&self, offset: f64, level: f64) -> bool {
        let gain = |silent: f64| self.table.at(offset - silent);
        self.silence.as_ref().is_some_and(|s| s.matters(level, self.single_variance, gain))
    }

    /// The gain about its mean along each look, for a signal from `offset`.
    pub(super) fn gains(&self, offset: f64, out: &mut Vec<f64>) {
        out.clear();
        if self.looks.level {
            out.extend(self.looks.looks.iter().map(|look| self.table.at(offset - look.offset)));
        } else {
            let bearing = self.looks.origin + offset;
            let tilted = |look| self.table.tilted(self.antenna, look, bearing);
            out.extend(self.looks.looks.iter().map(tilted));
        }
    }

    /// The gain about its mean along one look, for a signal from each node.
    #[inline(always)]
    pub(super) fn gains_of(&self, look: &Look, out: &mut [f64; NODES as usize]) {
        if self.looks.level {
            return self.table.around(-look.offset, out);
        }
        for (node, out) in (0..NODES).zip(out) {
            let bearing = self.looks.origin + node_offset(node);
            *out = self.table.tilted(self.antenna, look, bearing);
        }
    }

    /// The slope of the gain along each look over the bearing, in dB per radian.
    pub(super) fn slopes(&self, offset: f64) -> Vec<f64> {
        const STEP: f64 = 0.0087;
        let mut before = Vec::new();
        let mut after = Vec::new();
        self.gains(offset - STEP, &mut before);
        self.gains(offset + STEP, &mut after);
        before.iter().zip(&after).map(|(a, b)| (b - a) / (2.0 * STEP)).collect()
    }

    /// Residual of each look's mean at a level and a bearing, in dB.
    pub(super) fn residuals(&self, offset: f64, level: f64) -> Vec<f64> {
        let mut gains = Vec::new();
        self.gains(offset, &mut gains);
        let looks = self.looks.looks.iter();
        looks.zip(&gains).map(|(look, gain)| look.mean_dbm - gain - level).collect()
    }

    /// The Cramér-Rao bound of the bearing's variance, in rad², at a bearing and a level that is
    /// not known either; `None` where nothing bounds it. Looks and silent boresights alike count
    /// with what a reading there tells on average, received or below the floor.
    pub(super) fn bound(&self, offset: f64, level: f64) -> Option<f64> {
        let mut tt = 0.0;
        let mut tl = 0.0;
        let mut ll = 0.0;
        let mut add = |gain: f64, slope: f64, variance: f64| {
            let below = self.silence.as_ref().map_or(f64::INFINITY, |silence| {
                (level + gain - silence.threshold_dbm) / libm::sqrt(self.single_variance)
            });
            let information = uncensored(below) / variance;
            tt += information * slope * slope;
            tl += information * slope;
            ll += information;
        };
        let mut gains = Vec::new();
        self.gains(offset, &mut gains);
        let slopes = self.slopes(offset);
        for ((gain, slope), variance) in gains.iter().zip(&slopes).zip(&self.variances) {
            add(*gain, *slope, *variance);
        }
        for silent in self.silence.iter().flat_map(|silence| &silence.offsets) {
            let (gain, slope) = self.table.with_slope(offset - silent);
            add(gain, slope, self.single_variance);
        }
        let known = tt - tl * tl / ll;
        (known > 0.0 && known.is_finite()).then(|| 1.0 / known)
    }

    /// A node from the received looks' log density at its best level, its information and its
    /// information-weighted sum, and from the silence.
    pub(super) fn node(
        &self,
        offset: f64,
        (log_density, information, weighted): (f64, f64, f64),
        extra_variance: impl Fn(f64) -> f64,
    ) -> Node {
        let best = weighted / information;
        let node = Node { log_density, level: best, level_variance: 1.0 / information };
        let Some(silence) = &self.silence else { return node };
        let expected: Vec<(f64, f64)> = silence
            .offsets
            .iter()
            .map(|silent| {
                let azimuth = offset - silent;
                (self.table.at(azimuth), self.single_variance + extra_variance(azimuth))
            })
            .collect();
        let settled = silence.settle(information, weighted, &expected);
        let off = settled.level - best;
        Node {
            log_density: log_density - 0.5 * information * off * off + settled.log_likelihood,
            level: settled.level,
            ..node
        }
    }
}
