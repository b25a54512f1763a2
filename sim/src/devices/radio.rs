use foxhunt_core::{BeaconId, Radio};

use super::OnBoard;
use crate::{
    SimError,
    truth::{Port, Truth, beacon_of},
};

/// A simulated drone's radio. An answer's power is that of the moment of the request.
#[derive(Clone, Debug)]
pub struct SimRadio {
    pub(crate) on_board: OnBoard,
    /// Whether it is at the antenna of the channel; otherwise at an omnidirectional one.
    pub(crate) directional: bool,
}

impl Radio for SimRadio {
    type Error = SimError;

    /// # Errors
    ///
    /// [`SimError::Beacon`] if there is no such beacon; an older request stays then.
    fn request(&mut self, beacon: BeaconId) -> Result<(), SimError> {
        let port = if self.directional { Port::Directional } else { Port::Omnidirectional };
        self.on_board.with_truth(|truth, drone| {
            let Truth { time, channel, beacons, drones } = truth;
            let to = beacon_of(beacons, beacon)?;
            drones[drone].request(channel, beacon, to, port, *time);
            Ok(())
        })
    }

    #[inline]
    fn poll(&mut self) -> Result<Option<f64>, SimError> {
        Ok(self.on_board.with(|drone, now| drone.receiver.take_answer(now)))
    }

    #[inline]
    fn next_event(&self) -> Option<f64> {
        Some(self.on_board.with(|drone, _| drone.receiver.answers_at()))
    }
}
