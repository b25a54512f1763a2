//! Bearings of a sweep, the directions that compete for one, and what extracts them.

use crate::{
    Sweep,
    angle::{self, Resultant},
};

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
    /// Standard deviation of the mean power, in dB.
    pub rss_sigma_db: f64,
    /// The direction of arrival, or the reason that there is no bearing. Where several compete,
    /// their common mean and a σ that covers them.
    pub bearing: Result<Bearing, NoBearing>,
    /// The covariance of level and bearing, in dB rad.
    pub covariance: f64,
    /// The directions that compete, where there is more than one.
    pub modes: BearingModes,
}

impl Reading {
    /// σ in dB of a level about a path-loss law over a wooded site, in the field of the reference
    /// (Pritzl 2018, §7.5).
    pub const RSS_SIGMA_DB: f64 = 7.9;
}

/// A direction of arrival and how well it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Bearing {
    /// The direction in radians in the world frame.
    pub angle: f64,
    /// Standard deviation of the direction, in radians.
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
    #[error(
        "the strongest readings do not single out a direction (resultant length {resultant:.3})"
    )]
    Ambiguous {
        /// Mean resultant length of the strongest readings, from 0 (none) to 1 (sharp).
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
    #[error(
        "the bearing's standard deviation is {sigma:.3} rad; at most {limit:.3} rad are allowed"
    )]
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
        /// Position of the sample.
        position: u16,
        /// Number of positions of a turn.
        positions: u16,
    },
    /// The sample's boresight belongs to no antenna that the extractor knows.
    #[error(
        "sample {index} is towards {boresight} rad, a direction in which the antenna never points"
    )]
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

/// One of several directions that a turn of the antenna may have received its signal from.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct BearingMode {
    /// The probability that the signal came from this direction.
    pub weight: f64,
    /// The direction in radians in the world frame.
    pub angle: f64,
    /// Standard deviation of the direction in radians, if the signal came from there.
    pub sigma: f64,
}

/// The directions that compete for one turn: side lobes, an antenna's back, a reflection.
///
/// A mixture of Gaussians on the circle, its weights summing to 1; empty where there is only one
/// bearing. Kept in place, without an allocator.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "[Option<BearingMode>; 4]"))]
#[cfg_attr(feature = "serde", serde(into = "[Option<BearingMode>; 4]"))]
pub struct BearingModes {
    modes: [BearingMode; BearingModes::CAPACITY],
    count: usize,
}

impl BearingModes {
    /// Maximum number of competing directions.
    pub const CAPACITY: usize = 4;

    /// The mixture of these directions, with weights in proportion to theirs; fewer than two do not
    /// compete and leave it empty.
    ///
    /// # Errors
    ///
    /// [`BearingModesError`] names the number that is out of its range.
    pub fn new(modes: &[BearingMode]) -> Result<Self, BearingModesError> {
        let count = modes.len();
        let capacity = Self::CAPACITY;
        if count > capacity {
            return Err(BearingModesError::TooMany { count, capacity });
        }
        let mut total = 0.0;
        for (index, mode) in modes.iter().enumerate() {
            // Its square counts, too, and the sum of the weights.
            let positive = |value: f64| value > 0.0 && value.is_finite();
            for (field, value, holds, requirement) in [
                ("weight", mode.weight, positive(mode.weight), "a positive number"),
                ("angle", mode.angle, mode.angle.is_finite(), "finite"),
                (
                    "sigma",
                    mode.sigma,
                    mode.sigma > 0.0 && positive(mode.sigma * mode.sigma),
                    "a positive number",
                ),
            ] {
                if !holds {
                    return Err(BearingModesError::Field { index, field, value, requirement });
                }
            }
            total += mode.weight;
            if !positive(total) {
                let field = "weight";
                let value = mode.weight;
                let requirement = "of a finite sum";
                return Err(BearingModesError::Field { index, field, value, requirement });
            }
        }
        let mut made = Self::default();
        if count > 1 {
            for (own, mode) in made.modes.iter_mut().zip(modes) {
                let weight = (mode.weight / total).max(f64::MIN_POSITIVE);
                *own = BearingMode { weight, ..*mode };
            }
            made.count = count;
        }
        Ok(made)
    }

    /// Returns the competing directions: either empty or at least two.
    #[must_use]
    pub fn as_slice(&self) -> &[BearingMode] {
        self.modes.get(..self.count).unwrap_or(&[])
    }

    /// Returns true if nothing competes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// The one direction and σ that stand for all of them: the circular mean, and the root of the
    /// mean square about it. About the likeliest direction where they cancel; `None` where nothing
    /// competes.
    #[must_use]
    pub fn moments(&self) -> Option<(f64, f64)> {
        let likeliest = self.as_slice().iter().max_by(|a, b| a.weight.total_cmp(&b.weight))?;
        let mut resultant = Resultant::default();
        for mode in self.as_slice() {
            resultant.add(mode.angle, mode.weight);
        }
        let mean = resultant.direction(1e-9).unwrap_or(angle::wrap(likeliest.angle));
        let square = |mode: &BearingMode| {
            let off = angle::distance(mode.angle, mean);
            mode.weight * (mode.sigma * mode.sigma + off * off)
        };
        Some((mean, libm::sqrt(self.as_slice().iter().map(square).sum())))
    }

    /// Replaces the σ of each direction.
    #[must_use]
    pub(crate) fn with_sigma(mut self, sigma: impl Fn(f64) -> f64) -> Self {
        self.modes.iter_mut().for_each(|mode| mode.sigma = sigma(mode.sigma));
        self
    }
}

#[cfg(feature = "serde")]
impl TryFrom<[Option<BearingMode>; Self::CAPACITY]> for BearingModes {
    type Error = BearingModesError;

    fn try_from(read: [Option<BearingMode>; Self::CAPACITY]) -> Result<Self, BearingModesError> {
        let mut modes = [BearingMode::default(); Self::CAPACITY];
        let mut count = 0;
        for (own, mode) in modes.iter_mut().zip(read.into_iter().flatten()) {
            *own = mode;
            count += 1;
        }
        Self::new(modes.get(..count).unwrap_or(&[]))
    }
}

/// Reason for refusing competing directions.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BearingModesError {
    /// There are too many of them.
    #[error("{count} directions compete; there is room for {capacity}")]
    TooMany {
        /// The number of directions.
        count: usize,
        /// The maximum number of directions.
        capacity: usize,
    },
    /// A number of one of them is out of its range.
    #[error("direction {index} has the {field} {value}; it must be {requirement}")]
    Field {
        /// Index of the direction.
        index: usize,
        /// Name of the field.
        field: &'static str,
        /// Value of the field.
        value: f64,
        /// The requirement that the value does not meet.
        requirement: &'static str,
    },
}

#[cfg(feature = "serde")]
impl From<BearingModes> for [Option<BearingMode>; BearingModes::CAPACITY] {
    fn from(modes: BearingModes) -> Self {
        core::array::from_fn(|i| modes.as_slice().get(i).copied())
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_abs_diff_eq;
    use core::f64::consts::PI;

    use super::*;

    fn mode(weight: f64, angle: f64, sigma: f64) -> BearingMode {
        BearingMode { weight, angle, sigma }
    }

    #[test]
    fn two_directions_have_the_moments_of_their_mixture() {
        let modes = BearingModes::new(&[mode(6.0, PI - 0.1, 0.2), mode(2.0, -PI + 0.3, 0.4)]);
        let (mean, sigma) = modes.expect("proper").moments().expect("they agree");
        // Resultants: the mean of directions so near each other is nearly linear.
        assert!(angle::distance(mean, PI) < 2e-3, "{mean}");
        let off = [angle::distance(PI - 0.1, mean), angle::distance(-PI + 0.3, mean)];
        let square = 0.75 * (0.04 + off[0] * off[0]) + 0.25 * (0.16 + off[1] * off[1]);
        assert_abs_diff_eq!(sigma, libm::sqrt(square), epsilon = 1e-12);
    }

    #[test]
    fn opposite_directions_stand_for_nothing_much() {
        let modes = BearingModes::new(&[mode(0.5, 0.3, 0.1), mode(0.5, 0.3 + PI, 0.1)]);
        let (mean, sigma) = modes.expect("proper").moments().expect("something competes");
        assert_abs_diff_eq!(mean, 0.3 - PI, epsilon = 1e-12);
        assert_abs_diff_eq!(sigma, libm::sqrt(0.01 + 0.5 * PI * PI), epsilon = 1e-9);
    }

    #[test]
    fn what_is_no_mixture_is_refused() {
        let good = mode(1.0, 0.0, 0.1);
        for bad in [mode(-1.0, 0.0, 0.1), mode(1.0, f64::NAN, 0.1), mode(1.0, 0.0, 1e-170)] {
            assert!(BearingModes::new(&[good, bad]).is_err(), "{bad:?}");
        }
        assert!(BearingModes::new(&[good; 5]).is_err());
        assert!(BearingModes::new(&[good]).expect("proper").is_empty());
    }

    #[cfg(feature = "serde")]
    #[test]
    fn a_mixture_in_a_file_is_the_same_one() {
        for modes in [&[][..], &[mode(0.25, 1.0, 0.1), mode(0.75, -1.0, 0.2)]] {
            let modes = BearingModes::new(modes).expect("proper");
            let text = serde_json::to_string(&modes).expect("plain data");
            assert_eq!(serde_json::from_str::<BearingModes>(&text).expect("as written"), modes);
        }
        let bad = r#"[{"weight":1.0,"angle":0.0,"sigma":-1.0},null,null,null]"#;
        assert!(serde_json::from_str::<BearingModes>(bad).is_err(), "σ is negative");
    }
}
