//! UNIX time, which computers exchange, and the offset of a drone's clock from it.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

/// Greatest drift of one clock from another: quartz is within 100 ppm in all weathers.
const DRIFT: f64 = 200e-6;

/// Greatest rounding of stamps, in seconds.
const RESOLUTION_S: f64 = 0.001;

/// Number of the last statuses that are known again in an echo.
const MOST_SENT: usize = 256;

/// Nanoseconds in a second.
const BILLION: u32 = 1_000_000_000;

/// Offset of a clock from that of the fusing node.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClockOffset {
    /// Offset that is added to its times, in seconds.
    pub offset_s: f64,
    /// The true offset is no farther from that, in seconds, unless a clock drifts by more than
    /// 200 ppm.
    pub uncertainty_s: f64,
    /// Number of times that one of the two clocks was set since the node began.
    pub jumps: u32,
}

/// Echo of a [`Status`](super::Status): with the times of the order that carries it, the four
/// stamps of an exchange.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Echo {
    /// Time at which the drone sent it, by its own clock.
    pub sent: UnixTime,
    /// Time at which the status was received, by the clock of the fusing node.
    pub received: UnixTime,
}

/// Estimates how far the own clock is off from another one by exchanged stamps.
///
/// With t₁ the own time at which a message was sent, t₂ and t₃ the other clock's when it was
/// received and answered, and t₄ the own time when the answer came, the offset lies between t₃ − t₄
/// and t₂ − t₁ (Mills 1991), because no message arrives before it was sent. That holds however late
/// t₂ and t₄ are read, and however early t₁ and t₃: a busy computer widens the bounds, and never
/// makes them wrong. The bounds of all
/// exchanges are intersected (Marzullo and Owicki 1983), widened by how much clocks drift; so the
/// fastest message in each direction counts, and slow ones change nothing. The estimate is the
/// middle of the bounds, its uncertainty half their distance.
///
/// An exchange whose bounds lie outside can only come of a clock that was set: the estimate begins
/// again from it.
///
/// ```
/// use foxhunt_hardware::link::{ClockFilter, Echo, UnixTime};
///
/// let mut filter = ClockFilter::default();
/// let own = UnixTime::whole(1_800_000_000);
/// filter.sent(own);
/// // The other clock is 5 s ahead; each message is 20 ms on the way.
/// let (received, came) = (own.after(5.02).expect("a time"), own.after(0.04).expect("a time"));
/// filter.came_back(Echo { sent: own, received }, received, came);
/// let clock = filter.offset(came).expect("one exchange");
/// assert!((clock.offset_s - 5.0).abs() < 1e-9 && clock.uncertainty_s < 0.03);
/// ```
#[derive(Clone, Debug, Default)]
pub struct ClockFilter {
    bounds: Option<Bounds>,
    sent: VecDeque<UnixTime>,
    jumps: u32,
}

/// Between which offsets the true one lies, in seconds, at an own time.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    low_s: f64,
    high_s: f64,
    at: UnixTime,
}

impl Bounds {
    /// The bounds later on, by when the clocks may have drifted.
    fn widened(self, now: UnixTime) -> Self {
        let drifted_s = DRIFT * now.since(self.at).abs();
        Self { low_s: self.low_s - drifted_s, high_s: self.high_s + drifted_s, at: now }
    }
}

impl ClockFilter {
    /// Notes that a message with this own time was sent, so that its echo is known.
    pub fn sent(&mut self, sent: UnixTime) {
        if self.sent.len() == MOST_SENT {
            self.sent.pop_front();
        }
        self.sent.push_back(sent);
    }

    /// Takes the stamps of an exchange: the echo, when it was `answered` by the other clock, and
    /// when that `came` by the own one. `true` if a clock was set since the exchange before.
    pub fn came_back(&mut self, echo: Echo, answered: UnixTime, came: UnixTime) -> bool {
        // An echo of an earlier run may be of another clock.
        if !self.sent.contains(&echo.sent) {
            return false;
        }
        let exchanged = Bounds {
            low_s: answered.since(came) - RESOLUTION_S,
            high_s: echo.received.since(echo.sent) + RESOLUTION_S,
            at: came,
        };
        // A clock was set while it was under way.
        if exchanged.low_s > exchanged.high_s {
            return false;
        }
        let Some(before) = self.bounds.map(|bounds| bounds.widened(came)) else {
            self.bounds = Some(exchanged);
            return false;
        };
        let low_s = before.low_s.max(exchanged.low_s);
        let high_s = before.high_s.min(exchanged.high_s);
        let jumped = low_s > high_s;
        self.bounds = Some(match jumped {
            true => exchanged,
            false => Bounds { low_s, high_s, at: came },
        });
        if jumped {
            self.jumps = self.jumps.saturating_add(1);
            // Those before the jump are of another clock.
            self.sent.clear();
        }
        jumped
    }

    /// The offset at an own time; `None` before the first exchange.
    #[must_use]
    pub fn offset(&self, now: UnixTime) -> Option<ClockOffset> {
        let bounds = self.bounds?.widened(now);
        Some(ClockOffset {
            offset_s: f64::midpoint(bounds.low_s, bounds.high_s),
            uncertainty_s: (bounds.high_s - bounds.low_s) / 2.0,
            jumps: self.jumps,
        })
    }
}

/// A moment in UNIX time, which is what computers exchange: their own clocks begin when they
/// like.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
#[serde(deny_unknown_fields)]
pub struct UnixTime {
    /// Whole seconds since 1970.
    pub sec: i64,
    /// And nanoseconds, below 10⁹.
    pub nanosec: u32,
}

impl UnixTime {
    /// A whole second.
    #[must_use]
    pub const fn whole(sec: i64) -> Self {
        Self { sec, nanosec: 0 }
    }

    /// Returns the moment `seconds` after this one, to the nanosecond; `None` for a number that is
    /// not finite, or beyond a hundred years.
    #[must_use]
    pub fn after(self, seconds: f64) -> Option<Self> {
        // A hundred years, which leaves doubles of seconds a resolution below a microsecond.
        if !(-3.2e9..=3.2e9).contains(&seconds) {
            return None;
        }
        let whole = seconds.floor();
        #[expect(clippy::cast_possible_truncation, reason = "a whole number of up to 3.2e9")]
        let whole_sec = whole as i64;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "from 0 to a billion"
        )]
        let fraction = ((seconds - whole) * f64::from(BILLION)).round() as u32;
        let nanosec = self.nanosec.min(BILLION - 1) + fraction.min(BILLION);
        let sec = self.sec.checked_add(whole_sec)?.checked_add(i64::from(nanosec / BILLION))?;
        Some(Self { sec, nanosec: nanosec % BILLION })
    }

    /// Returns the seconds since `epoch`; the same for everyone, to the bit.
    #[must_use]
    pub fn since(self, epoch: Self) -> f64 {
        let whole = self.sec.saturating_sub(epoch.sec);
        #[expect(clippy::cast_precision_loss, reason = "exact for two hundred million years")]
        let whole = whole as f64;
        whole + (f64::from(self.nanosec) - f64::from(epoch.nanosec)) * 1e-9
    }

    /// Nanoseconds since 1970; 0 before that.
    #[must_use]
    pub fn nanoseconds(self) -> u64 {
        let sec = u64::try_from(self.sec).unwrap_or(0);
        sec.saturating_mul(u64::from(BILLION)).saturating_add(u64::from(self.nanosec))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const START: UnixTime = UnixTime::whole(1_800_000_000);

    /// Exchanges every 0.2 s with these delays; the own clock reads `own` at a true time.
    fn exchange(
        filter: &mut ClockFilter,
        from_s: f64,
        delays: &[(f64, f64)],
        own: impl Fn(f64) -> f64,
    ) -> Vec<f64> {
        let at = |seconds: f64| START.after(seconds).expect("some seconds");
        let mut exchanges = Vec::new();
        for (index, (there, back)) in delays.iter().enumerate() {
            #[expect(clippy::cast_precision_loss, reason = "few")]
            let time = from_s + 0.2 * index as f64;
            filter.sent(at(own(time)));
            exchanges.push((time, time + there, time + there + back));
        }
        exchanges.sort_by(|one, other| one.2.total_cmp(&other.2));
        let mut jumps = Vec::new();
        for (time, received, came) in exchanges {
            let echo = Echo { sent: at(own(time)), received: at(received) };
            if filter.came_back(echo, at(received), at(own(came))) {
                jumps.push(time);
            }
        }
        jumps
    }

    proptest! {
        /// Whatever the delays, the true offset is within the uncertainty, also of clocks that
        /// drift, and no drift is taken for a jump.
        #[test]
        fn the_offset_is_within_its_uncertainty(
            offset in -1e6_f64..1e6,
            drift in -1e-4_f64..1e-4,
            delays in proptest::collection::vec((0.0..3.0, 0.0..3.0), 1..200),
        ) {
            let mut filter = ClockFilter::default();
            let own = |time: f64| time * (1.0 + drift) + offset;
            let jumps = exchange(&mut filter, 0.0, &delays, own);
            prop_assert!(jumps.is_empty(), "{:?}", jumps);
            let end = 6.0 + 0.2 * f64::from(u32::try_from(delays.len()).expect("few"));
            let now = START.after(own(end)).expect("some seconds");
            let clock = filter.offset(now).expect("exchanges");
            let error = clock.offset_s - (end - own(end));
            prop_assert!(error.abs() <= clock.uncertainty_s, "{} {:?}", error, clock);
            let fastest = |of: fn(&(f64, f64)) -> f64| delays.iter().map(of).fold(9.0, f64::min);
            // Half of the fastest way in each direction, of whatever exchange, and the drift.
            let most = (fastest(|d| d.0) + fastest(|d| d.1)) / 2.0 + 2.0 * DRIFT * end + 0.01;
            prop_assert!(clock.uncertainty_s <= most, "{:?}, {}", clock, most);
        }

        #[test]
        fn a_jump_is_noticed_once(
            offset in -10.0_f64..10.0, size in 0.2_f64..1e4, back in any::<bool>(),
            delays in proptest::collection::vec((0.0..0.1, 0.0..0.1), 20..40),
        ) {
            let jump = if back { -size } else { size };
            let mut filter = ClockFilter::default();
            let before = exchange(&mut filter, 0.0, &delays, |time| time + offset);
            prop_assert!(before.is_empty());
            let after = exchange(&mut filter, 20.0, &delays, |time| time + offset + jump);
            prop_assert_eq!(after, vec![20.0]);
            let clock = filter.offset(START.after(28.0 + offset + jump).expect("a time"));
            let clock = clock.expect("exchanges");
            prop_assert_eq!(clock.jumps, 1);
            prop_assert!((clock.offset_s + offset + jump).abs() <= clock.uncertainty_s);
            prop_assert!(clock.uncertainty_s < 0.12);
        }
    }

    #[test]
    fn an_echo_of_an_earlier_run_counts_for_nothing() {
        let mut filter = ClockFilter::default();
        filter.sent(START);
        let old = Echo { sent: UnixTime::whole(1_700_000_000), received: START };
        assert!(!filter.came_back(old, START, START));
        assert_eq!(filter.offset(START), None);
    }

    proptest! {
        #[test]
        fn seconds_go_there_and_back(
            sec in 0_i64..4_000_000_000, nanosec in 0..BILLION, seconds in -1e6..1e6,
        ) {
            let epoch = UnixTime { sec, nanosec };
            let then = epoch.after(seconds).expect("some days");
            prop_assert!(then.nanosec < BILLION);
            prop_assert!((then.since(epoch) - seconds).abs() < 1e-9);
            prop_assert_eq!(epoch.after(then.since(epoch)), Some(then));
        }
    }

    #[test]
    fn what_is_no_time_is_none() {
        let now = UnixTime { sec: 1_700_000_000, nanosec: BILLION - 1 };
        for seconds in [f64::NAN, f64::INFINITY, -1e300, 1e10] {
            assert_eq!(now.after(seconds), None);
        }
        assert_eq!(now.after(1e-9), Some(UnixTime::whole(1_700_000_001)));
        assert_eq!(now.after(-1.0), Some(UnixTime { sec: 1_699_999_999, ..now }));
        assert_eq!(UnixTime { sec: i64::MAX, nanosec: 0 }.after(1.0), None);
        assert_eq!(now.nanoseconds(), 1_700_000_000_999_999_999);
    }
}
