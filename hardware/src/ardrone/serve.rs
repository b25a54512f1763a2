//! Serving the link to an AR.Drone, and the control that makes tilts of goals.

use std::io;

use foxhunt_core::{Clock, Pose, angle};
use foxhunt_wire::{
    ByteStream,
    ardrone::{ArDroneCommand, ArDroneNavdata, FlightState, encode_commands},
};
use nalgebra::{Vector2, Vector3};

use super::{ArDrone, ArDroneConfig, ArDroneError, Goal, Phase, send};

/// Time in seconds without navdata after which they are requested again.
const REQUEST_S: f64 = 0.5;

/// Time that a take-off may take besides twice the time of the climb, in seconds.
const TAKE_OFF_S: f64 = 10.0;

/// Longest delay in seconds from the order of a take-off to its beginning.
const UNDER_WAY_S: f64 = 2.0;

/// Age in seconds up to which a captured heading is that of a report.
const YOUNG_S: f64 = 0.1;

/// Distance in metres within which it is at its goal.
const THERE_M: f64 = 0.4;

/// Speed wanted per metre of distance, per second.
const PLACE_GAIN: f64 = 0.6;

/// Additional tilt per metre per second of speed that is missing.
const SPEED_GAIN: f64 = 1.0;

/// Climb wanted per metre of height, per second.
const HEIGHT_GAIN: f64 = 1.2;

/// Turn wanted per radian of heading, per second.
const HEADING_GAIN: f64 = 1.5;

/// The work that goes on by itself between one call and the next.
impl<A: ByteStream, N: ByteStream, C: Clock> ArDrone<A, N, C> {
    /// Takes navdata and counts the way on.
    fn receive(&mut self, now: f64) -> io::Result<()> {
        let mut into = [0; 4096];
        for _ in 0..256 {
            let count = self.navdata.receive(&mut into)?;
            let Some(datagram) = into.get(..count).filter(|bytes| !bytes.is_empty()) else { break };
            let Ok(navdata) = ArDroneNavdata::parse(datagram) else { continue };
            // Late ones and doubled ones; a number that begins again is a drone that did.
            let before = self.received;
            let late = before.is_some_and(|(at, last)| {
                navdata.sequence <= last.sequence && navdata.sequence > 1 && now - at < 1.0
            });
            if late {
                continue;
            }
            self.received = Some((now, navdata));
            if let Some(demo) = navdata.demo {
                let dt = before.map_or(0.0, |(at, _)| (now - at).clamp(0.0, 0.5));
                // Only the way since the last pose is not in it.
                let since = self.captured.map_or(dt, |(at, _)| dt.min(now - at));
                if let Some((_, heading)) = self.captured.filter(|(at, _)| now - at <= YOUNG_S) {
                    self.begun = heading + demo.yaw;
                }
                let (sin, cos) = self.heading().sin_cos();
                let forward = demo.forward_mps;
                let left = -demo.right_mps;
                let over_ground =
                    Vector2::new(forward * cos - left * sin, forward * sin + left * cos);
                // Of its climb it knows the height alone.
                let climb = if dt > 0.0 {
                    (demo.altitude_m - self.position.z) / dt
                } else {
                    self.velocity.z
                };
                self.velocity = Vector3::new(over_ground.x, over_ground.y, climb);
                self.position.x += over_ground.x * since;
                self.position.y += over_ground.y * since;
                self.position.z = demo.altitude_m;
                self.flown += over_ground.norm() * since;
            }
        }
        Ok(())
    }

    /// Takes place and heading of the newest pose from motion capture.
    fn take_captured(&mut self, now: f64) {
        let Some(capture) = &mut self.motion_capture else { return };
        let sigma_m = capture.sigma_m();
        if let Some(pose) = capture.poll(now) {
            self.correct(pose.position.xy(), sigma_m);
            self.captured = Some((now, pose.heading));
        }
    }

    pub(super) fn serve(&mut self) -> Result<f64, ArDroneError> {
        let now = self.clock.now();
        let received = self.receive(now);
        self.take_captured(now);
        let flying = self.is_flying();
        let emergency = self.state_is(|state| state.is_emergency());
        let silent = self.silent_s(now) > self.config.link_timeout_s;
        match self.phase {
            // The order to land stands.
            _ if silent
                && !matches!(self.phase, Phase::Idle | Phase::Stopping | Phase::Landing) =>
            {
                (self.phase, self.goal) = (Phase::Lost, None);
            }
            Phase::TakingOff { calm, .. } if emergency && (calm || flying) => {
                (self.phase, self.goal) = (Phase::Idle, None);
                self.failure = "the take-off was given up: an emergency stopped its motors".into();
            }
            Phase::TakingOff { up, since, .. } if now - since > self.patience(up) => {
                self.failure =
                    format!("the take-off was given up: it is not up after {:.0} s", now - since);
                self.end_take_off(now);
            }
            Phase::TakingOff { up, since, calm } => {
                let calm = calm || (!emergency && self.received.is_some_and(|(at, _)| at > since));
                self.phase = Phase::TakingOff { up, since, calm };
                let up_there = self.demo().is_some_and(|demo| demo.flight == FlightState::Flying);
                if self.goal.is_none() && up_there {
                    self.stay();
                }
                if let Some(goal) = &mut self.goal {
                    goal.place.z = up;
                    if (self.position.z - up).abs() < THERE_M {
                        self.phase = Phase::Flying;
                    }
                }
            }
            Phase::Returning => {
                let there = |goal: Goal| (goal.place - self.position).xy().norm() < THERE_M;
                if self.goal.is_none_or(there) {
                    (self.phase, self.goal) = (Phase::Landing, None);
                }
            }
            Phase::Landing if !flying && !silent && now >= self.land_until => {
                self.phase = Phase::Idle
            }
            Phase::Flying if !flying => (self.phase, self.goal) = (Phase::Idle, None),
            Phase::Stopping if self.state_is(|state| state.is_emergency()) => {
                self.phase = Phase::Idle;
            }
            _ => {}
        }
        received?;
        self.send_due(now)?;
        Ok(now)
    }

    /// Sends what is due.
    pub(super) fn send_due(&mut self, now: f64) -> io::Result<()> {
        let bare = self.received.is_none_or(|(at, navdata)| {
            now - at > REQUEST_S || navdata.demo.is_none() || navdata.state.is_in_bootstrap()
        });
        if bare && now - self.requested >= REQUEST_S {
            self.requested = now;
            // Anything at that port has them sent back here.
            send(&mut self.navdata, &[1, 0, 0, 0])?;
            let value =
                |key: &str, value: String| ArDroneCommand::Config { key: key.into(), value };
            let turn = self.config.yaw_rate_deg_s.to_radians();
            let climb = self.config.climb_mps * 1e3;
            let bytes = encode_commands(
                &[
                    value("general:navdata_demo", "TRUE".into()),
                    value("control:control_yaw", format!("{turn:.3}")),
                    value("control:control_vz_max", format!("{climb:.0}")),
                    ArDroneCommand::Control { mode: 5, argument: 0 },
                ],
                &mut self.sequence,
            );
            send(&mut self.orders, &bytes)?;
        }
        let period = 1.0 / self.config.rate_hz;
        if now - self.sent < period - 1e-3 {
            return Ok(());
        }
        let dt = (now - self.sent).min(0.5);
        self.sent = now;
        let emergency = self.state_is(|state| state.is_emergency());
        let reference = |fly, emergency| ArDroneCommand::Reference { fly, emergency };
        let mut commands = match self.phase {
            // By itself it hovers.
            Phase::Lost => return Ok(()),
            // A drone that somebody else has in the air is not made to land by us.
            Phase::Idle if self.is_flying() || self.check_link(now).is_err() => Vec::new(),
            Phase::Idle | Phase::Landing => vec![reference(false, false), ArDroneCommand::hover()],
            Phase::Stopping => vec![reference(false, true)],
            // The bit ends an emergency, where there is one, before it flies.
            Phase::TakingOff { calm: false, .. } if emergency => vec![reference(false, true)],
            Phase::TakingOff { .. } | Phase::Flying | Phase::Returning => {
                let pose = self.known_pose();
                let over_ground = self.velocity.xy();
                let moving = self.goal.as_mut().map(|goal| {
                    goal.heading = angle::wrap(goal.heading + goal.rate * dt);
                    order(&self.config, goal, &pose, &over_ground)
                });
                vec![reference(true, false), moving.unwrap_or_else(ArDroneCommand::hover)]
            }
        };
        commands.push(ArDroneCommand::Watchdog);
        let bytes = encode_commands(&commands, &mut self.sequence);
        send(&mut self.orders, &bytes)
    }

    pub(super) fn come_down(&mut self, phase: Phase) -> Result<(), ArDroneError> {
        let now = self.serve()?;
        if self.phase == phase {
            return Ok(());
        }
        if let (Phase::TakingOff { .. }, false) = (self.phase, self.is_flying()) {
            self.end_take_off(now);
            return Ok(self.send_due(now)?);
        }
        if phase == Phase::Returning {
            // Its place is counted from its reports.
            self.check_link(now)?;
        }
        if !self.is_flying() {
            return Err(ArDroneError::NotCommanded { why: "it is on the ground".into() });
        }
        self.stay();
        if let (Phase::Returning, Some(goal)) = (phase, &mut self.goal) {
            (goal.place.x, goal.place.y) = (self.config.east_m, self.config.north_m);
        }
        (self.phase, self.land_until) = (phase, now);
        Ok(self.send_due(now)?)
    }

    /// Has it land, and goes on with that until its take-off cannot be on its way any more.
    fn end_take_off(&mut self, now: f64) {
        (self.phase, self.goal, self.land_until) = (Phase::Landing, None, now + UNDER_WAY_S);
    }

    /// Returns the longest time that a take-off to a height may take, in seconds.
    fn patience(&self, up: f64) -> f64 {
        TAKE_OFF_S + 2.0 * up / self.config.climb_mps
    }
}

/// The order that brings it towards its goal: a speed in proportion to the distance, and a tilt for
/// the speed and for what is missing of it.
fn order(
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
    use approx::abs_diff_eq;
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
        assert!(abs_diff_eq!(climb, 1.0, epsilon = 1e-6) && yaw < -0.5);
    }
}
