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

    /// The σ in radians that a bearing from such samples is expected to have, which a source may
    /// turn on for; unless overridden that of the bearing that they give, and `None` where they
    /// give none.
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
    /// The direction of arrival, or why there is none. Where several compete, their common mean
    /// and a σ that covers them.
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
    /// How far the sweep looks like one transmitter received through one main lobe: 0 not at
    /// all, 1 without a doubt. Each extractor documents how it counts.
    pub confidence: f64,
}

/// Why a sweep has no bearing, though it may have a level.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(tag = "reason", rename_all = "snake_case"))]
#[non_exhaustive]
pub enum NoBearing {
    /// Too little of the circle holds a reading.
    #[error("{measured} of the turn's positions hold a reading; {needed} are needed")]
    TooSparse {
        /// How many positions hold a reading.
        measured: u16,
        /// How many the extractor needs.
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
        /// That of the readings about their mean, in dB.
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

/// Why a sweep gives no reading.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoReading {
    /// There is no sample in it.
    #[error("the sweep has no samples")]
    Empty,
    /// A sample holds NaN or infinity.
    #[error("sample {index} of the sweep has the {field} {value}, not a finite number")]
    NotFinite {
        /// Which sample.
        index: usize,
        /// Which of its fields.
        field: &'static str,
        /// What it held.
        value: f64,
    },
    /// The number of positions does not fit the extractor or the samples.
    #[error("sample {index} is at position {position} of a turn of {positions}")]
    Position {
        /// Which sample.
        index: usize,
        /// Its position.
        position: u16,
        /// How many positions a turn has.
        positions: u16,
    },
    /// A sample is of none of the antennas that the extractor knows.
    #[error("sample {index} is towards {boresight} rad, where no antenna looks")]
    Boresight {
        /// Which sample.
        index: usize,
        /// Where its antenna looks, in radians.
        boresight: f64,
    },
    /// The turn has more positions than the extractor has room for.
    #[error("the turn has {positions} positions; the extractor holds 1 to {capacity}")]
    Capacity {
        /// How many positions the turn has.
        positions: u16,
        /// How many the extractor holds.
        capacity: u16,
    },
}
