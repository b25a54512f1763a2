use alloc::vec::Vec;

use foxhunt_core::parameter::{ParameterError, positive, require};
use nalgebra::Vector2;

/// Settings of a [`GridFilter`](super::GridFilter): its cells, and its doubts.
#[derive(Clone, Debug, PartialEq)]
pub struct GridConfig {
    /// Cells along each side of the area, 16 to 1024.
    pub side: usize,
    /// The most that a side is divided into where the belief is too thin, or in several places,
    /// for `side`; at least `side`, at most 1024.
    pub most_per_side: usize,
    /// The corners, south-west and north-east, of a rectangle outside of which the target cannot
    /// be, and within which every place is equally likely before the first observation; the prior's
    /// Gaussian in the plane where absent.
    pub area: Option<[Vector2<f64>; 2]>,
    /// Doubts about the noise that observations are given with; `None` for no doubt.
    pub noise_scales: Option<NoiseScales>,
    /// True if the expected value jumps from place to place, as a level does at the edge of a
    /// hill's shadow. Components that enter the measurement linearly are then not read between
    /// cells that disagree about them: the nearest one counts.
    pub cliffs: bool,
}

/// 64 cells to a side, at most 256; the prior's Gaussian; the noise as it is given; no cliffs.
impl Default for GridConfig {
    fn default() -> Self {
        Self { side: 64, most_per_side: 256, area: None, noise_scales: None, cliffs: false }
    }
}

/// A component of the measurement whose standard deviation is not that of the observations
/// but that times one of these factors, the same one throughout.
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseScales {
    /// Index of the component.
    pub component: usize,
    /// The factors, each with its prior weight; the weights need not sum to 1.
    pub factors: Vec<(f64, f64)>,
}

impl GridConfig {
    /// Names the first setting that is out of its range, for measurements of `components`.
    pub(super) fn check(&self, components: usize) -> Result<(), ParameterError> {
        let count = |name, value: usize, least: usize| {
            let requirement = "in 16..=1024, the most per side not below the side";
            require((least..=1024).contains(&value), name, crate::count::number(value), requirement)
        };
        count("cells per side", self.side, 16)?;
        count("most cells per side", self.most_per_side, self.side)?;
        if let Some([low, high]) = self.area {
            let size = (high - low).min();
            let finite = low.iter().chain(high.iter()).all(|c| c.is_finite());
            require(finite && size > 0.0, "the area's shorter side", size, "a positive number")?;
        }
        if let Some(NoiseScales { component, factors }) = &self.noise_scales {
            let index = crate::count::number(*component);
            require(*component < components, "the doubted component", index, "one there is")?;
            require(!factors.is_empty(), "the number of noise factors", 0.0, "at least 1")?;
            for &(factor, weight) in factors {
                for (name, value) in [("noise factor", factor), ("a noise factor's weight", weight)]
                {
                    positive(name, value)?;
                }
            }
        }
        Ok(())
    }
}
