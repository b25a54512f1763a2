use alloc::vec::Vec;

use foxhunt_core::{
    BearingExtractor, NoReading, Reading, Sweep,
    parameter::{ParameterError, not_negative, positive},
};

use super::{
    fit::Fit,
    gain_table::GainTable,
    looks::Looks,
    misfit::Misfit,
    posterior::{NODES, Node, Peak, node_offset, summit},
    read_out::{Limits, read_out},
};
use crate::Antenna;

/// The bearing under which the readings in dB correlate best with the gain of a known antenna
/// (cited in Isaacs et al. 2014, §II).
///
/// Over a whole turn this is the maximum-likelihood bearing. Where positions are missing it is not:
/// the gain that was not received is missing from the one side alone. σ is that of the readings'
/// scatter, with residuals that exceed it or correlate, and of the bias that a perfect pattern
/// would have over these boresights. The level is that of the fit.
#[derive(Clone, Debug)]
pub struct CrossCorrelation<A> {
    antenna: A,
    table: GainTable,
    limits: Limits,
}

const SAMPLE_SIGMA_DB: f64 = 2.0;
const PRIOR_FREEDOM: f64 = 4.0;
const FITTED: f64 = 2.0;

impl<A: Antenna> CrossCorrelation<A> {
    /// One for readings through `antenna` by beacons on the horizon; a level's σ of 7.9 dB,
    /// bearings up to 1 rad of σ, from 8 boresights on.
    #[must_use]
    pub fn new(antenna: A) -> Self {
        let table = GainTable::new(&antenna, 0.0);
        Self { antenna, table, limits: Limits::default() }
    }

    /// Sets another σ of the level against a path-loss law, in dB.
    ///
    /// # Errors
    ///
    /// If it is negative or not finite.
    pub fn with_rss_sigma_db(mut self, sigma: f64) -> Result<Self, ParameterError> {
        self.limits.rss_sigma_db = not_negative("rss_sigma_db", sigma)?;
        Ok(self)
    }

    /// Sets the largest standard deviation of bearings that are used, in radians.
    ///
    /// # Errors
    ///
    /// If it is not a positive number.
    pub fn with_max_sigma(mut self, sigma: f64) -> Result<Self, ParameterError> {
        self.limits.max_sigma = positive("max_sigma", sigma)?;
        Ok(self)
    }
}

impl<A: Antenna> BearingExtractor for CrossCorrelation<A> {
    fn extract(&self, sweep: &Sweep<'_>) -> Result<Reading, NoReading> {
        let looks = Looks::new(sweep)?;
        let noise = looks.sample_variance(SAMPLE_SIGMA_DB, PRIOR_FREEDOM);
        let fit = Fit::new(&self.antenna, &self.table, looks, sweep, noise, 0.0);
        let (mean, _) = fit.looks.spread();
        let mut gains = Vec::new();
        let node = |index| {
            let offset = node_offset(index);
            fit.gains(offset, &mut gains);
            let looks = fit.looks.looks.iter().zip(&gains);
            let mut product = 0.0;
            let mut rest = 0.0;
            for (look, gain) in looks {
                product += (look.mean_dbm - mean) * gain;
                rest += look.mean_dbm - gain;
            }
            Node { log_density: product, level: rest / fit.looks.len(), level_variance: 0.0 }
        };
        let nodes: Vec<Node> = (0..NODES).map(node).collect();
        let (offset, level) = summit(&nodes);
        let residuals = fit.residuals(offset, level);
        let misfit = Misfit::new(&fit, offset, &residuals, FITTED);
        let slopes = fit.slopes(offset);
        fit.gains(offset, &mut gains);
        let count = fit.looks.len();
        let (mean_gain, mean_slope) =
            (gains.iter().sum::<f64>() / count, slopes.iter().sum::<f64>() / count);
        let mut information = 0.0;
        let mut scatter = 0.0;
        let mut bias = 0.0;
        for ((slope, gain), variance) in slopes.iter().zip(&gains).zip(&fit.variances) {
            let centered = slope - mean_slope;
            information += centered * centered;
            scatter += centered * centered * variance;
            bias += (gain - mean_gain) * slope;
        }
        bias /= information;
        let variance = scatter / (information * information) * misfit.inflation() + bias * bias;
        // An antenna that is flat all round gives no direction.
        let variance = if variance.is_finite() { variance } else { f64::INFINITY };
        let mean_variance = fit.variances.iter().sum::<f64>() / count;
        let peak = Peak {
            weight: 1.0,
            offset,
            sigma: libm::sqrt(variance),
            level,
            level_variance: mean_variance / count * misfit.inflation(),
            covariance: 0.0,
        };
        Ok(read_out(sweep, &fit, &[peak], misfit.residual_db, &self.limits))
    }
}
