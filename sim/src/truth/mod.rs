//! What is true: the state of a world that its devices share.

mod body;
#[cfg(feature = "emulators")]
mod carried;
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
    /// How far its drones' clocks may go ahead of it.
    pub(crate) free: Free,
    pub(crate) channel: Channel,
    pub(crate) beacons: Vec<BeaconConfig>,
    pub(crate) drones: Vec<Drone>,
}

/// A time in which drones that rest are left alone.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Free {
    /// Its end, in seconds.
    pub(crate) until: f64,
    /// From one moment at which devices may be polled to the next, in seconds.
    pub(crate) step: f64,
}

/// Nobody goes ahead.
impl Default for Free {
    fn default() -> Self {
        Self { until: f64::NEG_INFINITY, step: 0.0 }
    }
}

impl Free {
    /// The step after a moment, if it is free.
    #[inline]
    fn step_from(&self, time: f64) -> Option<f64> {
        let next = time + self.step;
        // Not so for a step that is too small to be added, either.
        (next > time && next < self.until).then_some(next)
    }

    /// The first step from a moment on, itself included, at which `event` has come.
    #[inline]
    fn reach(&self, event: f64, mut time: f64) -> Option<f64> {
        while !is_due(event, time) {
            time = self.step_from(time)?;
        }
        Some(time)
    }
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

/// From the frequency of one beacon to that of the next where none are given, in MHz.
const SPACING_MHZ: f64 = 0.05;

impl Truth {
    /// What a beacon sends at, in MHz.
    pub(crate) fn frequency_mhz(&self, beacon: BeaconId) -> Option<f64> {
        let own = self.beacons.get(usize::from(beacon.0))?.frequency_mhz;
        let spaced = || self.channel.frequency_mhz + SPACING_MHZ * f64::from(beacon.0);
        Some(own.unwrap_or_else(spaced))
    }

    /// Whether every drone stays where it is until it is sent somewhere.
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
