use std::{fmt, ops::Range, str::FromStr};

/// One of several parts of a campaign, each of which another process flies.
///
/// Runs are divided into parts that lie one after the other and differ by one run at most.
///
/// ```
/// use foxhunt_lab::store::Shard;
///
/// let second: Shard = "2/3".parse()?;
/// assert_eq!(second.of(10), 3..6);
/// # Ok::<(), foxhunt_lab::store::ShardError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    number: u32,
    count: u32,
}

impl Shard {
    /// All of it: the first part of one.
    pub const WHOLE: Self = Self { number: 1, count: 1 };

    /// Part `number`, counted from 1, of `count`.
    ///
    /// # Errors
    ///
    /// [`ShardError`] when there is no such part.
    pub fn new(number: u32, count: u32) -> Result<Self, ShardError> {
        if (1..=count).contains(&number) {
            Ok(Self { number, count })
        } else {
            Err(ShardError { given: format!("{number}/{count}") })
        }
    }

    /// Its part of `runs` runs.
    #[must_use]
    pub fn of(self, runs: u32) -> Range<u32> {
        let before = |parts: u32| {
            let runs = u64::from(runs) * u64::from(parts) / u64::from(self.count);
            u32::try_from(runs).unwrap_or(u32::MAX)
        };
        before(self.number - 1)..before(self.number)
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.count)
    }
}

impl FromStr for Shard {
    type Err = ShardError;

    fn from_str(text: &str) -> Result<Self, ShardError> {
        let error = || ShardError { given: text.to_owned() };
        let (number, count) = text.split_once('/').ok_or_else(error)?;
        let whole = |digits: &str| digits.parse().map_err(|_| error());
        Self::new(whole(number)?, whole(count)?)
    }
}

/// There is no such part of a campaign.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("shard {given:?} must be K/N, with whole numbers and 1 ≤ K ≤ N")]
pub struct ShardError {
    given: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_cover_all_runs_once() {
        for (runs, count) in [(10, 3), (2, 5), (1, 1), (0, 2), (u32::MAX, 7)] {
            let mut next = 0;
            for number in 1..=count {
                let part = Shard::new(number, count).expect("it is one of them").of(runs);
                assert_eq!(part.start, next);
                assert!(part.len() <= (runs as usize).div_ceil(count as usize));
                next = part.end;
            }
            assert_eq!(next, runs);
        }
    }

    #[test]
    fn what_is_no_shard_is_refused() {
        for text in ["0/3", "4/3", "1", "1/0", "a/2", "-1/2", "1/2/3", ""] {
            let error = text.parse::<Shard>().expect_err("it is none").to_string();
            assert!(error.contains(&format!("{text:?}")), "{error}");
        }
        assert_eq!("2/3".parse::<Shard>().expect("one").to_string(), "2/3");
    }
}
