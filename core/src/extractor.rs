use crate::{BearingModes, Sweep};

/// Makes a level and a bearing of one turn of the antenna.
///
/// # Laws
///
/// Checked by `laws::bearing_extractor`, feature `laws`: a turn of the whole sweep turns the
/// bearing by as much and leaves its σ; more power on every sample raises the level by as much;
/// a sweep without samples is refused.
pub trait BearingExtractor {
    /// The level, and the direction of arrival with the σ that this very sweep warrants.
    ///
    /// # Errors
    ///
    /// [`NoReading`] when the sweep holds nothing of use.
    fn extract(&self, sweep: &Sweep<'_>) -> Result<Reading, NoReading>;

    /// The expected σ in radians of a bearing from such samples, on which a source may decide to
    /// turn on; unless overridden, the σ of the bearing that they give, and `None` if they give no
    /// bearing.
    fn expected_sigma(&self, sweep: &Sweep<'_>) -> Option<f64> {
        self.extract(sweep).ok()?.bearing.ok().map(|bearing| bearing.sigma)
    }
}

/// An extractor's result for a sweep: level, bearing, and the directions that compete.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// The mean power over the turn, in dBm.
    pub rss_dbm: f64,
    /// Its standard deviation in dB.
    pub rss_sigma_db: f64,
    /// The direction of arrival, or the reason that there is no bearing. Where several compete,
    /// their common mean and a σ that covers them.
    pub bearing: Result<Bearing, NoBearing>,
    /// The covariance of level and bearing, in dB rad.
    pub covariance: f64,
    /// The directions that compete, where there is more than one.
    pub modes: BearingModes,
}

/// A direction of arrival and how well it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Bearing {
    /// The direction in radians in the world frame.
    pub angle: f64,
    /// Its standard deviation in radians.
    pub sigma: f64,
    /// Similarity of the sweep to one transmitter received through one main lobe: 0 not at all, 1
    /// without a doubt. Each extractor documents how it counts.
    pub confidence: f64,
}

/// Reason that a sweep has no bearing, though it may have a level.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(tag = "reason", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum NoBearing {
    /// Too little of the circle holds a reading.
    #[error("{measured} of the turn's positions hold a reading; {needed} are needed")]
    TooSparse {
        /// Number of positions that hold a reading.
        measured: u16,
        /// Number of positions that the extractor needs.
        needed: u16,
    },
    /// The strongest readings cancel: opposite lobes, or a flat pattern.
    #[error("the strongest readings single out no direction (resultant length {resultant:.3})")]
    Ambiguous {
        /// Their mean resultant length, from 0 (none) to 1 (sharp).
        resultant: f64,
    },
    /// The antenna's pattern, wherever it is turned, fits no better than the same level all round.
    #[error("the best fit is off by {residual_db:.1} dB, a flat level by {flat_db:.1} dB")]
    PoorFit {
        /// The root mean square of the best fit's residuals, in dB.
        residual_db: f64,
        /// The root mean square of the readings about their mean, in dB.
        flat_db: f64,
    },
    /// The bearing's σ is beyond use.
    #[error("the bearing's standard deviation {sigma:.3} rad is above {limit:.3} rad")]
    TooWide {
        /// The standard deviation, in radians.
        sigma: f64,
        /// The largest that is of use, in radians.
        limit: f64,
    },
}

/// Reason that a sweep gives no reading.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoReading {
    /// There is no sample in it.
    #[error("the sweep has no samples")]
    Empty,
    /// A sample holds NaN or infinity.
    #[error("sample {index} of the sweep has the {field} {value}, not a finite number")]
    NotFinite {
        /// Index of the sample.
        index: usize,
        /// Name of its field.
        field: &'static str,
        /// Value of the field.
        value: f64,
    },
    /// The number of positions does not fit the extractor or the samples.
    #[error("sample {index} is at position {position} of a turn of {positions}")]
    Position {
        /// Index of the sample.
        index: usize,
        /// Its position.
        position: u16,
        /// Number of positions of a turn.
        positions: u16,
    },
    /// The sample's boresight belongs to no antenna that the extractor knows.
    #[error("sample {index} is towards {boresight} rad, where no antenna looks")]
    Boresight {
        /// Index of the sample.
        index: usize,
        /// Direction of its antenna, in radians.
        boresight: f64,
    },
    /// The turn has more positions than the extractor has room for.
    #[error("the turn has {positions} positions; the extractor holds 1 to {capacity}")]
    Capacity {
        /// Number of positions of the turn.
        positions: u16,
        /// Maximum number of positions that the extractor holds.
        capacity: u16,
    },
}
