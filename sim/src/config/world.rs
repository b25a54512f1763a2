//! The simulated world as a file has it, with its drones and what fails of them.

use foxhunt_core::parameter::{FieldError, ParameterError, finite, in_range, not_negative};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

use super::{BeaconConfig, ChannelConfig, ReliefConfig, SimStepperConfig, VehicleConfig};

/// A number that separates the generator that scatters beacons from the generators of the drones
/// and fields.
const SCATTER: u64 = 0x5ca7_7e12_ed00_0000;

/// The simulated world: what is true in a simulation. Checked by [`World::new`](crate::World::new).
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
    /// The radio channel between a beacon's power and a drone's reading.
    #[serde(default)]
    pub channel: ChannelConfig,
    /// The terrain that all are above, and that hides beacons; level ground if absent. With it
    /// every Up is a height above the ground below.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub terrain: Option<ReliefConfig>,
    /// The model of every drone's flight.
    #[serde(default)]
    pub vehicle: VehicleConfig,
    /// The speed of every drone's antenna and radio.
    #[serde(default)]
    pub stepper: SimStepperConfig,
}

/// A drone at the beginning.
///
/// By default it is at the origin, its nose to the East, and nothing of it ever fails.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DroneConfig {
    /// East in metres.
    pub east_m: f64,
    /// North in metres.
    pub north_m: f64,
    /// Height in metres; 0 unless given.
    #[serde(default)]
    pub up_m: f64,
    /// Direction of the nose, in degrees counter-clockwise from East, until it is ordered to turn;
    /// 0 unless given.
    #[serde(default)]
    pub heading_deg_ccw_from_east: f64,
    /// From this second on its radio receives nothing, and it flies all the same; 0 for a drone
    /// that never delivers anything, absent for one that always does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub silent_after_s: Option<f64>,
    /// Further times when its radio receives nothing.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub silent: Vec<Interval>,
    /// Times when the drone hovers at its place; orders that come meanwhile wait until the end, the
    /// last one alone. It turns all the same.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stuck: Vec<Interval>,
    /// Times without any link to it: it reports no pose and takes no order, and flies on to where
    /// it was last sent.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lost: Vec<Interval>,
    /// Delay of its sweeps after their end, in seconds; 0 unless given. A source has to be made so
    /// ([`World::late`](crate::World::late)).
    #[serde(default, skip_serializing_if = "is_zero")]
    pub late_s: f64,
    /// Offset of the levels that its receiver reads, in dB; 0 unless given.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub level_offset_db: f64,
    /// Offset of its compass, and of all of its bearings, in degrees clockwise; 0
    /// unless given.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub compass_offset_deg: f64,
}

impl DroneConfig {
    fn check(&self) -> Result<(), FieldError> {
        finite("east_m", self.east_m)?;
        finite("north_m", self.north_m)?;
        finite("up_m", self.up_m)?;
        finite("heading_deg_ccw_from_east", self.heading_deg_ccw_from_east)?;
        not_negative("silent_after_s", self.silent_after_s.unwrap_or(0.0))?;
        not_negative("late_s", self.late_s)?;
        finite("level_offset_db", self.level_offset_db)?;
        finite("compass_offset_deg", self.compass_offset_deg)?;
        let failures = [("silent", &self.silent), ("stuck", &self.stuck), ("lost", &self.lost)];
        for (name, intervals) in failures {
            for (i, interval) in intervals.iter().enumerate() {
                let within = |error: ParameterError| error.within(format_args!("{name}[{i}]"));
                interval.check().map_err(within)?;
            }
        }
        Ok(())
    }
}

impl WorldConfig {
    /// The beacons where a world of this seed has them, without scatter, each with the transmitters
    /// on its frequency that are there. Each draws by itself from a stream of their own: one that
    /// scatters less leaves the others, and all else, as they are.
    #[must_use]
    pub fn drawn_beacons(&self, seed: u64) -> Vec<BeaconConfig> {
        let mut stream = Xoshiro256PlusPlus::seed_from_u64(seed ^ SCATTER);
        let mut beacons = self.beacons.clone();
        let mut moved = |east: &mut f64, north: &mut f64, scatter: Option<f64>| {
            for axis in [east, north] {
                let normal: f64 = stream.sample(StandardNormal);
                *axis += scatter.unwrap_or(0.0) * normal;
            }
        };
        for beacon in &mut beacons {
            moved(&mut beacon.east_m, &mut beacon.north_m, beacon.scatter_m.take());
        }
        for other in beacons.iter_mut().flat_map(|beacon| &mut beacon.others) {
            moved(&mut other.east_m, &mut other.north_m, other.scatter_m.take());
        }
        for beacon in &mut beacons {
            beacon.others.retain_mut(|other| {
                stream.random::<f64>() < std::mem::replace(&mut other.presence, 1.0)
            });
        }
        beacons
    }

    pub(crate) fn check(&self) -> Result<(), FieldError> {
        for (i, beacon) in self.beacons.iter().enumerate() {
            beacon.check().map_err(|error| error.within(format_args!("beacons[{i}]")))?;
        }
        for (i, drone) in self.drones.iter().enumerate() {
            drone.check().map_err(|error| error.within(format_args!("drones[{i}]")))?;
        }
        self.channel.check().map_err(|error| error.within("channel"))?;
        if let Some(terrain) = &self.terrain {
            terrain.check().map_err(|error| error.within("terrain"))?;
        }
        self.vehicle.check().map_err(|error| error.within("vehicle"))?;
        self.stepper.check().map_err(|error| error.within("stepper"))
    }
}

/// A time from one second of the simulation to another, which does not belong to it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Interval {
    /// First second of the interval.
    pub from_s: f64,
    /// The second at which it is over; if absent, it never is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to_s: Option<f64>,
}

impl Interval {
    /// Returns true if the interval contains a moment.
    #[must_use]
    pub fn contains(&self, time: f64) -> bool {
        self.from_s <= time && self.to_s.is_none_or(|end| time < end)
    }

    pub(crate) fn check(&self) -> Result<(), ParameterError> {
        not_negative("from_s", self.from_s)?;
        let range = self.from_s..=f64::MAX;
        let requirement = "a finite number that is not below from_s";
        in_range("to_s", self.to_s.unwrap_or(self.from_s), range, requirement)?;
        Ok(())
    }
}

/// Returns true if a number with the default 0 was left at it.
fn is_zero(value: &f64) -> bool {
    value.abs() <= 0.0
}
