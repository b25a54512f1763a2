use nalgebra::{Vector2, Vector3};
use serde::{Deserialize, Serialize};

use super::{
    BeaconCourse, ChannelConfig, SimStepperConfig, VehicleConfig,
    check::{finite, not_negative},
};
use crate::SimError;

/// What is true in a simulation. Checked by [`World::new`](crate::World::new).
///
/// By default nobody is in it, and channel, vehicles and steppers have their own defaults. A file
/// names its beacons and drones.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorldConfig {
    /// The beacons; [`BeaconId`](foxhunt_core::BeaconId) counts them from 0.
    pub beacons: Vec<BeaconConfig>,
    /// The drones, counted from 0.
    pub drones: Vec<DroneConfig>,
    /// What lies between a beacon's power and a drone's reading.
    #[serde(default)]
    pub channel: ChannelConfig,
    /// How every drone flies.
    #[serde(default)]
    pub vehicle: VehicleConfig,
    /// How quick every drone's antenna and radio are.
    #[serde(default)]
    pub stepper: SimStepperConfig,
}

/// A transmitter that answers when it is asked.
///
/// By default it is at the origin, without a name, and stays there.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BeaconConfig {
    /// What people call it.
    pub name: String,
    /// East in metres.
    pub east_m: f64,
    /// North in metres.
    pub north_m: f64,
    /// Height in metres; 0, on the ground, unless given.
    #[serde(default)]
    pub up_m: f64,
    /// How it moves; it stays where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub course: Option<BeaconCourse>,
}

impl BeaconConfig {
    /// Where it is after `time` seconds: East, North and Up in metres.
    #[must_use]
    pub fn place_at(&self, time: f64) -> Vector3<f64> {
        let start = Vector2::new(self.east_m, self.north_m);
        let place = self.course.as_ref().map_or(start, |course| course.place_at(start, time));
        place.push(self.up_m)
    }
}

/// A drone at the beginning.
///
/// By default it is at the origin, its nose to the East, and delivers for ever.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DroneConfig {
    /// East in metres.
    pub east_m: f64,
    /// North in metres.
    pub north_m: f64,
    /// Height in metres; 0 unless given.
    #[serde(default)]
    pub up_m: f64,
    /// Where the nose points, in degrees counter-clockwise from East, until it is told to turn; 0
    /// unless given.
    #[serde(default)]
    pub heading_deg_ccw_from_east: f64,
    /// From this second on its radio hears nothing, and it flies all the same; 0 for a drone that
    /// never delivers anything, absent for one that always does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub silent_after_s: Option<f64>,
}

impl WorldConfig {
    pub(crate) fn check(&self) -> Result<(), SimError> {
        for (i, beacon) in self.beacons.iter().enumerate() {
            finite(format_args!("beacons[{i}].east_m"), beacon.east_m)?;
            finite(format_args!("beacons[{i}].north_m"), beacon.north_m)?;
            finite(format_args!("beacons[{i}].up_m"), beacon.up_m)?;
            if let Some(course) = &beacon.course {
                course.check(i)?;
            }
        }
        for (i, drone) in self.drones.iter().enumerate() {
            finite(format_args!("drones[{i}].east_m"), drone.east_m)?;
            finite(format_args!("drones[{i}].north_m"), drone.north_m)?;
            finite(format_args!("drones[{i}].up_m"), drone.up_m)?;
            let heading = drone.heading_deg_ccw_from_east;
            finite(format_args!("drones[{i}].heading_deg_ccw_from_east"), heading)?;
            if let Some(time) = drone.silent_after_s {
                not_negative(format_args!("drones[{i}].silent_after_s"), time)?;
            }
        }
        self.channel.check()?;
        self.vehicle.check()?;
        self.stepper.check()
    }
}
