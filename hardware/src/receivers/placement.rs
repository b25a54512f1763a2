use super::timeline::Timeline;

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
pub(super) struct Silence {
    /// Its length in seconds.
    pub(super) seconds: f64,
    /// True if the stream is to be opened again now.
    pub(super) renews: bool,
}

/// Place of a stream's samples in time, with their losses: a count that is held against the clock.
#[derive(Clone, Debug)]
pub(super) struct Placement {
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
    pub(super) fn new(rate_hz: f64, settling_s: f64, silence_s: f64) -> Self {
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

    pub(super) fn losses(&self) -> SampleLosses {
        self.losses
    }

    pub(super) fn timeline(&self) -> &Timeline {
        &self.timeline
    }

    /// Settles again: the next samples do not follow the last, and their place in time has to be
    /// found.
    pub(super) fn settle(&mut self, now: f64) {
        self.settling = Some((now, Timeline::new(self.rate_hz)));
    }

    /// A new connection, of which nothing has come.
    pub(super) fn restart(&mut self, now: f64) {
        self.received_at = Some(now);
        self.renewed_at = None;
    }

    /// Notes that something has come; returns true if that is the first after a silence.
    pub(super) fn received(&mut self, now: f64) -> bool {
        self.received_at = Some(now);
        self.renewed_at.take().is_some()
    }

    /// Counts samples that have come: the index of the first; `None` while the receiver settles.
    pub(super) fn take(&mut self, now: f64, samples: u64) -> Option<u64> {
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
    pub(super) fn drained(&mut self, now: f64) {
        if self.settling.is_none() {
            let lost = self.timeline.watch(now);
            self.note(lost);
        }
    }

    /// Notes that `samples` samples are known to be lost before the next one.
    #[cfg(feature = "soapy")]
    pub(super) fn lost(&mut self, samples: u64) {
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
    pub(super) fn watch(&mut self, now: f64) -> Option<Silence> {
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
