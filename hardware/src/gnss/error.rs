use std::io;

/// Error of a GNSS receiver: why there is no place.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GnssError {
    /// The stream failed, and the last fix is too old by now, if there ever was one.
    #[error("the GNSS receiver: {0}")]
    Stream(#[from] io::Error),
    /// It has had no fix until now.
    #[error("the GNSS receiver has no fix yet{}", satellites.map_or(String::new(), |n| format!("; it uses {n} satellites")))]
    NoFix {
        /// Number of satellites that it uses, where it reports that.
        satellites: Option<u32>,
    },
    /// The last fix is too old.
    #[error("the last GNSS fix is {age_s:.1} s old; at most {limit_s} s are allowed")]
    Stale {
        /// Age of the last fix, in seconds.
        age_s: f64,
        /// Greatest age that is allowed, in seconds.
        limit_s: f64,
    },
}
