//! The samples of a receiver: noise of mean power 1 a sample and pulses.

use std::f64::consts::TAU;

use foxhunt_signal::detector::{Detection, Detector, DetectorConfig};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::{Distribution, StandardNormal};
use rustfft::num_complex::Complex32;

/// A rectangular pulse that is on air.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Sent {
    /// Its middle.
    pub(crate) time_s: f64,
    pub(crate) frequency_hz: f64,
    pub(crate) width_s: f64,
    /// Its energy over the noise's power density.
    pub(crate) snr_db: f64,
}

#[derive(Debug)]
pub(crate) struct Air {
    pub(crate) rate_hz: f64,
    pub(crate) noise: bool,
    pub(crate) generator: Xoshiro256PlusPlus,
}

impl Air {
    pub(crate) fn new(rate_hz: f64, seed: u64) -> Self {
        Self { rate_hz, noise: true, generator: Xoshiro256PlusPlus::seed_from_u64(seed) }
    }

    pub(crate) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.generator.random::<f64>()
    }

    /// So many samples of noise.
    pub(crate) fn noise(&mut self, count: usize) -> Vec<Complex32> {
        let scale = if self.noise { 0.5_f32.sqrt() } else { 0.0 };
        let generator = &mut self.generator;
        let mut part = || -> f32 { StandardNormal.sample(&mut *generator) };
        (0..count).map(|_| Complex32::new(part() * scale, part() * scale)).collect()
    }

    /// Adds a pulse of random phase to samples that begin at index `first`.
    pub(crate) fn add(&mut self, samples: &mut [Complex32], first: f64, sent: &Sent) {
        let length = sent.width_s * self.rate_hz;
        let amplitude = (10f64.powf(sent.snr_db / 10.0) / length).sqrt();
        let phase = self.uniform(0.0, TAU);
        let start = sent.time_s * self.rate_hz - length / 2.0 - first;
        for n in start.floor() as i64..=(start + length).ceil() as i64 {
            let Some(sample) = usize::try_from(n).ok().and_then(|n| samples.get_mut(n)) else {
                continue;
            };
            // A sample stands for the time about it; the first and the last are on in part.
            let x = n as f64 - start;
            let on = ((x + 0.5).min(length) - (x - 0.5).max(0.0)).clamp(0.0, 1.0);
            let angle = phase + TAU * (sent.frequency_hz / self.rate_hz * n as f64).fract();
            *sample += Complex32::from_polar((amplitude * on) as f32, angle as f32);
        }
    }
}

/// Returns the pulses that a detector finds in samples from index 0 on.
pub(crate) fn detect(config: &DetectorConfig, samples: &[Complex32]) -> Vec<Detection> {
    let mut detector = Detector::new(config.clone()).expect("it is in order");
    let mut found = Vec::new();
    detector.push(0, samples, &mut found).expect("they are in order");
    detector.finish(&mut found);
    found
}
