//! The density about each pulse of pulses that are no part of a train.

use std::f64::consts::PI;

use super::transform::count;
use crate::Pulse;

/// Time from a pulse within which others are counted, in seconds: noise comes in bursts.
const NEAR_S: f64 = 20.0;

/// The standard deviation of the logarithm of a width that a detector measures.
pub(super) const WIDTH_SIGMA: f64 = 0.2;

/// The logarithm of the density of other pulses about each pulse, per second, hertz and natural
/// logarithm of a width.
#[derive(Debug, Clone)]
pub(super) struct Clutter {
    pub(super) ln_density: Vec<f64>,
    /// Mean and standard deviation of the widths' logarithms.
    pub(super) ln_width: (f64, f64),
}

impl Clutter {
    /// The clutter of pulses in the order of their beginnings, without explained ones: the greater
    /// of the density about a pulse's frequency at any time and of that near its time. A pulse
    /// counts itself, so that no density is zero.
    pub(super) fn new(pulses: &[Pulse], explained: &[bool], frequency_sigma_hz: f64) -> Self {
        let reach = 4.0 * frequency_sigma_hz;
        let span = span_s(pulses);
        let ln_width = spread(pulses.iter().map(|pulse| pulse.width_s.ln()));
        let open = || pulses.iter().zip(explained).filter(|(_, explained)| !**explained);
        let mut frequencies: Vec<f64> = open().map(|(pulse, _)| pulse.frequency_hz).collect();
        frequencies.sort_by(f64::total_cmp);
        let density = |pulse: &Pulse| {
            let f = pulse.frequency_hz;
            let from = frequencies.partition_point(|x| *x < f - reach);
            let to = frequencies.partition_point(|x| *x <= f + reach);
            let always = count((to - from).max(1)) / (2.0 * reach * span);
            let from = pulses.partition_point(|other| other.time_s < pulse.time_s - NEAR_S);
            let to = pulses.partition_point(|other| other.time_s <= pulse.time_s + NEAR_S);
            let near = (from..to)
                .filter(|k| !explained[*k] && (pulses[*k].frequency_hz - f).abs() <= reach)
                .count();
            // One alone is no burst of noise.
            let here = count(near.saturating_sub(1)) / (2.0 * reach * span.min(2.0 * NEAR_S));
            always.max(here).ln() + ln_normal(pulse.width_s.ln() - ln_width.0, ln_width.1.powi(2))
        };
        Self { ln_density: pulses.iter().map(density).collect(), ln_width }
    }
}

/// Time from the first pulse to the last, in seconds; at least one.
pub(super) fn span_s(pulses: &[Pulse]) -> f64 {
    match (pulses.first(), pulses.last()) {
        (Some(first), Some(last)) => (last.time_s - first.time_s).max(1.0),
        _ => 1.0,
    }
}

/// The logarithm of a normal density.
pub(super) fn ln_normal(residual: f64, variance: f64) -> f64 {
    -0.5 * (residual * residual / variance + (2.0 * PI * variance).ln())
}

/// Mean and standard deviation; at least that of widths of one transmitter.
fn spread(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let n = count(values.clone().count()).max(1.0);
    let mean = values.clone().sum::<f64>() / n;
    let variance = values.map(|x| (x - mean).powi(2)).sum::<f64>() / n;
    (mean, variance.sqrt().max(WIDTH_SIGMA))
}
