use nalgebra::{SVector, Vector3};

use super::{Observation, ObservationError};
use crate::{BearingModes, Covariance, Pose};

/// The plain fields, as they stand in a file; read back only through [`Observation::new`].
#[derive(serde::Serialize, serde::Deserialize)]
pub(super) struct Parts<const M: usize> {
    time: f64,
    receiver: Pose,
    value: SVector<f64, M>,
    noise: Covariance<M>,
    missing: SVector<bool, M>,
    #[serde(default = "nowhere", skip_serializing_if = "is_nowhere")]
    below: SVector<bool, M>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    receiver_sigma: Option<Vector3<f64>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    modes: Option<(usize, BearingModes)>,
}

fn nowhere<const M: usize>() -> SVector<bool, M> {
    SVector::repeat(false)
}

fn is_nowhere<const M: usize>(below: &SVector<bool, M>) -> bool {
    below.iter().all(|below| !below)
}

impl<const M: usize> TryFrom<Parts<M>> for Observation<M> {
    type Error = ObservationError;

    fn try_from(parts: Parts<M>) -> Result<Self, ObservationError> {
        let mut whole = Self::new(parts.time, parts.receiver, parts.value, parts.noise)?;
        if let Some(sigma) = parts.receiver_sigma {
            whole = whole.with_receiver_sigma(sigma)?;
        }
        if let Some((component, modes)) = parts.modes {
            if component >= M || parts.missing[component] {
                return Err(ObservationError::NoBearing { component });
            }
            whole = whole.with_bearing_modes(component, modes);
        }
        let present = (0..M).filter(|&i| parts.missing[i]).fold(whole, Self::without);
        Ok((0..M).filter(|&i| parts.below[i]).fold(present, Self::below))
    }
}

impl<const M: usize> From<Observation<M>> for Parts<M> {
    fn from(o: Observation<M>) -> Self {
        Self {
            time: o.time,
            receiver: o.receiver,
            value: o.value,
            noise: o.noise,
            missing: SVector::from_fn(|i, _| !o.present[i]),
            below: SVector::from_fn(|i, _| o.below[i]),
            receiver_sigma: o.receiver_sigma,
            modes: o.modes,
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix2, Vector2};

    use super::*;
    use crate::BearingMode;

    #[test]
    fn missing_components_are_kept_in_files() {
        let made = Observation::new(0.5, Pose::default(), Vector2::zeros(), Matrix2::identity());
        let whole = made.expect("proper");
        let mode = |angle| BearingMode { weight: 0.5, angle, sigma: 0.25 };
        let modes = BearingModes::new(&[mode(0.0), mode(1.0)]).expect("proper");
        for observation in [
            whole,
            whole.without(1),
            whole.below(0),
            whole.below(0).without(1),
            whole.with_bearing_modes(1, modes),
        ] {
            let text = serde_json::to_string(&observation).expect("plain data");
            assert_eq!(text.contains("below"), observation.is_censored(), "{text}");
            let back: Observation<2> = serde_json::from_str(&text).expect("what was written");
            assert_eq!(back, observation);
        }
        let text = serde_json::to_string(&whole.with_bearing_modes(1, modes)).expect("plain data");
        let nowhere = text.replace("\"modes\":[1,", "\"modes\":[2,");
        assert!(serde_json::from_str::<Observation<2>>(&nowhere).is_err(), "{nowhere}");
    }
}
