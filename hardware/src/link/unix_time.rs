use serde::{Deserialize, Serialize};

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

/// Nanoseconds in a second.
const BILLION: u32 = 1_000_000_000;

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
