use foxhunt_core::parameter::{
    FieldError, ParameterError, finite, not_negative, positive, require,
};
use nalgebra::{Vector2, Vector3};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

use super::{
    BeaconCourse, ChannelConfig, DipoleConfig, Interval, ReliefConfig, SimStepperConfig,
    VehicleConfig,
};

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

/// A transmitter that answers when it is requested.
///
/// By default it is at the origin, without a name, and stays there.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BeaconConfig {
    /// Its name, for people.
    pub name: String,
    /// East in metres.
    pub east_m: f64,
    /// North in metres.
    pub north_m: f64,
    /// Height in metres; 0, on the ground, unless given.
    #[serde(default)]
    pub up_m: f64,
    /// Its motion; if absent, the beacon does not move.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub course: Option<BeaconCourse>,
    /// σ of its East and its North at the time 0 about `east_m` and `north_m`, in metres: every
    /// seed has it somewhere else. If absent, the position is exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scatter_m: Option<f64>,
    /// Before this second it does not answer; if absent, it always does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub appears_after_s: Option<f64>,
    /// The pulses that it sends by itself; if absent, it answers requests.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pulses: Option<PulseTrain>,
    /// The frequency that it sends at, in MHz, for receivers that are tuned to it; if absent, the
    /// channel's and 50 kHz more for each beacon before it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frequency_mhz: Option<f64>,
    /// The moment of its coil, for receivers of the magnetic field near it; if absent, they receive
    /// nothing of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dipole: Option<DipoleConfig>,
}

/// The pulses of a tag, or of another beacon that sends by itself.
///
/// A radio that is requested meanwhile answers at the end of the pulse, with the power of the
/// moment of the request; a source that requests again before that gets it then, once.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PulseTrain {
    /// Duration of a pulse, in seconds.
    pub pulse_s: f64,
    /// Time from one pulse to the next, in seconds.
    pub interval_s: f64,
    /// The most by which a pulse may be off its place on the raster, in seconds, evenly
    /// distributed; 0 unless given. Equal in all worlds.
    #[serde(default)]
    pub jitter_s: f64,
    /// Time when the first pulse begins, in seconds; 0 unless given.
    #[serde(default)]
    pub phase_s: f64,
}

impl PulseTrain {
    /// Returns the end of the first pulse that ends after a time, in seconds.
    #[must_use]
    pub fn end_after(&self, time: f64) -> f64 {
        let mut number = ((time - self.phase_s) / self.interval_s).floor().max(1.0) - 1.0;
        loop {
            let end = self.end(number);
            if end > time {
                return end;
            }
            number += 1.0;
        }
    }

    /// Returns the end of the pulse of a number, counted from 0.
    fn end(&self, number: f64) -> f64 {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(number.to_bits());
        let jitter = self.jitter_s * rng.random_range(-1.0..=1.0);
        self.phase_s + number * self.interval_s + jitter + self.pulse_s
    }

    fn check(&self) -> Result<(), FieldError> {
        positive("pulse_s", self.pulse_s)?;
        not_negative("jitter_s", self.jitter_s)?;
        finite("phase_s", self.phase_s)?;
        // No pulse reaches into the next one.
        let least = self.pulse_s + 2.0 * self.jitter_s;
        let apart = self.interval_s.is_finite() && self.interval_s > least;
        require(apart, "interval_s", self.interval_s, "above pulse_s and twice jitter_s")?;
        Ok(())
    }
}

impl BeaconConfig {
    /// The beacon's place after `time` seconds: East, North and Up in metres; the middle of its
    /// scatter where it has one ([`WorldConfig::drawn_beacons`]).
    #[must_use]
    pub fn place_at(&self, time: f64) -> Vector3<f64> {
        let start = Vector2::new(self.east_m, self.north_m);
        let place = self.course.as_ref().map_or(start, |course| course.place_at(start, time));
        place.push(self.up_m)
    }

    fn check(&self) -> Result<(), FieldError> {
        finite("east_m", self.east_m)?;
        finite("north_m", self.north_m)?;
        finite("up_m", self.up_m)?;
        if let Some(course) = &self.course {
            course.check().map_err(|error| error.within("course"))?;
        }
        not_negative("scatter_m", self.scatter_m.unwrap_or(0.0))?;
        not_negative("appears_after_s", self.appears_after_s.unwrap_or(0.0))?;
        positive("frequency_mhz", self.frequency_mhz.unwrap_or(1.0))?;
        self.dipole.map_or(Ok(()), |dipole| dipole.check().map_err(|e| e.within("dipole")))?;
        self.pulses.map_or(Ok(()), |pulses| pulses.check().map_err(|e| e.within("pulses")))
    }

    /// The beacon's velocity after `time` seconds: East, North and Up in metres per second.
    #[must_use]
    pub fn velocity_at(&self, time: f64) -> Vector3<f64> {
        let start = Vector2::new(self.east_m, self.north_m);
        let velocity = self.course.as_ref().map(|course| course.velocity_at(start, time));
        velocity.unwrap_or_default().push(0.0)
    }

    /// The time of its answer to a request at `time`, if an answer takes `latency` seconds.
    #[inline]
    pub(crate) fn answer_after(&self, time: f64, latency: f64) -> f64 {
        self.pulses.map_or(time + latency, |pulses| pulses.end_after(time))
    }

    /// Returns true if it sends at a time where it is listened to without a request.
    pub(crate) fn sends_at(&self, time: f64) -> bool {
        let on_air = |pulses: PulseTrain| pulses.end_after(time) - pulses.pulse_s <= time;
        self.answers_at(time) && self.pulses.is_none_or(on_air)
    }

    /// Returns true if it answers at the time `time`.
    #[must_use]
    #[inline]
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
    /// Times when it hovers where it is; orders that come meanwhile wait until the end, the last
    /// one alone. It turns all the same.
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
}

impl DroneConfig {
    fn check(&self) -> Result<(), FieldError> {
        finite("east_m", self.east_m)?;
        finite("north_m", self.north_m)?;
        finite("up_m", self.up_m)?;
        finite("heading_deg_ccw_from_east", self.heading_deg_ccw_from_east)?;
        not_negative("silent_after_s", self.silent_after_s.unwrap_or(0.0))?;
        not_negative("late_s", self.late_s)?;
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

/// Returns true if a number with the default 0 was left at it.
fn is_zero(value: &f64) -> bool {
    value.abs() <= 0.0
}

/// A number that separates the generator that scatters beacons from the generators of the drones
/// and fields.
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
