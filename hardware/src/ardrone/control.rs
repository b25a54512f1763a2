use foxhunt_core::{Pose, angle};
use foxhunt_wire::ardrone::ArDroneCommand;
use nalgebra::{Vector2, Vector3};

use super::ArDroneConfig;

/// Its ordered place and heading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Goal {
    pub(super) place: Vector3<f64>,
    /// Direction of the nose, in radians counter-clockwise from East; moved on while it turns.
    pub(super) heading: f64,
    /// Radians per second, counter-clockwise; 0 to hold the heading.
    pub(super) rate: f64,
}

/// Speed wanted per metre of distance, per second.
const PLACE_GAIN: f64 = 0.6;

/// Additional tilt per metre per second of speed that is missing.
const SPEED_GAIN: f64 = 1.0;

/// Climb wanted per metre of height, per second.
const HEIGHT_GAIN: f64 = 1.2;

/// Turn wanted per radian of heading, per second.
const HEADING_GAIN: f64 = 1.5;

/// The order that brings it towards its goal: a speed in proportion to the distance, and a tilt for
/// the speed and for what is missing of it.
pub(super) fn order(
    config: &ArDroneConfig,
    goal: &Goal,
    pose: &Pose,
    velocity: &Vector2<f64>,
) -> ArDroneCommand {
    let way = goal.place - pose.position;
    let wanted = (way.xy() * PLACE_GAIN).cap_magnitude(config.speed_mps);
    let tilt = (wanted + SPEED_GAIN * (wanted - velocity)) / config.full_tilt_mps;
    let (sin, cos) = pose.heading.sin_cos();
    let forward = tilt.x * cos + tilt.y * sin;
    let right = tilt.x * sin - tilt.y * cos;
    let rate = goal.rate + HEADING_GAIN * angle::wrap(goal.heading - pose.heading);
    ArDroneCommand::Progressive {
        progressive: true,
        roll: share(right),
        // Forward is nose down.
        pitch: share(-forward),
        climb: share(way.z * HEIGHT_GAIN / config.climb_mps),
        // Clockwise.
        yaw: share(-rate / config.yaw_rate_deg_s.to_radians()),
    }
}

/// A share of the most that may be ordered.
#[expect(clippy::cast_possible_truncation, reason = "the orders have no more digits")]
fn share(value: f64) -> f32 {
    value.clamp(-1.0, 1.0) as f32
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn tilt_is_towards_the_goal_whatever_the_heading() {
        let config = ArDroneConfig::default();
        let goal = |east, north, up, heading| Goal {
            place: Vector3::new(east, north, up),
            heading,
            rate: 0.0,
        };
        let at = |heading| Pose::level(Vector3::new(0.0, 0.0, 2.0), heading);
        let still = Vector2::zeros();
        let ordered = |goal: Goal, heading| match order(&config, &goal, &at(heading), &still) {
            ArDroneCommand::Progressive { roll, pitch, climb, yaw, .. } => {
                [roll, pitch, climb, yaw].map(f64::from)
            }
            _ => [f64::NAN; 4],
        };
        // The nose to the North, the goal in the North: forward, nose down.
        let [roll, pitch, climb, yaw] = ordered(goal(0.0, 5.0, 2.0, FRAC_PI_2), FRAC_PI_2);
        assert!(pitch < -0.3 && roll.abs() < 1e-6 && climb.abs() < 1e-6 && yaw.abs() < 1e-6);
        // In the East: to the right.
        let [roll, pitch, ..] = ordered(goal(5.0, 0.0, 2.0, FRAC_PI_2), FRAC_PI_2);
        assert!(roll > 0.3 && pitch.abs() < 1e-6);
        // Higher, and the nose to the left: counter-clockwise.
        let [.., climb, yaw] = ordered(goal(0.0, 0.0, 3.0, 1.0), 0.0);
        assert!((climb - 1.0).abs() < 1e-6 && yaw < -0.5);
    }
}
