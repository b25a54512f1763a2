use std::f64::consts::TAU;

use foxhunt_core::parameter::{ParameterError, finite, positive};
use nalgebra::Vector2;
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
    pub(super) fn check(&self) -> Result<(), ParameterError> {
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
    /// Its length in metres.
    length: f64,
    /// The length of the part that is done, in metres.
    left: f64,
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
