use rustfft::num_complex::Complex32;

use super::{
    DetectorConfig, DetectorError,
    channeliser::{Channeliser, float},
    noise::Noise,
    refine::View,
};

/// The front end of all detectors: a stream of samples divided into channels, in blocks of about a
/// second, and the level of the noise in each.
#[derive(Debug)]
pub(super) struct Front {
    pub(super) config: DetectorConfig,
    channeliser: Channeliser,
    centers_hz: Vec<f64>,
    /// The range of frequencies that each channel has of its own, over its rate.
    pub(super) ranges: Vec<[f64; 2]>,
    /// Samples of a channel in a pulse of each width, ascending.
    pub(super) lengths: Vec<usize>,
    pub(super) noise: Noise,
    pub(super) channels: Vec<Vec<Complex32>>,
    /// The index of the channels' first kept sample, from the last gap.
    pub(super) origin: u64,
    /// Index from which on the noise is not measured yet, from the last gap.
    pub(super) measured: u64,
    /// Index from which on nothing was searched yet, from the last gap.
    looked: u64,
    /// The input's index of the first sample after the last gap, and of the next one.
    segment: u64,
    expected: Option<u64>,
    /// Samples since a block could last end.
    taken: usize,
    /// Samples of a channel that were searched.
    searched: u64,
}

impl Front {
    pub(super) fn new(config: DetectorConfig) -> Result<Self, DetectorError> {
        config.check()?;
        let band = config.band_about_center();
        let (narrow, _) = config.narrow_and_wide();
        // Fifteen samples in the narrowest window, and not less than fine steps in time need.
        let spacing_hz = (10.0 / narrow).max(4e3);
        let channeliser = Channeliser::new(config.rate_hz, spacing_hz, band);
        let centers_hz = channeliser.centers_hz();
        let rate = channeliser.channel_rate_hz();
        let half = channeliser.spacing_hz() / 2.0;
        let range = |center: &f64| {
            [band[0].max(center - half), band[1].min(center + half)].map(|f| (f - center) / rate)
        };
        let ranges: Vec<_> = centers_hz.iter().map(range).collect();
        let mut lengths: Vec<usize> =
            config.widths_s.iter().map(|width| samples(width * rate).max(1)).collect();
        lengths.sort_unstable();
        lengths.dedup();
        // White noise falls on all channels' rates alike.
        let least = config.least_noise / float(channeliser.decimation());
        let noise = Noise::new(lengths[lengths.len() / 2].max(8), &ranges, least);
        let channels = vec![Vec::new(); centers_hz.len()];
        Ok(Self {
            config,
            channeliser,
            centers_hz,
            ranges,
            lengths,
            noise,
            channels,
            origin: 0,
            measured: 0,
            looked: 0,
            segment: 0,
            expected: None,
            taken: 0,
            searched: 0,
        })
    }

    /// The time that was searched, in seconds; gaps do not count.
    pub(super) fn searched_s(&self) -> f64 {
        let searched = index(self.searched);
        searched / self.rate_hz()
    }

    /// Samples of a channel per second.
    pub(super) fn rate_hz(&self) -> f64 {
        self.channeliser.channel_rate_hz()
    }

    /// Width of the band that is searched, in hertz.
    pub(super) fn band_hz(&self) -> f64 {
        let [low, high] = self.config.band_about_center();
        high - low
    }

    /// The longest pulse, in samples of a channel.
    pub(super) fn longest(&self) -> usize {
        self.lengths.last().copied().unwrap_or(1)
    }

    /// The number of samples of the channels that are searched at once.
    pub(super) fn block(&self) -> u64 {
        samples(self.rate_hz()).max(20 * self.longest()) as u64
    }

    /// The index after the channels' last sample.
    pub(super) fn end(&self) -> u64 {
        self.origin + self.channels[0].len() as u64
    }

    /// Returns true if samples from index `first` on follow those before, and false after a gap.
    pub(super) fn follows(&self, first: u64) -> Result<bool, DetectorError> {
        match self.expected {
            Some(expected) if first < expected => Err(DetectorError::Backwards { first, expected }),
            expected => Ok(expected == Some(first)),
        }
    }

    /// Announces `count` samples from index `first` on.
    pub(super) fn expect(&mut self, first: u64, count: usize, follows: bool) {
        if !follows {
            self.segment = first;
        }
        self.expected = Some(first.saturating_add(count as u64));
    }

    /// Takes as many of the samples as a block may hold, and returns whether a search is due.
    /// Blocks end at the same samples however these are divided.
    pub(super) fn take(&mut self, left: &mut &[Complex32]) -> bool {
        let stride = self.channeliser.decimation() << 8;
        let (part, rest) = left.split_at(left.len().min(stride - self.taken));
        *left = rest;
        self.channeliser.push(part, &mut self.channels);
        self.taken += part.len();
        if self.taken < stride {
            return false;
        }
        self.taken = 0;
        let every = self.config.search_every_s.filter(|_| self.noise.is_known());
        let early = every.map(|every| samples(every * self.rate_hz()) as u64);
        self.is_whole() || early.is_some_and(|every| self.end() >= self.looked + every)
    }

    /// Returns true if a block is complete.
    fn is_whole(&self) -> bool {
        self.end() >= self.measured + self.block()
    }

    /// Measures the noise of a block that is complete, or is the last one.
    pub(super) fn measure(&mut self, last: bool) {
        let end = self.end();
        if last || self.is_whole() {
            self.noise.update(&self.channels, place(self.measured, self.origin));
            self.measured = end;
        }
        self.searched += end - self.looked;
        self.looked = end;
    }

    /// The noise at a frequency in hertz: power over the channels' rate. `None` while it is not
    /// known, or where the frequency is not searched.
    pub(super) fn noise_at(&self, frequency_hz: f64) -> Option<f64> {
        let about = frequency_hz - self.config.center_hz.unwrap_or(0.0);
        let place = |center: &f64| (about - center) / self.rate_hz();
        let within = |(center, [low, high]): (&f64, &[f64; 2])| {
            (*low..=*high).contains(&place(center)).then(|| place(center))
        };
        let channels = self.centers_hz.iter().zip(&self.ranges).map(within).enumerate();
        let (channel, frequency) = channels.filter_map(|(i, f)| Some((i, f?))).next()?;
        self.noise.is_known().then(|| f64::from(self.noise.level(channel, frequency)))
    }

    /// Forgets all samples before this index, but for those whose noise is not measured yet.
    pub(super) fn forget(&mut self, before: u64) {
        let drop = place(before.min(self.measured), self.origin);
        if drop > 0 {
            self.channels.iter_mut().for_each(|channel| drop_first(channel, drop));
            self.origin += drop as u64;
        }
    }

    /// Forgets all samples; what comes next comes after a gap.
    pub(super) fn reset(&mut self) {
        self.channeliser.reset();
        self.channels.iter_mut().for_each(Vec::clear);
        (self.origin, self.measured, self.looked, self.taken) = (0, 0, 0, 0);
    }

    /// The kept samples of a channel, and the noise's level at a frequency.
    pub(super) fn view(&self, channel: usize, frequency: f64) -> View<'_> {
        let noise = f64::from(self.noise.level(channel, frequency));
        View { samples: &self.channels[channel], noise }
    }

    /// A channel's frequency about the band's centre, over the channel's rate.
    pub(super) fn absolute(&self, channel: usize, frequency: f64) -> f64 {
        self.centers_hz[channel] / self.rate_hz() + frequency
    }

    /// A frequency about the band's centre, over the channels' rate, in hertz.
    pub(super) fn frequency_hz(&self, absolute: f64) -> f64 {
        self.config.center_hz.unwrap_or(0.0) + absolute * self.rate_hz()
    }

    /// The time of a place among a channel's samples, counted from the last gap.
    pub(super) fn time_s(&self, place: f64) -> f64 {
        let decimation = float(self.channeliser.decimation());
        let input = index(self.segment) + place * decimation + self.channeliser.delay();
        input / self.config.rate_hz
    }

    /// The power of a pulse of this energy over the noise's power density, in the settings' terms.
    pub(super) fn power_dbm(&self, energy: f64, noise: f64, length: f64) -> f64 {
        10.0 * (energy * noise / length).log10() + self.config.full_scale_dbm
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked before")]
pub(super) fn samples(count: f64) -> usize {
    count.round().max(0.0) as usize
}

#[expect(clippy::cast_precision_loss, reason = "below 2^52")]
pub(super) fn index(index: u64) -> f64 {
    index as f64
}

/// The offset of an index from `origin`; 0 if it is before.
pub(super) fn place(index: u64, origin: u64) -> usize {
    usize::try_from(index.saturating_sub(origin)).unwrap_or(usize::MAX)
}

fn drop_first(channel: &mut Vec<Complex32>, count: usize) {
    channel.drain(..count.min(channel.len()));
}
