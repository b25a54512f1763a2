use foxhunt_core::{BeaconId, Radio};

use super::OnBoard;
use crate::SimError;

/// A simulated drone's radio. An answer's power is that of the moment of the question.
#[derive(Clone, Debug)]
pub struct SimRadio(pub(crate) OnBoard);

impl Radio for SimRadio {
    type Error = SimError;

    /// # Errors
    ///
    /// [`SimError::Beacon`] if there is no such beacon; an older question stays then.
    fn request(&mut self, beacon: BeaconId) -> Result<(), SimError> {
        self.0.with_truth(|truth, drone| {
            let Some(asked) = truth.beacons.get(usize::from(beacon.0)) else {
                return Err(SimError::Beacon { beacon: beacon.0, beacons: truth.beacons.len() });
            };
            let place = asked.place_at(truth.time);
            truth.drones[drone].ask(&truth.channel, beacon, place, truth.time);
            Ok(())
        })
    }

    fn poll(&mut self) -> Result<Option<f64>, SimError> {
        Ok(self.0.with(|drone, now| drone.receiver.take_answer(now)))
    }
}
