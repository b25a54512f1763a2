use foxhunt_core::{BeaconId, Radio};

use super::OnBoard;
use crate::SimError;

/// A simulated drone's radio. An answer's power is that of the moment of the question.
#[derive(Clone, Debug)]
pub struct SimRadio {
    pub(crate) on_board: OnBoard,
    /// Whether it is at the antenna of the channel; otherwise at one that hears alike from
    /// everywhere.
    pub(crate) directional: bool,
}

impl Radio for SimRadio {
    type Error = SimError;

    /// # Errors
    ///
    /// [`SimError::Beacon`] if there is no such beacon; an older question stays then.
    fn request(&mut self, beacon: BeaconId) -> Result<(), SimError> {
        let directional = self.directional;
        self.on_board.with_truth(|truth, drone| {
            let Some(asked) = truth.beacons.get(usize::from(beacon.0)) else {
                return Err(SimError::Beacon { beacon: beacon.0, beacons: truth.beacons.len() });
            };
            let drone = &mut truth.drones[drone];
            drone.ask(&truth.channel, beacon, asked, directional, truth.time);
            Ok(())
        })
    }

    fn poll(&mut self) -> Result<Option<f64>, SimError> {
        Ok(self.on_board.with(|drone, now| drone.receiver.take_answer(now)))
    }
}
