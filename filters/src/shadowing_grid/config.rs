//! Settings of the grid, their checks, and the reasons for which it gives no place.

use alloc::{vec, vec::Vec};

use foxhunt_core::parameter::{ParameterError, finite, in_range, not_negative, positive, require};
use nalgebra::Vector2;

/// Prior of the intercept a: for a received level, the level at 1 m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Intercept {
    /// Nothing: a flat prior over the real line, integrated out.
    Flat,
    /// Known value of the intercept, in the readings' unit.
    Known(f64),
    /// The value that a calibration measured at one value of the slope's regressor, with the gain's
    /// at zero. Its error is independent of the readings', and of the slope where `regressor` is
    /// the centroid of the calibration.
    Calibrated {
        /// Slope's regressor of the calibration: −10 log₁₀ of the distance for a received
        /// level.
        regressor: f64,
        /// Measured value there, in the readings' unit.
        value: f64,
        /// Variance of its error, in units of the readings' σ².
        variance: f64,
    },
}

/// Prior of a coefficient, such as the path-loss exponent of received levels, or of a height.
#[derive(Clone, Debug, PartialEq)]
pub enum Slope {
    /// Known value of the coefficient.
    Known(f64),
    /// Values it may have, each with its prior weight; the weights need not sum to 1.
    Nodes(Vec<(f64, f64)>),
    /// A Gaussian truncated to `lower` … `upper`, as [`Slope::gaussian`] makes it: summed over
    /// nodes `step` apart, and over closer ones where the readings know it better than that.
    Gaussian {
        /// Mean before the limits cut it off.
        mean: f64,
        /// Standard deviation before the limits cut it off.
        sd: f64,
        /// Least value.
        lower: f64,
        /// Greatest value.
        upper: f64,
        /// Distance of the nodes.
        step: f64,
    },
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
        let prior = Self::Gaussian { mean, sd, lower, upper, step };
        prior.check(["the slope", "the number of slopes", "the slope's weight"])?;
        Ok(prior)
    }

    /// Names what is out of range: a value, the number of nodes, a weight, or a limit.
    fn check(&self, [value, number, weight]: [&'static str; 3]) -> Result<(), ParameterError> {
        match self {
            Self::Known(known) => {
                finite(value, *known)?;
            }
            Self::Nodes(nodes) => {
                require(!nodes.is_empty(), number, 0.0, "at least 1")?;
                for node in nodes {
                    finite(value, node.0)?;
                    positive(weight, node.1)?;
                }
            }
            Self::Gaussian { mean, sd, lower, upper, step } => {
                finite("the slope's prior mean", *mean)?;
                positive("the slope's prior deviation", *sd)?;
                finite("the slope's lower limit", *lower)?;
                positive("the slope's step", *step)?;
                let countable = (0.5..10_000.0).contains(&steps(*lower, *upper, *step));
                let requirement = "at most 10 000 steps above the lower";
                require(countable, "the slope's upper limit", *upper, requirement)?;
            }
        }
        Ok(())
    }

    /// The nodes with the logarithms of their weights.
    pub(super) fn log_nodes(&self) -> Vec<(f64, f64)> {
        match self {
            Self::Known(value) => vec![(*value, 0.0)],
            Self::Nodes(nodes) => nodes.iter().map(|&(b, weight)| (b, libm::log(weight))).collect(),
            Self::Gaussian { mean, sd, lower, upper, step } => {
                #[expect(clippy::cast_possible_truncation, reason = "between 0 and 10 000")]
                let last = steps(*lower, *upper, *step) as u16;
                let node = |i| {
                    let value = lower + step * f64::from(i);
                    // Half of the step about a limit lies beyond it.
                    let share = if i == 0 || i == last { 0.5 } else { 1.0 };
                    (value, log_gaussian(value, *mean, *sd) + libm::log(share))
                };
                (0..=last).map(node).collect()
            }
        }
    }
}

/// Number of steps between the limits. Half a step more than there are, so that rounding does not
/// lose the upper limit.
fn steps(lower: f64, upper: f64, step: f64) -> f64 {
    (upper - lower) / step + 0.5
}

/// Logarithm of a Gaussian's density, less its constant.
fn log_gaussian(value: f64, mean: f64, sd: f64) -> f64 {
    let deviation = (value - mean) / sd;
    -0.5 * deviation * deviation
}

/// Prior of the target's place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PlacePrior {
    /// It lies within the receivers' bounding box and the margin about it, anywhere with equal
    /// density: the answer depends on the margin.
    Even,
    /// The density is even within the receivers' bounding box and falls beyond it: (1 − q) (1 +
    /// d²/(r s)²)^(−5/2) + q (1 + d²/s²)^(−3/2) for a distance d from a box with half the diagonal
    /// s, Student's t with three degrees of freedom and with one. The search begins with the
    /// margin and widens until next to nothing lies on its border.
    NearReceivers {
        /// The share q, from 0 to 1. With 0.1 and a reach of 1, of the targets beyond the box one
        /// in eighty lies farther away than 20 s, with 0 one in 8,000.
        far_share: f64,
        /// The reach r of the nearer share, in half diagonals of the box; above 0.
        reach: f64,
    },
}

/// Near the receivers with a share of 0.1 farther away, and a reach of 1, as receivers are brought
/// to where a target is looked for: some receive from a short base, or a short path, what is at
/// many times its length.
impl Default for PlacePrior {
    fn default() -> Self {
        Self::NearReceivers { far_share: 0.1, reach: 1.0 }
    }
}

impl PlacePrior {
    /// The prior of a network, which is set up about what it locates: a reach of 0.3.
    #[must_use]
    pub fn of_network() -> Self {
        Self::NearReceivers { far_share: 0.1, reach: 0.3 }
    }

    /// The log-density of a place, up to a constant.
    pub(crate) fn log_density(
        self,
        low: &Vector2<f64>,
        high: &Vector2<f64>,
    ) -> impl Fn(&Vector2<f64>) -> f64 {
        let scale = 0.5 * (high - low).norm();
        let low = *low;
        let high = *high;
        move |place| match self {
            Self::Even => 0.0,
            Self::NearReceivers { far_share, reach } => {
                let beyond = (low - place).sup(&(place - high)).sup(&Vector2::zeros()).norm();
                let within = |scale: f64| 1.0 / (1.0 + (beyond / scale) * (beyond / scale));
                let near = within(reach * scale);
                let far = within(scale);
                let ratio = near / far;
                let near = (1.0 - far_share) * near * ratio * libm::sqrt(ratio);
                libm::log(near + far_share) + 1.5 * libm::log(far)
            }
        }
    }
}

/// Settings of [`ShadowingGrid`](super::ShadowingGrid): its model of the readings, and its search.
#[derive(Clone, Debug, PartialEq)]
pub struct ShadowingGridConfig {
    /// Prior of the intercept.
    pub intercept: Intercept,
    /// Prior of the slope, the coefficient of the first regressor.
    pub slope: Slope,
    /// Prior of the coefficient of the second regressor: for a received level, the number of
    /// vertical dipoles on the way.
    pub gain: Slope,
    /// Prior of the target's height, which the regressors are given; in their unit.
    pub height: Slope,
    /// Prior of the target's place.
    pub place: PlacePrior,
    /// The distances, in metres, over which the correlation of two readings falls to 1/e;
    /// equally likely before.
    pub correlation_lengths_m: Vec<f64>,
    /// The shares of the variance that may be every reading's own, in [0, 1]; equally likely
    /// before.
    pub nuggets: Vec<f64>,
    /// Reach of the search beyond the receivers' bounding box, in metres; farther where the prior
    /// of the place has more there.
    pub margin_m: f64,
    /// The side of a cell in metres; larger where the area would take more than `max_cells`.
    pub cell_m: f64,
    /// The most cells a grid may have; at least 100.
    pub max_cells: u32,
    /// The way, in metres, whose readings are made one; 0 keeps every reading. Longer where the
    /// readings fade, and where the path would make more than `max_segments`.
    pub segment_m: f64,
    /// The length of a segment over its distance from the places that are in question, once these
    /// are known, where readings have noise of their own: those near these places are kept apart,
    /// those far from them are made one. 0 keeps `segment_m` everywhere.
    pub segment_share: f64,
    /// Quantile of a segment's readings that stands for them where they fade, in [0, 1]; else
    /// their trimmed mean does.
    pub quantile: f64,
    /// The most segments, at least 4: time grows with their number.
    pub max_segments: u32,
    /// σ of the receiver's own position in metres: the target is known no better.
    pub receiver_sigma_m: f64,
    /// Prior of σ of the readings: a number of readings and their σ, which count like readings.
    pub sigma_prior: (f64, f64),
}

/// Extent of the receivers from which on the lengths are outdoor ones, in metres.
const FULL_SCALE_M: f64 = 200.0;

/// For a received level over −10 log₁₀ of the distance and 20 log₁₀ of the elevation's cosine: flat
/// intercept; slope N(2.3, 0.5²) on 1, 1.25 … 4, between free space's 2 and the 2.7 to 3.5 of towns
/// (Rappaport 2002, table 4.2); gain N(0.5, 1²) on −1.5, −1 … 2.5, from antennas that look down to
/// two vertical dipoles; the height 0; the place near the receivers; correlation lengths 15, 30 …
/// 240 m, from the 10 m of street canyons (3GPP TR 38.901, table 7.5-6) to the hundreds of suburbs
/// (Gudmundson 1991) and of an antenna's own lobes; nuggets 0.03, 0.1, 0.3 and 1; margin 200 m,
/// cells of 10 m, at most 2000; segments of 25 m, then of 0.15 of the distance, at most 400; of
/// readings that fade the 0.9 quantile, as fading takes power away and adds next to none; receivers
/// at known places; σ of 4 dB for one reading.
impl Default for ShadowingGridConfig {
    fn default() -> Self {
        let proper = "the limits are finite and in order";
        Self {
            intercept: Intercept::Flat,
            slope: Slope::gaussian(2.3, 0.5, 1.0, 4.0, 0.25).expect(proper),
            gain: Slope::gaussian(0.5, 1.0, -1.5, 2.5, 0.5).expect(proper),
            height: Slope::Known(0.0),
            place: PlacePrior::default(),
            correlation_lengths_m: vec![15.0, 30.0, 60.0, 120.0, 240.0],
            nuggets: vec![0.03, 0.1, 0.3, 1.0],
            margin_m: 200.0,
            cell_m: 10.0,
            max_cells: 2000,
            segment_m: 25.0,
            segment_share: 0.15,
            quantile: 0.9,
            max_segments: 400,
            receiver_sigma_m: 0.0,
            sigma_prior: (1.0, 4.0),
        }
    }
}

impl ShadowingGridConfig {
    /// The default for receivers spread over an extent in metres: a room has shorter shadows,
    /// segments and cells than 200 m outdoors, a drive over tens of kilometres has longer shadows,
    /// too.
    #[must_use]
    pub fn over(extent_m: f64) -> Self {
        let config = Self::default();
        let scale = (extent_m / FULL_SCALE_M).clamp(1e-3, 1.0);
        let shortest = config.correlation_lengths_m.first().copied().unwrap_or(1.0) * scale;
        let longest = config.correlation_lengths_m.last().copied().unwrap_or(1.0) * scale;
        let growth = libm::pow(longest.max(0.25 * extent_m) / shortest, 0.25);
        let lengths = (0..5).map(|i| shortest * libm::pow(growth, f64::from(i)));
        Self {
            correlation_lengths_m: lengths.collect(),
            margin_m: config.margin_m * scale,
            cell_m: config.cell_m * scale,
            segment_m: config.segment_m * scale,
            ..config
        }
    }

    /// The default for receivers of a network, which stay where they are, over an extent in metres:
    /// the place as [`PlacePrior::of_network`] has it, and, from 200 m down to a house of 20 m, a
    /// slope that goes over to N(3.5, 1) on 1 … 6. Walls between the rooms add to the distance: of
    /// one floor 1.4 (open) to 4.0 (dense), of several 5.4 (COST 231 1999, *Digital mobile radio
    /// towards future generation systems*, §4.7).
    #[must_use]
    pub fn of_network(extent_m: f64) -> Self {
        let over = Self::over(extent_m);
        let indoors = libm::log10(FULL_SCALE_M / extent_m.max(1e-3)).clamp(0.0, 1.0);
        let slope = match over.slope {
            Slope::Gaussian { mean, sd, lower, upper, step } => Slope::Gaussian {
                mean: mean + indoors * (3.5 - mean),
                sd: sd + indoors * (1.0 - sd),
                upper: upper + indoors * (6.0 - upper),
                lower,
                step,
            },
            other => other,
        };
        Self { slope, place: PlacePrior::of_network(), ..over }
    }

    /// Names the first setting that is outside of its range.
    pub(super) fn check(&self) -> Result<(), ShadowingGridError> {
        match self.intercept {
            Intercept::Flat => {}
            Intercept::Known(value) => {
                finite("the intercept", value)?;
            }
            Intercept::Calibrated { regressor, value, variance } => {
                finite("the calibration's regressor", regressor)?;
                finite("the calibration's value", value)?;
                positive("the calibration's variance", variance)?;
            }
        }
        if let PlacePrior::NearReceivers { far_share, reach } = self.place {
            in_range("far_share", far_share, 0.0..=1.0, "from 0 to 1")?;
            positive("reach", reach)?;
        }
        self.slope.check(["the slope", "the number of slopes", "the slope's weight"])?;
        self.gain.check(["the gain", "the number of gains", "the gain's weight"])?;
        self.height.check(["the height", "the number of heights", "the height's weight"])?;
        let lengths = !self.correlation_lengths_m.is_empty();
        require(lengths, "the number of correlation lengths", 0.0, "at least 1")?;
        for &length_m in &self.correlation_lengths_m {
            positive("correlation_length_m", length_m)?;
        }
        require(!self.nuggets.is_empty(), "the number of nuggets", 0.0, "at least 1")?;
        for &nugget in &self.nuggets {
            in_range("nugget", nugget, 0.0..=1.0, "in [0, 1]")?;
        }
        in_range("quantile", self.quantile, 0.0..=1.0, "in [0, 1]")?;
        not_negative("margin_m", self.margin_m)?;
        positive("cell_m", self.cell_m)?;
        require(self.max_cells >= 100, "max_cells", self.max_cells.into(), "at least 100")?;
        not_negative("segment_m", self.segment_m)?;
        not_negative("segment_share", self.segment_share)?;
        require(self.max_segments >= 4, "max_segments", self.max_segments.into(), "at least 4")?;
        not_negative("receiver_sigma_m", self.receiver_sigma_m)?;
        not_negative("the number of readings of the prior of σ", self.sigma_prior.0)?;
        not_negative("σ of the prior of σ", self.sigma_prior.1)?;
        Ok(())
    }
}

/// Reason that readings were not turned into a place.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ShadowingGridError {
    /// A setting is outside of its range.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// A reading's value is NaN or infinite.
    #[error("reading {index} has the value {value}")]
    Value {
        /// Index of the reading, from 0.
        index: usize,
        /// Value of the reading.
        value: f64,
    },
    /// A reading's receiver pose holds NaN or infinity.
    #[error("the pose of reading {index} is not finite")]
    Receiver {
        /// Index of the reading, from 0.
        index: usize,
    },
    /// Too few places: below three, levels and silences tell nothing of the target's.
    #[error("levels and silences of too few places, {segments}: 3 are needed, and one level")]
    TooFew {
        /// The number of segments that the readings made; 0 without a level.
        segments: usize,
    },
    /// All readings were taken above one place; their values hold nothing about another.
    #[error(
        "the receiver did not move: all levels are from ({east}, {north}) m, and from one place \
         they hold nothing about another"
    )]
    OnePlace {
        /// East of the place, in metres.
        east: f64,
        /// North of the place, in metres.
        north: f64,
    },
    /// The readings' correlation matrix has no Cholesky factor: places coincide and the nugget
    /// is 0.
    #[error("the correlation matrix at {length_m} m is not positive definite")]
    Correlation {
        /// The correlation length in metres.
        length_m: f64,
    },
    /// No cell has a finite likelihood: the regressor is finite nowhere, or a number overflowed.
    #[error("the posterior is finite on none of {cells} cells")]
    Posterior {
        /// Number of cells tried.
        cells: usize,
    },
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;

    #[test]
    fn lengths_follow_the_extent() {
        let of = |extent_m| ShadowingGridConfig::over(extent_m);
        let ends = |config: &ShadowingGridConfig| {
            let lengths = &config.correlation_lengths_m;
            (lengths[0], lengths[4], config.segment_m, config.cell_m)
        };
        let close = |a: (f64, f64, f64, f64), b: (f64, f64, f64, f64)| {
            let apart = [a.0 - b.0, a.1 - b.1, a.2 - b.2, a.3 - b.3];
            assert!(apart.iter().all(|d| d.abs() < 1e-9), "{a:?} for {b:?}");
        };
        close(ends(&of(500.0)), ends(&ShadowingGridConfig::default()));
        close(ends(&of(10.0)), (0.75, 12.0, 1.25, 0.5));
        close(ends(&of(40_000.0)), (15.0, 10_000.0, 25.0, 10.0));
        assert!(of(0.0).check().is_ok());
    }

    #[test]
    fn walls_weigh_on_the_slope_of_a_network_in_a_house_alone() {
        let default = ShadowingGridConfig::default().slope;
        assert_eq!(ShadowingGridConfig::of_network(2000.0).slope, default);
        let of_house = Slope::gaussian(3.5, 1.0, 1.0, 6.0, 0.25).expect("in order");
        assert_eq!(ShadowingGridConfig::of_network(12.0).slope, of_house);
        for extent_m in [0.0, 5.0, 63.0, 150.0, 1e5] {
            let config = ShadowingGridConfig::of_network(extent_m);
            assert!(config.check().is_ok(), "{extent_m} m");
            assert_eq!(config.place, PlacePrior::of_network());
        }
    }

    #[test]
    fn beyond_the_receivers_the_density_is_a_sum_of_students() {
        // Half the diagonal of 60 m by 80 m is 50 m.
        let low = Vector2::new(-10.0, 0.0);
        let high = Vector2::new(50.0, 80.0);
        let density = |east, north| {
            let prior = PlacePrior::NearReceivers { far_share: 0.1, reach: 0.4 };
            libm::exp(prior.log_density(&low, &high)(&Vector2::new(east, north)))
        };
        let students = |beyond: f64| {
            let square = |scale: f64| 1.0 + (beyond / scale) * (beyond / scale);
            0.9 * libm::pow(square(20.0), -2.5) + 0.1 * libm::pow(square(50.0), -1.5)
        };
        for (east, north, beyond) in
            [(20.0, 5.0, 0.0), (150.0, 40.0, 100.0), (20.0, -30.0, 30.0), (-40.0, 120.0, 50.0)]
        {
            assert!((density(east, north) - students(beyond)).abs() < 1e-12, "{east} {north}");
        }
        let even = PlacePrior::Even.log_density(&low, &high);
        assert_abs_diff_eq!(even(&Vector2::new(1e6, 0.0)), 0.0, epsilon = 1e-300);
    }
}
