use alloc::vec::Vec;
use core::f64::consts::{FRAC_1_SQRT_2, TAU};

use foxhunt_core::{Sweep, angle};

use super::looks::Looks;

/// The likelihood of questions without an answer, for a receiver with a known floor: each was
/// either lost, with a probability that is not known, or its power was below the floor (Tobin
/// 1958).
#[derive(Clone, Debug)]
pub(super) struct Silence {
    /// The antenna's directions, counted like the looks'.
    pub(super) offsets: Vec<f64>,
    /// The power below which nothing is read, in dBm.
    pub(super) threshold_dbm: f64,
    answered: f64,
}

/// Losses are taken to have the density Beta(1, 3) before a turn: any share, rather a small one.
const LOST: f64 = 1.0;
const NOT_LOST: f64 = 3.0;

/// Expectation and maximisation in turn settle a level to a hundredth of a dB within as many.
const ROUNDS: u32 = 12;

/// A level and the silence's part of its log likelihood.
#[derive(Clone, Copy, Debug)]
pub(super) struct Settled {
    pub(super) level: f64,
    pub(super) log_likelihood: f64,
}

impl Silence {
    /// `None` where nothing can be learned from it.
    pub(super) fn new(sweep: &Sweep<'_>, looks: &Looks) -> Option<Self> {
        let floor = sweep.floor_dbm.filter(|floor| floor.is_finite())?;
        let unanswered = sweep.unanswered.iter().filter(|u| u.boresight.is_finite());
        let offsets: Vec<f64> =
            unanswered.map(|u| angle::wrap(u.boresight - looks.origin)).collect();
        // A receiver that rounds reports the floor from half a step below it on.
        let threshold_dbm = if looks.whole_db { floor - 0.5 } else { floor };
        let answered = looks.looks.iter().map(|look| look.count).sum();
        (!offsets.is_empty()).then_some(Self { offsets, threshold_dbm, answered })
    }

    /// Returns true if a silent boresight's power may have been below the floor, at a level: within
    /// three σ of it or lower.
    pub(super) fn matters(&self, level: f64, variance: f64, gain: impl Fn(f64) -> f64) -> bool {
        let reach = self.threshold_dbm + 3.0 * libm::sqrt(variance);
        self.offsets.iter().any(|offset| level + gain(*offset) < reach)
    }

    /// The level that the received readings, in information form, and the silence give together, by
    /// expectation and maximisation over losses and over the powers that were not received
    /// (Dempster, Laird & Rubin 1977). `expected` gives the gain along each silent boresight
    /// and the variance of a reading there.
    pub(super) fn settle(
        &self,
        information: f64,
        weighted: f64,
        expected: &[(f64, f64)],
    ) -> Settled {
        let mut level = weighted / information;
        let mut lost = 0.1;
        let requested = self.answered + expected.iter().map(|_| 1.0).sum::<f64>();
        for _ in 0..ROUNDS {
            let mut sum = weighted;
            let mut known = information;
            let mut losses = 0.0;
            for &(gain, variance) in expected {
                let mean = level + gain;
                let sigma = libm::sqrt(variance);
                let x = (self.threshold_dbm - mean) / sigma;
                let below = normal_cdf(x);
                let weak = (1.0 - lost) * below / (lost + (1.0 - lost) * below);
                losses += 1.0 - weak;
                if below > 1e-300 {
                    let hazard = libm::exp(-0.5 * x * x) / (libm::sqrt(TAU) * below);
                    let imputed = mean - sigma * hazard;
                    sum += weak / variance * (imputed - gain);
                    known += weak / variance;
                }
            }
            level = sum / known;
            lost = (LOST + losses) / (LOST + NOT_LOST + requested);
        }
        let kept = libm::log1p(-lost);
        let mut log_likelihood = LOST * libm::log(lost) + (NOT_LOST + self.answered) * kept;
        for &(gain, variance) in expected {
            let below = normal_cdf((self.threshold_dbm - level - gain) / libm::sqrt(variance));
            log_likelihood += libm::log(lost + (1.0 - lost) * below);
        }
        Settled { level, log_likelihood }
    }
}

/// Φ(x).
pub(crate) fn normal_cdf(x: f64) -> f64 {
    0.5 * libm::erfc(-x * FRAC_1_SQRT_2)
}
