/// Returns true if the moment `at` has come. A nanosecond is forgiven: time is a sum of steps, and
/// its rounding must not cost a step more.
#[inline]
pub(crate) fn is_due(at: f64, now: f64) -> bool {
    now >= at - 1e-9
}

/// A time in which drones that rest are left alone.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Free {
    /// Its end, in seconds.
    pub(crate) until: f64,
    /// Time from one moment at which devices may be polled to the next, in seconds.
    pub(crate) step: f64,
}

/// Nobody goes ahead.
impl Default for Free {
    fn default() -> Self {
        Self { until: f64::NEG_INFINITY, step: 0.0 }
    }
}

impl Free {
    /// The step after a moment, if it is free.
    #[inline]
    pub(super) fn step_from(&self, time: f64) -> Option<f64> {
        let next = time + self.step;
        // Not so for a step that is too small to be added, either.
        (next > time && next < self.until).then_some(next)
    }

    /// The first step from a moment on, itself included, at which `event` has come.
    #[inline]
    pub(super) fn reach(&self, event: f64, mut time: f64) -> Option<f64> {
        while !is_due(event, time) {
            time = self.step_from(time)?;
        }
        Some(time)
    }
}
