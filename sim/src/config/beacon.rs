//! Beacons: their places, their motion, and what they send.

use std::f64::consts::TAU;

use foxhunt_core::parameter::{
    FieldError, ParameterError, finite, not_negative, positive, probability, require,
};
use nalgebra::{Vector2, Vector3};
use rand::{RngExt, SeedableRng, rngs::Xoshiro256PlusPlus};
use serde::{Deserialize, Serialize};

/// The motion of a beacon over ground, from its place at the time 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum BeaconCourse {
    /// Counter-clockwise round a centre, which lies a radius to the West of its place at the time
    /// 0.
    Circle {
        /// The radius in metres.
        radius_m: f64,
        /// The time of one round, in seconds.
        period_s: f64,
    },
    /// Straight to one place after the other, and back to the first, for ever.
    Round {
        /// East and North of the places, after its own.
        places_m: Vec<[f64; 2]>,
        /// The speed in metres per second.
        speed_mps: f64,
    },
}

impl BeaconCourse {
    fn check(&self) -> Result<(), ParameterError> {
        match self {
            Self::Circle { radius_m, period_s } => {
                positive("radius_m", *radius_m)?;
                positive("period_s", *period_s)?;
            }
            Self::Round { places_m, speed_mps } => {
                for value in places_m.iter().flatten() {
                    finite("places_m", *value)?;
                }
                positive("speed_mps", *speed_mps)?;
            }
        }
        Ok(())
    }

    /// The beacon's place after `time` seconds if it was at `start`, East and North in metres.
    #[must_use]
    pub fn place_at(&self, start: Vector2<f64>, time: f64) -> Vector2<f64> {
        match self {
            Self::Circle { radius_m, period_s } => {
                let angle = TAU * time / period_s;
                start + Vector2::new(libm::cos(angle) - 1.0, libm::sin(angle)) * *radius_m
            }
            Self::Round { places_m, speed_mps } => {
                match leg_at(start, places_m, time * speed_mps) {
                    Some(Leg { from, to, length, left }) => from + (to - from) * (left / length),
                    None => start,
                }
            }
        }
    }

    /// The beacon's velocity after `time` seconds if it was at `start`, East and North in metres
    /// per second.
    #[must_use]
    pub fn velocity_at(&self, start: Vector2<f64>, time: f64) -> Vector2<f64> {
        match self {
            Self::Circle { radius_m, period_s } => {
                let rate = TAU / period_s;
                let angle = rate * time;
                Vector2::new(-libm::sin(angle), libm::cos(angle)) * (radius_m * rate)
            }
            Self::Round { places_m, speed_mps } => {
                match leg_at(start, places_m, time * speed_mps) {
                    Some(Leg { from, to, length, .. }) => (to - from) * (speed_mps / length),
                    None => Vector2::zeros(),
                }
            }
        }
    }
}

/// A straight line between two places of a round.
#[derive(Clone, Copy, Debug)]
struct Leg {
    from: Vector2<f64>,
    to: Vector2<f64>,
    /// Length of the line in metres.
    length: f64,
    /// The length of the part that is done, in metres.
    left: f64,
}

/// A transmitter that answers when it is requested.
///
/// By default it is at the origin, without a name, and stays there.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BeaconConfig {
    /// Name of the beacon, for people.
    pub name: String,
    /// East in metres.
    pub east_m: f64,
    /// North in metres.
    pub north_m: f64,
    /// Height in metres; 0, on the ground, unless given.
    #[serde(default)]
    pub up_m: f64,
    /// Motion of the beacon; if absent, the beacon does not move.
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
    /// Further transmitters on its frequency: a receiver reads the sum of all their powers.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub others: Vec<OtherConfig>,
}

/// A transmitter on the frequency of a beacon. It sends when the beacon does, as strongly, and
/// stays where it is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OtherConfig {
    /// East in metres.
    pub east_m: f64,
    /// North in metres.
    pub north_m: f64,
    /// Height in metres; 0, on the ground, unless given.
    #[serde(default)]
    pub up_m: f64,
    /// σ of its East and its North in metres, as [`BeaconConfig::scatter_m`]; if absent, the
    /// position is exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scatter_m: Option<f64>,
    /// Probability that it is there at all, drawn for each seed; 1 unless given.
    #[serde(default = "certain")]
    pub presence: f64,
}

/// The default of `presence`.
const fn certain() -> f64 {
    1.0
}

impl OtherConfig {
    /// Returns its place: East, North and Up in metres; the middle of its scatter if it has one.
    #[must_use]
    pub fn place(&self) -> Vector3<f64> {
        Vector3::new(self.east_m, self.north_m, self.up_m)
    }

    fn check(&self) -> Result<(), FieldError> {
        finite("east_m", self.east_m)?;
        finite("north_m", self.north_m)?;
        finite("up_m", self.up_m)?;
        not_negative("scatter_m", self.scatter_m.unwrap_or(0.0))?;
        probability("presence", self.presence)?;
        Ok(())
    }
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
    /// Returns the beacon's place after `time` seconds: East, North and Up in metres; the middle of
    /// its scatter if it has one ([`drawn_beacons`](crate::WorldConfig::drawn_beacons)).
    #[must_use]
    pub fn place_at(&self, time: f64) -> Vector3<f64> {
        let start = Vector2::new(self.east_m, self.north_m);
        let place = self.course.as_ref().map_or(start, |course| course.place_at(start, time));
        place.push(self.up_m)
    }

    pub(super) fn check(&self) -> Result<(), FieldError> {
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
        for (i, other) in self.others.iter().enumerate() {
            other.check().map_err(|error| error.within(format_args!("others[{i}]")))?;
        }
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

    /// Returns true if the beacon sends at the time `time`, listened to without a request.
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

/// A transmitter that is received by the magnetic field near it, as an avalanche beacon at 457 kHz:
/// the moment of its coil.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DipoleConfig {
    /// Strength of the dipole, in milliampere square metres: 6.3 for the least that EN 300 718-1
    /// demands of an avalanche beacon, 0.5 µA/m abeam 10 m off.
    pub moment_ma_m2: f64,
    /// Azimuth of the coil, in degrees counter-clockwise from East; 0 unless given.
    #[serde(default)]
    pub azimuth_deg_ccw_from_east: f64,
    /// Elevation of the coil above the horizon, in degrees; 0 unless given.
    #[serde(default)]
    pub elevation_deg: f64,
}

impl DipoleConfig {
    /// Returns the East, North and Up of the moment, in milliampere square metres.
    #[must_use]
    pub fn moment(&self) -> Vector3<f64> {
        let (sin, cos) = self.azimuth_deg_ccw_from_east.to_radians().sin_cos();
        let (up, level) = self.elevation_deg.to_radians().sin_cos();
        Vector3::new(cos * level, sin * level, up) * self.moment_ma_m2
    }

    fn check(&self) -> Result<(), FieldError> {
        positive("moment_ma_m2", self.moment_ma_m2)?;
        finite("azimuth_deg_ccw_from_east", self.azimuth_deg_ccw_from_east)?;
        let elevation = self.elevation_deg;
        let level = (-90.0..=90.0).contains(&elevation);
        require(level, "elevation_deg", elevation, "from -90 to 90")?;
        Ok(())
    }
}

/// The leg that a round has come to after `way` metres; `None` if the round leads nowhere.
fn leg_at(start: Vector2<f64>, places_m: &[[f64; 2]], way: f64) -> Option<Leg> {
    let others = places_m.iter().map(|place| Vector2::from(*place));
    let places: Vec<_> = [start].into_iter().chain(others).collect();
    let legs = places.iter().zip(places.iter().cycle().skip(1));
    let round: f64 = legs.clone().map(|(from, to)| (to - from).norm()).sum();
    if round <= 0.0 {
        return None;
    }
    let mut left = way.rem_euclid(round);
    for (&from, &to) in legs {
        let length = (to - from).norm();
        if left <= length && length > 0.0 {
            return Some(Leg { from, to, length, left });
        }
        left -= length;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against central differences over 2 ms, away from corners.
    #[test]
    fn the_velocity_is_the_slope_of_the_place() {
        let places_m = vec![[30.0, 0.0], [30.0, 40.0]];
        for course in [
            BeaconCourse::Circle { radius_m: 20.0, period_s: 40.0 },
            BeaconCourse::Round { places_m, speed_mps: 3.0 },
        ] {
            let start = Vector2::new(5.0, -2.0);
            for time in [0.5, 3.0, 12.0, 30.0, 77.0] {
                let place = |at: f64| course.place_at(start, at);
                let slope = (place(time + 1e-3) - place(time - 1e-3)) / 2e-3;
                let error = (course.velocity_at(start, time) - slope).norm();
                assert!(error < 1e-6, "{course:?} at {time} s: {error} m/s");
            }
        }
        let nowhere = BeaconCourse::Round { places_m: Vec::new(), speed_mps: 3.0 };
        assert_eq!(nowhere.velocity_at(Vector2::new(1.0, 1.0), 4.0), Vector2::zeros());
    }
}
