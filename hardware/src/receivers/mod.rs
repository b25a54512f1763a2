//! Other receivers as sources of the same hunt: RTL-SDR over rtl_tcp, `KrakenSDR`, SiK telemetry
//! radios, and the timeline by which samples have times.

mod config;
mod kraken;
mod rtl_tcp;
mod samples;
mod sik;
#[cfg(feature = "soapy")]
mod soapy;

pub use config::{
    KrakenConfig, KrakenSourceError, PulseConfig, RtlTcpConfig, RtlTcpRadioError, RtlTcpTuning,
};
pub use kraken::KrakenSource;
pub use rtl_tcp::RtlTcpRadio;
pub use samples::RtlTcpSamples;
pub use sik::{SikError, SikFeed, SikRadio};
#[cfg(feature = "soapy")]
pub use soapy::{SoapyError, SoapySamples, SoapyTuning, soapy_devices};

/// Greatest lag in seconds of a count behind the clock without a loss.
const SLACK_S: f64 = 0.05;

/// Time in seconds that a lag must last to be a loss: longer than a server takes to hand on a
/// block, which is at most 0.6 s.
const WATCH_S: f64 = 1.5;

/// Greatest drift of the sample clock off the other clock, as a share.
const DRIFT: f64 = 2e-4;

/// Losses of a stream of samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct SampleLosses {
    /// Number of gaps.
    pub gaps: u32,
    /// Number of samples in them.
    pub samples: u64,
    /// Number of times that the stream stalled and was opened again.
    pub stalls: u32,
}

/// Silence of a stream that brings nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Silence {
    /// Duration of the silence, in seconds.
    seconds: f64,
    /// True if the stream is to be opened again now.
    renews: bool,
}

/// Place of a stream's samples in time, with their losses: a count that is held against the clock.
#[derive(Clone, Debug)]
struct Placement {
    rate_hz: f64,
    settling_s: f64,
    silence_s: f64,
    /// Time at which the receiver was set up, and the timeline since, until it has settled.
    settling: Option<(f64, Timeline)>,
    timeline: Timeline,
    received_at: Option<f64>,
    /// Time of the last reopening for its silence.
    renewed_at: Option<f64>,
    losses: SampleLosses,
}

impl Placement {
    fn new(rate_hz: f64, settling_s: f64, silence_s: f64) -> Self {
        Self {
            rate_hz,
            settling_s,
            silence_s,
            settling: None,
            timeline: Timeline::new(rate_hz),
            received_at: None,
            renewed_at: None,
            losses: SampleLosses::default(),
        }
    }

    fn losses(&self) -> SampleLosses {
        self.losses
    }

    fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    /// Settles again: the next samples do not follow the last, and their place in time has to be
    /// found.
    fn settle(&mut self, now: f64) {
        self.settling = Some((now, Timeline::new(self.rate_hz)));
    }

    /// A new connection, of which nothing has come.
    fn restart(&mut self, now: f64) {
        self.received_at = Some(now);
        self.renewed_at = None;
    }

    /// Notes that something has come; returns true if that is the first after a silence.
    fn received(&mut self, now: f64) -> bool {
        self.received_at = Some(now);
        self.renewed_at.take().is_some()
    }

    /// Counts samples that have come: the index of the first; `None` while the receiver settles.
    fn take(&mut self, now: f64, samples: u64) -> Option<u64> {
        if let Some((since, fresh)) = &mut self.settling {
            let settled = *since + self.settling_s;
            if now < settled || !fresh.has_begun() {
                // At first samples may still be those of another rate.
                if now >= settled - self.settling_s / 2.0 {
                    fresh.take(now, samples);
                }
                return None;
            }
            let lost = self.timeline.join(fresh);
            self.settling = None;
            self.note(lost);
        }
        (samples > 0).then(|| self.timeline.take(now, samples))
    }

    /// All that had come was taken.
    fn drained(&mut self, now: f64) {
        if self.settling.is_none() {
            let lost = self.timeline.watch(now);
            self.note(lost);
        }
    }

    /// Notes that `samples` samples are known to be lost before the next one.
    #[cfg(feature = "soapy")]
    fn lost(&mut self, samples: u64) {
        if self.settling.is_none() {
            self.timeline.pass_over(samples);
            self.note(samples);
        }
    }

    fn note(&mut self, lost: u64) {
        self.losses.gaps += u32::from(lost > 0);
        self.losses.samples += lost;
    }

    /// Notices that nothing comes.
    fn watch(&mut self, now: f64) -> Option<Silence> {
        let since = *self.received_at.get_or_insert(now);
        let seconds = now - since;
        if seconds <= self.silence_s {
            return None;
        }
        let renewed = self.renewed_at.unwrap_or(since);
        let renews = self.renewed_at.is_none() || now > renewed + 3.0 * self.silence_s;
        if renews {
            self.losses.stalls += u32::from(self.renewed_at.is_none());
            self.renewed_at = Some(now);
        }
        Some(Silence { seconds, renews })
    }
}

/// The count of samples held against a clock.
///
/// All that had come when the stream was empty is a bound on when those samples were taken; the
/// tightest bound is the timeline's origin. It follows a slow sample clock by [`DRIFT`] at most.
#[derive(Clone, Copy, Debug)]
struct Timeline {
    rate_hz: f64,
    /// Index of the next sample.
    index: u64,
    /// Latest time at which sample 0 was taken.
    origin: Option<f64>,
    /// Time at which the origin was last moved.
    moved_at: f64,
    /// Since when the lag is watched, and the least one since.
    watched: Option<(f64, f64)>,
}

impl Timeline {
    fn new(rate_hz: f64) -> Self {
        Self { rate_hz, index: 0, origin: None, moved_at: 0.0, watched: None }
    }

    fn has_begun(&self) -> bool {
        self.origin.is_some()
    }

    fn time_of(&self, index: f64) -> Option<f64> {
        Some(self.origin? + index / self.rate_hz)
    }

    fn index_at(&self, time: f64) -> u64 {
        self.origin.map_or(0, |origin| count((time - origin) * self.rate_hz))
    }

    /// Counts samples that have come; the index of the first.
    fn take(&mut self, now: f64, samples: u64) -> u64 {
        let first = self.index;
        self.index = self.index.saturating_add(samples);
        let bound = now - seconds(self.index, self.rate_hz);
        match &mut self.origin {
            None => (self.origin, self.moved_at) = (Some(bound), now),
            Some(origin) => {
                *origin += DRIFT * (now - self.moved_at).max(0.0);
                *origin = origin.min(bound);
                self.moved_at = now;
            }
        }
        first
    }

    /// Everything that had come is counted: how many samples were lost before the next one, which
    /// is known when the count has lagged behind for a while.
    fn watch(&mut self, now: f64) -> u64 {
        let Some(origin) = self.origin else { return 0 };
        let lag = now - origin - seconds(self.index, self.rate_hz);
        let (since, least) = self.watched.unwrap_or((now, lag));
        let least = least.min(lag);
        self.watched = Some((since, least));
        if now < since + WATCH_S {
            return 0;
        }
        self.watched = None;
        if least > SLACK_S { self.skip(least) } else { 0 }
    }

    /// Goes on after the samples of another timeline, which are left out; returns the number lost
    /// in between.
    fn join(&mut self, fresh: &Self) -> u64 {
        self.watched = None;
        let Some(next) = fresh.time_of_next() else { return 0 };
        match self.time_of_next() {
            None => {
                (self.origin, self.moved_at) = (Some(next), fresh.moved_at);
                0
            }
            Some(expected) => self.skip(next - expected),
        }
    }

    /// Returns the latest time at which the next sample is taken.
    fn time_of_next(&self) -> Option<f64> {
        Some(self.origin? + seconds(self.index, self.rate_hz))
    }

    /// Passes over `samples` samples that never come.
    fn pass_over(&mut self, samples: u64) {
        self.index = self.index.saturating_add(samples);
        self.watched = None;
    }

    fn skip(&mut self, lag: f64) -> u64 {
        let lost = count(lag * self.rate_hz);
        self.pass_over(lost);
        lost
    }
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "not negative, and saturates"
)]
fn count(samples: f64) -> u64 {
    samples.round().max(0.0) as u64
}

#[expect(clippy::cast_precision_loss, reason = "below 2^52: a century")]
fn seconds(samples: u64, rate_hz: f64) -> f64 {
    samples as f64 / rate_hz
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    const RATE: f64 = 1000.0;

    /// Counts blocks of half a second that come as late as `delay` has it, and are lost if it is
    /// `None`; returns what was lost, and the timeline. The stream is looked at every 10 ms.
    fn run(seconds: u32, delay: impl Fn(u32) -> Option<f64>) -> (u64, Timeline) {
        let mut timeline = Timeline::new(RATE);
        let mut lost = 0;
        let blocks: Vec<(f64, u64)> = (0..2 * seconds)
            .filter_map(|n| Some((0.5 * f64::from(n + 1) + delay(n)?, 500)))
            .collect();
        let mut next = blocks.into_iter().peekable();
        for tick in 0..100 * seconds {
            let now = 0.01 * f64::from(tick);
            while let Some((_, samples)) = next.next_if(|(at, _)| *at <= now) {
                timeline.take(now, samples);
            }
            lost += timeline.watch(now);
        }
        (lost, timeline)
    }

    #[test]
    fn what_is_late_is_not_lost() {
        // A network that holds everything up for 0.8 s, then delivers it.
        let (lost, timeline) = run(60, |n| Some(if n == 40 { 0.8 } else { 0.02 }));
        assert_eq!(lost, 0);
        let place = timeline.time_of(30_000.0).expect("it has begun");
        assert_abs_diff_eq!(place, 30.0, epsilon = 0.05);
    }

    #[test]
    fn what_is_lost_is_jumped_over() {
        let (lost, timeline) = run(60, |n| (n != 40 && n != 41).then_some(0.02));
        assert!((990..=1030).contains(&lost), "{lost}");
        assert!((timeline.index_at(50.0)).abs_diff(50_000) < 60);
        assert!(timeline.index.abs_diff(59_500) < 60, "{}", timeline.index);
    }

    #[test]
    fn a_slow_sample_clock_is_followed() {
        // 100 ppm: 0.06 s in ten minutes.
        let (lost, timeline) = run(600, |n| Some(0.02 + 5e-5 * f64::from(n)));
        assert_eq!(lost, 0);
        let late = timeline.time_of(600_000.0).expect("it has begun") - 600.0;
        assert!((0.07..0.10).contains(&late), "{late}");
    }

    #[test]
    fn a_new_connection_goes_on_at_its_time() {
        let mut timeline = Timeline::new(RATE);
        assert_eq!(timeline.take(1.0, 1000), 0);
        // Blocks of half a second in two parts, the first of which is no bound on anything.
        let mut fresh = Timeline::new(RATE);
        for (now, samples) in [(4.0, 100), (4.0, 400), (4.5, 100), (4.5, 400)] {
            fresh.take(now, samples);
        }
        assert_eq!(timeline.join(&fresh), 3500);
        assert_eq!(timeline.take(5.0, 500), 4500);
        // Nothing goes back, whatever the clock shows.
        let mut early = Timeline::new(RATE);
        early.take(2.0, 500);
        assert_eq!(timeline.join(&early), 0);
        assert_eq!(timeline.take(2.0, 500), 5000);
    }
}
