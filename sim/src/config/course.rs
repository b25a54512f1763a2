use std::f64::consts::TAU;

use nalgebra::Vector2;
use serde::{Deserialize, Serialize};

use super::check::{finite, positive};
use crate::SimError;

/// How a beacon moves over ground, from its place at the time 0.
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
    pub(super) fn check(&self, beacon: usize) -> Result<(), SimError> {
        let field = |name: &str| format!("beacons[{beacon}].course.{name}");
        match self {
            Self::Circle { radius_m, period_s } => {
                positive(field("radius_m"), *radius_m)?;
                positive(field("period_s"), *period_s)
            }
            Self::Round { places_m, speed_mps } => {
                places_m.iter().flatten().try_for_each(|v| finite(field("places_m"), *v))?;
                positive(field("speed_mps"), *speed_mps)
            }
        }
    }

    /// Where it is after `time` seconds if it was at `start`, East and North in metres.
    #[must_use]
    pub fn place_at(&self, start: Vector2<f64>, time: f64) -> Vector2<f64> {
        match self {
            Self::Circle { radius_m, period_s } => {
                let angle = TAU * time / period_s;
                start + Vector2::new(libm::cos(angle) - 1.0, libm::sin(angle)) * *radius_m
            }
            Self::Round { places_m, speed_mps } => {
                let others = places_m.iter().map(|place| Vector2::from(*place));
                let places: Vec<_> = [start].into_iter().chain(others).collect();
                let legs = places.iter().zip(places.iter().cycle().skip(1));
                let round: f64 = legs.clone().map(|(from, to)| (to - from).norm()).sum();
                if round <= 0.0 {
                    return start;
                }
                let mut left = (time * speed_mps).rem_euclid(round);
                for (from, to) in legs {
                    let length = (to - from).norm();
                    if left <= length && length > 0.0 {
                        return from + (to - from) * (left / length);
                    }
                    left -= length;
                }
                start
            }
        }
    }
}
