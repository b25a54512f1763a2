//! What is true: the state of a world that its devices share.

mod body;
mod channel;
mod course;
mod drone;
mod kinematics;
mod path;
mod receiver;
mod shadowing;
mod streams;
mod turntable;

pub(crate) use channel::Channel;
pub(crate) use drone::Drone;
pub(crate) use receiver::Port;
pub(crate) use streams::Streams;

use foxhunt_core::BeaconId;

use crate::{BeaconConfig, SimError};

/// A world's state.
#[derive(Debug)]
pub(crate) struct Truth {
    /// Seconds since the beginning.
    pub(crate) time: f64,
    pub(crate) channel: Channel,
    pub(crate) beacons: Vec<BeaconConfig>,
    pub(crate) drones: Vec<Drone>,
}

/// A beacon of a world.
///
/// # Errors
///
/// [`SimError::Beacon`] if there is no such beacon.
pub(crate) fn beacon_of(beacons: &[BeaconConfig], id: BeaconId) -> Result<&BeaconConfig, SimError> {
    let error = || SimError::Beacon { beacon: id.0, beacons: beacons.len() };
    beacons.get(usize::from(id.0)).ok_or_else(error)
}

/// Whether the moment `at` has come. A nanosecond is forgiven: time is a sum of steps, and its
/// rounding must not cost a step more.
#[inline]
pub(crate) fn is_due(at: f64, now: f64) -> bool {
    now >= at - 1e-9
}

impl Truth {
    /// Lets `dt` seconds pass.
    pub(crate) fn advance(&mut self, dt: f64) {
        let begin = self.time;
        self.time += dt;
        for drone in &mut self.drones {
            drone.advance(begin, dt);
        }
    }
}
