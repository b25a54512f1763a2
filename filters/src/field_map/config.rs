use alloc::{vec, vec::Vec};

use foxhunt_core::parameter::{not_negative, positive, require};

use crate::batch::{BatchError, at_least};

/// Settings of [`FieldMap`](super::FieldMap): its model of the level, and its search for the
/// maximum.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldMapConfig {
    /// The lengths, in metres, that the field's correlation may have.
    pub lengths_m: Vec<f64>,
    /// The shares of the variance that may be every reading's own, in (0, 1].
    pub noise_shares: Vec<f64>,
    /// The horizontal length of path, in metres, whose readings are made one; 0 keeps every
    /// reading. Longer where the path would make more than `max_segments`.
    pub segment_m: f64,
    /// The most segments, at least 4: time grows with their cube.
    pub max_segments: u32,
    /// Reach of the search for the maximum beyond the receivers' bounding box, in metres.
    pub margin_m: f64,
    /// The side of a cell in metres; larger where the area would take more than `max_cells`.
    pub cell_m: f64,
    /// The most cells, at least 16: time grows with their cube, memory with their square; 900 take
    /// 10 MB.
    pub max_cells: u32,
    /// Number of fields drawn for the place of the maximum.
    pub samples: u32,
}

/// Lengths of 20, 40, 80, 160 and 320 m; noise shares 0.02, 0.1, 0.3 and 0.6; segments of 10 m, at
/// most 300; margin 50 m, cells of 10 m, at most 900; 500 samples.
impl Default for FieldMapConfig {
    fn default() -> Self {
        Self {
            lengths_m: vec![20.0, 40.0, 80.0, 160.0, 320.0],
            noise_shares: vec![0.02, 0.1, 0.3, 0.6],
            segment_m: 10.0,
            max_segments: 300,
            margin_m: 50.0,
            cell_m: 10.0,
            max_cells: 900,
            samples: 500,
        }
    }
}

impl FieldMapConfig {
    pub(super) fn check(&self) -> Result<(), BatchError> {
        at_least("lengths_m", self.lengths_m.len(), 1)?;
        at_least("noise_shares", self.noise_shares.len(), 1)?;
        for length_m in &self.lengths_m {
            positive("length_m", *length_m)?;
        }
        for &share in &self.noise_shares {
            require(share > 0.0 && share <= 1.0, "noise_share", share, "in (0, 1]")?;
        }
        not_negative("segment_m", self.segment_m)?;
        not_negative("margin_m", self.margin_m)?;
        positive("cell_m", self.cell_m)?;
        at_least("max_segments", self.max_segments as usize, 4)?;
        at_least("max_cells", self.max_cells as usize, 16)?;
        at_least("samples", self.samples as usize, 1)
    }
}

/// The hyperparameters with the largest marginal likelihood.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldModel {
    /// The correlation length ℓ in metres.
    pub length_m: f64,
    /// The share ν of the variance that is every reading's own.
    pub noise_share: f64,
    /// The standard deviation σ of a reading about the mean, in the readings' unit.
    pub sigma: f64,
    /// The mean far from all readings, in their unit.
    pub mean: f64,
}
