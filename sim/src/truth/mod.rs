//! The truth: the state of a world that its devices share.

mod body;
#[cfg(feature = "emulators")]
mod carried;
mod channel;
mod course;
mod drone;
mod kinematics;
mod path;
mod port;
mod receiver;
mod scattering;
mod shadowing;
mod streams;
mod time;
mod turntable;

pub(crate) use channel::Channel;
pub(crate) use drone::Drone;
pub(crate) use port::Port;
pub(crate) use streams::Streams;
pub(crate) use time::{Free, is_due};

use foxhunt_core::BeaconId;

use crate::{BeaconConfig, SimError};

/// A world's state.
#[derive(Debug)]
pub(crate) struct Truth {
    /// Seconds since the beginning.
    pub(crate) time: f64,
    /// The time that its drones' clocks may go ahead of it.
    pub(crate) free: Free,
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

/// Spacing of the frequencies of beacons without a given one, in MHz.
const SPACING_MHZ: f64 = 0.05;

impl Truth {
    /// The frequency that a beacon sends at, in MHz.
    pub(crate) fn frequency_mhz(&self, beacon: BeaconId) -> Option<f64> {
        let own = self.beacons.get(usize::from(beacon.0))?.frequency_mhz;
        let spaced = || self.channel.frequency_mhz + SPACING_MHZ * f64::from(beacon.0);
        Some(own.unwrap_or_else(spaced))
    }

    /// Returns true if every drone stays where it is until it is sent somewhere.
    pub(crate) fn rests(&self) -> bool {
        self.drones.iter().all(Drone::rests)
    }

    /// Lets `dt` seconds pass.
    pub(crate) fn advance(&mut self, dt: f64) {
        let begin = self.time;
        self.time += dt;
        for drone in &mut self.drones {
            drone.advance(begin, dt);
        }
    }
}
