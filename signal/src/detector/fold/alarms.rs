use std::f64::consts::PI;

use super::super::{channeliser::float, threshold::discrete};

/// Cells of the distribution below the ceiling.
const CELLS: usize = 100;

/// The places that a search for trains goes over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Trials {
    /// The number of pulses that are added up.
    pub(super) pulses: usize,
    pub(super) band_hz: f64,
    /// Samples of a window, and how many of them starts are apart.
    pub(super) length: usize,
    pub(super) step: usize,
    /// The number of intervals; the last pulse is a quarter of a window later from one to the next.
    pub(super) intervals: usize,
    /// The drifts times what pulses are apart from the middle of a train in the mean square,
    /// times a window's length: turns by which drifts differ.
    pub(super) drifts: f64,
}

/// The rate at which noise alone gives a train.
///
/// The statistic is the sum of K energies, each exponential with mean 1 under noise and limited by
/// a ceiling. Its distribution at one place is the K-fold convolution, averaged over the error of
/// the noise's level, a Γ variable of k degrees. Maxima over a field of such places come at the
/// rate P(S > T) times the rates at which the field decorrelates, h the distribution's decay: in
/// time 2h(T − K)/w a second (rough: Pickands 1969), less by ν(h√(4T/n)) as windows begin n to a
/// length only (Siegmund 1985); in frequency h√(πT/3) w a hertz (smooth: Rice 1944); over drifts
/// alike; an interval's step moves pulses as a step in time does, x² = h² 4T times the mean of
/// their shifts over w, and counts for ½x²ν(x) trials. Without the ceiling and for K = 1 that is
/// the rate of single pulses.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TrainAlarms {
    trials: Trials,
    pub(super) ceiling: f64,
    /// ln P(S > x) each step of x, from `first` on.
    ln_tail: Vec<f64>,
    first: f64,
    step: f64,
}

/// The share of the trials that counting gives for steps of the interval: they are not independent
/// of steps in time. Calibrated once for 5 and 10 pulses, an interval that is known or within 2 %;
/// the tests count on other noise.
const COUNTED: f64 = 0.8;
/// The ceiling over what a pulse has at the threshold: more than two thirds of a train's pulses
/// must be there.
const CEILING: f64 = 1.4;

impl TrainAlarms {
    /// The alarms with the ceiling for about `rate_hz` false alarms a second.
    pub(super) fn new(trials: Trials, rate_hz: f64) -> Self {
        let known = 1000.0;
        // An energy beyond the reach of noise is no ceiling.
        let open = Self::below(trials, 60.0);
        let ceiling = CEILING * open.threshold(rate_hz, known) / float(trials.pulses);
        Self::below(trials, ceiling)
    }

    fn below(trials: Trials, ceiling: f64) -> Self {
        let step = ceiling / float(CELLS);
        let mut one: Vec<f64> =
            (0..=CELLS).map(|n| (-float(n) * step).exp() * -(-step).exp_m1()).collect();
        // What reaches the ceiling lies at the border of the last two cells.
        let beyond = (-ceiling).exp();
        one[CELLS] = 0.5 * beyond;
        one[CELLS - 1] += 0.5 * beyond;
        let mut sums = one.clone();
        for _ in 1..trials.pulses {
            let mut next = vec![0.0; sums.len() + CELLS];
            for (n, a) in sums.iter().enumerate() {
                next[n..].iter_mut().zip(&one).for_each(|(sum, b)| *sum += a * b);
            }
            sums = next;
        }
        let mut tail = 0.0;
        for value in sums.iter_mut().rev() {
            tail += *value;
            *value = tail.ln();
        }
        // A cell stands for its middle, and its sum for what is above its lower border.
        let first = 0.5 * float(trials.pulses - 1) * step;
        Self { trials, ceiling, ln_tail: sums, first, step }
    }

    fn ln_tail(&self, x: f64) -> f64 {
        let place = ((x - self.first) / self.step).max(0.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive")]
        let cell = place as usize;
        match self.ln_tail.get(cell..cell + 2) {
            Some([a, b]) => a + (b - a) * (place - float(cell)),
            _ => f64::NEG_INFINITY,
        }
    }

    /// The logarithm of the probability at one place, where the noise's level is worth `known`
    /// exponentials.
    fn ln_beyond(&self, threshold: f64, known: f64) -> f64 {
        // Over the logarithm of the level's error.
        let nodes = (-32..=32).map(|n| f64::from(n) / 4.0 / known.sqrt());
        let mut sum = 0.0;
        let mut weights = 0.0;
        for u in nodes {
            let weight = (known * (u - u.exp_m1())).exp();
            weights += weight;
            sum += weight * self.ln_tail(threshold * u.exp()).exp();
        }
        (sum / weights).ln()
    }

    /// The number of noise's trains above the threshold, a second.
    pub(super) fn rate_hz(&self, threshold: f64, known: f64) -> f64 {
        let Trials { pulses, band_hz, length, step, intervals, drifts } = self.trials;
        let ln_beyond = self.ln_beyond(threshold, known);
        if ln_beyond == f64::NEG_INFINITY {
            return 0.0;
        }
        let decay = (self.ln_tail(threshold - 0.25) - self.ln_tail(threshold + 0.25)) / 0.5;
        let decay = if decay.is_finite() { decay } else { 1.0 };
        let above = (threshold - float(pulses)).max(1.0);
        let in_time = |x: f64| discrete(decay * (4.0 * threshold * x).sqrt());
        let time = 2.0 * decay * above * in_time(float(step) / float(length));
        let turns = decay * (PI * threshold / 3.0).sqrt();
        let middle = (float(pulses) - 1.0) / 2.0;
        let shift = (0..pulses).map(|n| (float(n) - middle).abs()).sum::<f64>() / float(pulses);
        let apart = shift / (4.0 * float(pulses - 1));
        let each = 0.5 * decay * decay * 4.0 * threshold * apart * in_time(apart);
        // Refining goes a step beyond the first and the last.
        let intervals = 1.0 + COUNTED * each * float(intervals + 1);
        let drifts = 1.0 + turns * drifts;
        band_hz * time * turns * intervals * drifts * ln_beyond.exp()
    }

    /// The threshold that noise exceeds `rate_hz` times a second.
    pub(super) fn threshold(&self, rate_hz: f64, known: f64) -> f64 {
        let pulses = float(self.trials.pulses);
        let mut low = 1.5 * pulses;
        let mut high = pulses * self.ceiling;
        for _ in 0..50 {
            let middle = f64::midpoint(low, high);
            if self.rate_hz(middle, known) > rate_hz {
                low = middle;
            } else {
                high = middle;
            }
        }
        high
    }
}
