use nalgebra::{SVector, Vector3};

use crate::{BearingModes, Covariance, Pose};

/// Plain fields of an observation, as they stand in a file.
#[derive(serde::Serialize, serde::Deserialize)]
pub(super) struct Parts<const M: usize> {
    pub(super) time: f64,
    pub(super) receiver: Pose,
    pub(super) value: SVector<f64, M>,
    pub(super) noise: Covariance<M>,
    pub(super) missing: SVector<bool, M>,
    #[serde(default = "nowhere", skip_serializing_if = "is_nowhere")]
    pub(super) below: SVector<bool, M>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) receiver_sigma: Option<Vector3<f64>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) modes: Option<(usize, BearingModes)>,
}

fn nowhere<const M: usize>() -> SVector<bool, M> {
    SVector::repeat(false)
}

fn is_nowhere<const M: usize>(below: &SVector<bool, M>) -> bool {
    below.iter().all(|below| !below)
}
