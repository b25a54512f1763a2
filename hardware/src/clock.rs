use std::time::{Instant, SystemTime, UNIX_EPOCH};

use foxhunt_core::Clock;

/// Seconds since it was made, by the machine's monotonic clock; copies agree.
#[derive(Clone, Copy, Debug)]
pub struct SystemClock {
    origin: Instant,
    unix_s: f64,
}

impl SystemClock {
    /// A clock that begins now.
    #[must_use]
    pub fn start() -> Self {
        let unix = SystemTime::now().duration_since(UNIX_EPOCH);
        Self { origin: Instant::now(), unix_s: unix.map_or(0.0, |since| since.as_secs_f64()) }
    }

    /// Returns the UNIX time in seconds at which the clock was started, by the machine's wall
    /// clock.
    #[must_use]
    pub fn started_unix_s(&self) -> f64 {
        self.unix_s
    }
}

impl Clock for SystemClock {
    fn now(&self) -> f64 {
        self.origin.elapsed().as_secs_f64()
    }
}
