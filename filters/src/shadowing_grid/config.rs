use alloc::{vec, vec::Vec};

use foxhunt_core::parameter::{finite, in_range, not_negative, positive, require};

use super::ShadowingGridError;

/// What is known of the intercept a: for a received level, the level at 1 m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Intercept {
    /// Nothing: a flat prior over the real line, integrated out.
    Flat,
    /// Its value, in the readings' unit.
    Known(f64),
}

/// What is known of the slope b: for a received level, the path-loss exponent.
#[derive(Clone, Debug, PartialEq)]
pub enum Slope {
    /// Its value.
    Known(f64),
    /// Values it may have, each with its prior weight; the weights need not sum to 1.
    Nodes(Vec<(f64, f64)>),
}

impl Slope {
    /// A Gaussian prior truncated to `lower` … `upper`, on nodes `step` apart from `lower` on.
    ///
    /// # Errors
    ///
    /// [`ShadowingGridError::Parameter`] for a number that is not finite, a `sd` or `step` that is
    /// not positive, or limits that make no nodes or more than 10 000.
    pub fn gaussian(
        mean: f64,
        sd: f64,
        lower: f64,
        upper: f64,
        step: f64,
    ) -> Result<Self, ShadowingGridError> {
        finite("the slope's prior mean", mean)?;
        positive("the slope's prior deviation", sd)?;
        finite("the slope's lower limit", lower)?;
        positive("the slope's step", step)?;
        // Half a step more than configured, so that rounding does not lose the upper limit.
        let steps = (upper - lower) / step + 0.5;
        let countable = (0.5..10_000.0).contains(&steps);
        let requirement = "at most 10 000 steps above the lower";
        require(countable, "the slope's upper limit", upper, requirement)?;
        #[expect(clippy::cast_possible_truncation, reason = "between 0 and 10 000, as checked")]
        let last = steps as u16;
        let node = |i| {
            let value = lower + step * f64::from(i);
            let deviation = (value - mean) / sd;
            (value, libm::exp(-0.5 * deviation * deviation))
        };
        Ok(Self::Nodes((0..=last).map(node).collect()))
    }

    /// The nodes with the logarithms of their weights.
    pub(super) fn log_nodes(&self) -> Vec<(f64, f64)> {
        match self {
            Self::Known(value) => vec![(*value, 0.0)],
            Self::Nodes(nodes) => nodes.iter().map(|&(b, weight)| (b, libm::log(weight))).collect(),
        }
    }
}

/// How [`ShadowingGrid`](super::ShadowingGrid) models the readings and where it looks.
#[derive(Clone, Debug, PartialEq)]
pub struct ShadowingGridConfig {
    /// What is known of the intercept.
    pub intercept: Intercept,
    /// What is known of the slope.
    pub slope: Slope,
    /// The distances, in metres, over which the correlation of two readings falls to 1/e;
    /// equally likely before.
    pub correlation_lengths_m: Vec<f64>,
    /// The share of the variance that is every reading's own, in [0, 1].
    pub nugget: f64,
    /// How far the search goes beyond the receivers' bounding box, in metres.
    pub margin_m: f64,
    /// The side of a cell in metres; larger where the area would take more than `max_cells`.
    pub cell_m: f64,
    /// The most cells a grid may have; at least 100.
    pub max_cells: u32,
    /// The horizontal length of path, in metres, whose readings are made one; 0 keeps every
    /// reading. Longer where the path would make more than `max_segments`.
    pub segment_m: f64,
    /// The most segments, at least 4: time grows with their square, memory too.
    pub max_segments: u32,
}

/// For a received level over −10 log₁₀ of the distance: flat intercept; slope N(2.3, 0.5²) on
/// 1, 1.25 … 4, between free space's 2 and the 2.7 to 3.5 of towns (Rappaport 2002, table 4.2);
/// correlation lengths 15, 25 and 40 m, between the 10 m of street canyons and the 50 m of base
/// stations above roofs (3GPP TR 38.901, table 7.5-6); nugget 0.2; margin 200 m, cells of 10 m,
/// at most 40 000; segments of 10 m, at most 300.
impl Default for ShadowingGridConfig {
    fn default() -> Self {
        let slope = Slope::gaussian(2.3, 0.5, 1.0, 4.0, 0.25);
        Self {
            intercept: Intercept::Flat,
            slope: slope.expect("the limits are finite and in order"),
            correlation_lengths_m: vec![15.0, 25.0, 40.0],
            nugget: 0.2,
            margin_m: 200.0,
            cell_m: 10.0,
            max_cells: 40_000,
            segment_m: 10.0,
            max_segments: 300,
        }
    }
}

impl ShadowingGridConfig {
    /// Names the first setting that is outside of its range.
    pub(super) fn check(&self) -> Result<(), ShadowingGridError> {
        if let Intercept::Known(value) = self.intercept {
            finite("the intercept", value)?;
        }
        match &self.slope {
            Slope::Known(value) => {
                finite("the slope", *value)?;
            }
            Slope::Nodes(nodes) => {
                require(!nodes.is_empty(), "the number of slopes", 0.0, "at least 1")?;
                for &(value, weight) in nodes {
                    finite("the slope", value)?;
                    positive("the slope's weight", weight)?;
                }
            }
        }
        let lengths = !self.correlation_lengths_m.is_empty();
        require(lengths, "the number of correlation lengths", 0.0, "at least 1")?;
        for &length_m in &self.correlation_lengths_m {
            positive("correlation_length_m", length_m)?;
        }
        in_range("nugget", self.nugget, 0.0..=1.0, "in [0, 1]")?;
        not_negative("margin_m", self.margin_m)?;
        positive("cell_m", self.cell_m)?;
        require(self.max_cells >= 100, "max_cells", self.max_cells.into(), "at least 100")?;
        not_negative("segment_m", self.segment_m)?;
        require(self.max_segments >= 4, "max_segments", self.max_segments.into(), "at least 4")?;
        Ok(())
    }
}
