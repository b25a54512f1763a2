use std::{f64::consts::PI, fmt, sync::Arc};

use rustfft::{Fft, FftPlanner, num_complex::Complex32};

/// Length of the prototype filter in channels' spacings; with the transition below that is 65 dB
/// of attenuation where channels fold.
const LENGTH: usize = 10;
const KAISER_BETA: f64 = 6.2;

/// Divides a band into channels of a lower rate, with a polyphase filter (Crochiere & Rabiner 1983,
/// chapter 7: weighted overlap and add).
///
/// Channels are `spacing_hz` apart and have 1.5 times that rate, so that a channel is flat over its
/// own part of the band. A band that is not wider than a few channels is passed on as it is.
pub(super) struct Channeliser {
    /// The number of channels in the whole band; 1 if samples are passed on.
    count: usize,
    /// The number of samples that make one of a channel.
    decimation: usize,
    rate_hz: f64,
    prototype: Vec<f32>,
    fft: Arc<dyn Fft<f32>>,
    scratch: Vec<Complex32>,
    folded: Vec<Complex32>,
    /// Samples not yet behind the filter; the first `used` are done with.
    history: Vec<Complex32>,
    used: usize,
    /// Place of the next output's beginning among the folded samples.
    turn: usize,
    /// The channels wanted, as places in the transform.
    wanted: Vec<usize>,
}

impl fmt::Debug for Channeliser {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter
            .debug_struct("Channeliser")
            .field("count", &self.count)
            .field("decimation", &self.decimation)
            .finish_non_exhaustive()
    }
}

impl Channeliser {
    /// Channels of about this spacing that touch the band, which is relative to the centre.
    pub(super) fn new(rate_hz: f64, spacing_hz: f64, band: [f64; 2]) -> Self {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
        let count = (rate_hz / spacing_hz).floor().clamp(1.0, 1e6) as usize;
        let count = if count < 5 { 1 } else { count };
        let decimation = if count == 1 { 1 } else { (2 * count).div_ceil(3).min(count - 1) };
        let taps = if count == 1 { 0 } else { LENGTH * count };
        let mut channeliser = Self {
            count,
            decimation,
            rate_hz,
            prototype: prototype(taps, 0.5 / float(decimation)),
            fft: FftPlanner::new().plan_fft_forward(count),
            scratch: Vec::new(),
            folded: vec![Complex32::default(); count],
            history: Vec::new(),
            used: 0,
            turn: 0,
            wanted: Vec::new(),
        };
        channeliser.scratch.resize(channeliser.fft.get_inplace_scratch_len(), Complex32::default());
        let half = channeliser.spacing_hz() / 2.0;
        let mut wanted: Vec<usize> = (0..count).collect();
        if count > 1 {
            wanted.retain(|place| {
                let center = channeliser.offset_hz(*place);
                center + half > band[0] && center - half < band[1]
            });
        }
        // In the order of their frequencies.
        wanted.sort_by(|a, b| channeliser.offset_hz(*a).total_cmp(&channeliser.offset_hz(*b)));
        channeliser.wanted = wanted;
        channeliser
    }

    /// The frequencies of the channels' middles, about the centre, ascending.
    pub(super) fn centers_hz(&self) -> Vec<f64> {
        self.wanted.iter().map(|place| self.offset_hz(*place)).collect()
    }

    /// Width of the part of a channel that is its own, in hertz.
    pub(super) fn spacing_hz(&self) -> f64 {
        self.rate_hz / float(self.count)
    }

    /// Samples of a channel per second.
    pub(super) fn channel_rate_hz(&self) -> f64 {
        self.rate_hz / float(self.decimation)
    }

    /// Samples of the input in one of a channel.
    pub(super) fn decimation(&self) -> usize {
        self.decimation
    }

    /// Place of the filter's middle, in samples of the input after the first of an output.
    pub(super) fn delay(&self) -> f64 {
        if self.count == 1 { 0.0 } else { (float(self.prototype.len()) - 1.0) / 2.0 }
    }

    fn offset_hz(&self, place: usize) -> f64 {
        let signed = float(place) - if 2 * place > self.count { float(self.count) } else { 0.0 };
        signed * self.spacing_hz()
    }

    /// Forgets all samples.
    pub(super) fn reset(&mut self) {
        self.history.clear();
        (self.used, self.turn) = (0, 0);
    }

    /// Takes samples and appends to each channel those that it gets from them.
    pub(super) fn push(&mut self, samples: &[Complex32], channels: &mut [Vec<Complex32>]) {
        if self.count == 1 {
            channels[0].extend_from_slice(samples);
            return;
        }
        self.history.extend_from_slice(samples);
        let taps = self.prototype.len();
        while self.used + taps <= self.history.len() {
            let input = &self.history[self.used..self.used + taps];
            self.folded.fill(Complex32::default());
            // A row of samples falls on the outputs in two pieces, as they are turned.
            let split = self.count - self.turn;
            let rows = input.chunks_exact(self.count).zip(self.prototype.chunks_exact(self.count));
            for (row, weights) in rows {
                add(&mut self.folded[self.turn..], &row[..split], &weights[..split]);
                add(&mut self.folded[..self.turn], &row[split..], &weights[split..]);
            }
            self.fft.process_with_scratch(&mut self.folded, &mut self.scratch);
            for (channel, place) in channels.iter_mut().zip(&self.wanted) {
                channel.push(self.folded[*place]);
            }
            self.used += self.decimation;
            self.turn = (self.turn + self.decimation) % self.count;
        }
        if self.used >= taps.max(1 << 14) {
            self.history.drain(..self.used);
            self.used = 0;
        }
    }
}

fn add(sums: &mut [Complex32], samples: &[Complex32], weights: &[f32]) {
    for ((sum, sample), weight) in sums.iter_mut().zip(samples).zip(weights) {
        *sum += sample * weight;
    }
}

/// A low pass of Kaiser's window with gain 1, its cut-off in cycles per sample.
fn prototype(taps: usize, cutoff: f64) -> Vec<f32> {
    let middle = (float(taps) - 1.0) / 2.0;
    let weight = |n: usize| {
        let x = float(n) - middle;
        let sinc =
            if x.abs() < 1e-9 { 2.0 * cutoff } else { (2.0 * PI * cutoff * x).sin() / (PI * x) };
        let window = bessel_i0(KAISER_BETA * (1.0 - (x / (middle + 0.5)).powi(2)).max(0.0).sqrt());
        sinc * window
    };
    let weights: Vec<f64> = (0..taps).map(weight).collect();
    let gain: f64 = weights.iter().sum();
    #[expect(clippy::cast_possible_truncation, reason = "samples are f32")]
    let weights = weights.iter().map(|weight| (weight / gain) as f32).collect();
    weights
}

/// The modified Bessel function of order 0, by its series.
pub(super) fn bessel_i0(x: f64) -> f64 {
    let mut term = 1.0;
    let mut sum = 1.0;
    for k in 1..40 {
        term *= (x / 2.0 / f64::from(k)).powi(2);
        sum += term;
    }
    sum
}

#[expect(clippy::cast_precision_loss, reason = "counts of samples are below 2^52")]
pub(super) fn float(count: usize) -> f64 {
    count as f64
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;

    #[expect(clippy::cast_possible_truncation, reason = "samples are f32")]
    fn tone(rate_hz: f64, hz: f64, count: usize) -> Vec<Complex32> {
        let sample =
            |n: usize| Complex32::from_polar(1.0, (TAU * (hz / rate_hz * float(n)).fract()) as f32);
        (0..count).map(sample).collect()
    }

    #[test]
    fn a_tone_is_in_its_channel_alone() {
        let rate = 100e3;
        for hz in [0.0, 1_900.0, -31_000.0, 49_000.0] {
            let mut channeliser = Channeliser::new(rate, 4e3, [-50e3, 50e3]);
            let centers = channeliser.centers_hz();
            assert_eq!(centers.len(), 25);
            let mut channels = vec![Vec::new(); centers.len()];
            for chunk in tone(rate, hz, 20_000).chunks(777) {
                channeliser.push(chunk, &mut channels);
            }
            let channel_rate = channeliser.channel_rate_hz();
            for (center, channel) in centers.iter().zip(&channels) {
                assert!(channel.len() > 1000);
                // What is left after turning the tone back to 0, over the channel's own rate.
                let power = channel.iter().map(|x| f64::from(x.norm_sqr())).sum::<f64>();
                let level = 10.0 * (power / float(channel.len())).log10();
                let away = (hz - center).abs().min(rate - (hz - center).abs());
                if away <= 2e3 {
                    assert!(level.abs() < 0.1, "{hz} in {center}: {level} dB");
                    let step = TAU * (hz - center) / channel_rate;
                    let turned = (channel[101] * channel[100].conj()).arg();
                    let off = (f64::from(turned) - step).rem_euclid(TAU);
                    assert!(off.min(TAU - off) < 1e-3, "{hz} in {center}: {turned} {step}");
                } else if away > 3.9e3 {
                    assert!(level < -60.0, "{hz} in {center}: {level} dB");
                }
            }
        }
    }

    #[test]
    fn only_channels_of_the_band_are_made() {
        let channeliser = Channeliser::new(100e3, 4e3, [9e3, 15e3]);
        assert_eq!(channeliser.centers_hz(), [8e3, 12e3, 16e3]);
        assert_eq!(Channeliser::new(8e3, 4e3, [-1e3, 1e3]).centers_hz(), [0.0]);
    }
}
