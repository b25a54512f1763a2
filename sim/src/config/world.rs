use nalgebra::{Vector2, Vector3};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

use super::{
    BeaconCourse, ChannelConfig, Interval, SimStepperConfig, VehicleConfig,
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
    /// σ of its East and its North at the time 0 about `east_m` and `north_m`, in metres: every
    /// seed has it somewhere else. It is there and nowhere else where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scatter_m: Option<f64>,
    /// Before this second it does not answer; it always does where absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub appears_after_s: Option<f64>,
}

impl BeaconConfig {
    /// Where it is after `time` seconds: East, North and Up in metres; the middle of its scatter
    /// where it has one ([`WorldConfig::drawn_beacons`]).
    #[must_use]
    pub fn place_at(&self, time: f64) -> Vector3<f64> {
        let start = Vector2::new(self.east_m, self.north_m);
        let place = self.course.as_ref().map_or(start, |course| course.place_at(start, time));
        place.push(self.up_m)
    }

    /// Whether it answers at the time `time`.
    #[must_use]
    pub fn answers_at(&self, time: f64) -> bool {
        self.appears_after_s.is_none_or(|appears| time >= appears)
    }
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
    /// Where the nose points, in degrees counter-clockwise from East, until it is told to turn; 0
    /// unless given.
    #[serde(default)]
    pub heading_deg_ccw_from_east: f64,
    /// From this second on its radio hears nothing, and it flies all the same; 0 for a drone that
    /// never delivers anything, absent for one that always does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub silent_after_s: Option<f64>,
    /// When its radio hears nothing besides.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub silent: Vec<Interval>,
    /// When it hovers where it is; what it is ordered meanwhile it does afterwards, the last order
    /// alone. It turns all the same.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stuck: Vec<Interval>,
    /// When nobody has a link to it: it tells no pose and takes no order, and flies on to where it
    /// was last sent.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lost: Vec<Interval>,
    /// How much later its sweeps come than they are finished, in seconds; 0 unless given. A source
    /// has to be made so ([`World::late`](crate::World::late)).
    #[serde(default, skip_serializing_if = "is_zero")]
    pub late_s: f64,
}

/// Whether a number with the default 0 was left at it.
fn is_zero(value: &f64) -> bool {
    value.abs() <= 0.0
}

/// Sets the generator that scatters beacons apart from those of the drones and fields.
const SCATTER: u64 = 0x5ca7_7e12_ed00_0000;

impl WorldConfig {
    /// The beacons where a world of this seed has them, without scatter. Each draws by itself from
    /// a stream of their own: one that scatters less leaves the others, and all else, as they are.
    #[must_use]
    pub fn drawn_beacons(&self, seed: u64) -> Vec<BeaconConfig> {
        let mut stream = Xoshiro256PlusPlus::seed_from_u64(seed ^ SCATTER);
        let mut beacons = self.beacons.clone();
        for beacon in &mut beacons {
            let [east, north]: [f64; 2] = [(); 2].map(|()| stream.sample(StandardNormal));
            if let Some(sigma) = beacon.scatter_m.take() {
                beacon.east_m += sigma * east;
                beacon.north_m += sigma * north;
            }
        }
        beacons
    }

    pub(crate) fn check(&self) -> Result<(), SimError> {
        for (i, beacon) in self.beacons.iter().enumerate() {
            finite(format_args!("beacons[{i}].east_m"), beacon.east_m)?;
            finite(format_args!("beacons[{i}].north_m"), beacon.north_m)?;
            finite(format_args!("beacons[{i}].up_m"), beacon.up_m)?;
            if let Some(course) = &beacon.course {
                course.check(i)?;
            }
            not_negative(format_args!("beacons[{i}].scatter_m"), beacon.scatter_m.unwrap_or(0.0))?;
            let appears = beacon.appears_after_s.unwrap_or(0.0);
            not_negative(format_args!("beacons[{i}].appears_after_s"), appears)?;
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
            not_negative(format_args!("drones[{i}].late_s"), drone.late_s)?;
            let failures =
                [("silent", &drone.silent), ("stuck", &drone.stuck), ("lost", &drone.lost)];
            for (name, intervals) in failures {
                for (j, interval) in intervals.iter().enumerate() {
                    interval.check(&format!("drones[{i}].{name}[{j}]"))?;
                }
            }
        }
        self.channel.check()?;
        self.vehicle.check()?;
        self.stepper.check()
    }
}
