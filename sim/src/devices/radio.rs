use foxhunt_core::{BeaconId, Radio};

use super::OnBoard;
use crate::{
    SimError,
    truth::{Free, Port, Truth, beacon_of},
};

/// A simulated drone's radio. An answer's power is that of the moment of the request.
#[derive(Clone, Debug)]
pub struct SimRadio {
    pub(crate) on_board: OnBoard,
    /// True if it is at the antenna of the channel; otherwise it is at an omnidirectional one.
    pub(crate) directional: bool,
}

impl SimRadio {
    fn port(&self) -> Port<'static> {
        if self.directional { Port::Directional } else { Port::Omnidirectional }
    }
}

impl Radio for SimRadio {
    type Error = SimError;

    /// # Errors
    ///
    /// [`SimError::Beacon`] if there is no such beacon; an older request stays then.
    fn request(&mut self, beacon: BeaconId) -> Result<(), SimError> {
        self.on_board.with_truth(|truth, drone| {
            let Truth { time, channel, beacons, drones, .. } = truth;
            let to = beacon_of(beacons, beacon)?;
            let drone = &mut drones[drone];
            let now = drone.time(*time);
            drone.request(channel, beacon, to, self.port(), now);
            Ok(())
        })
    }

    /// # Errors
    ///
    /// The errors of [`request`](Self::request).
    fn interrogate(
        &mut self,
        beacon: BeaconId,
        until: f64,
        answers: &mut [(f64, f64)],
    ) -> Result<usize, SimError> {
        self.on_board.with_truth(|truth, drone| {
            let Truth { time, free, channel, beacons, drones } = truth;
            let to = (beacon, beacon_of(beacons, beacon)?);
            let free = Free { until: free.until.min(until), ..*free };
            Ok(drones[drone].interrogate(channel, to, self.port(), (*time, free), answers))
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
