use foxhunt_core::Clock;
use foxhunt_wire::{
    ByteStream,
    mavlink::{Autopilot, CommonFrame, dialect::MavCmd, yaw_of_heading},
};

use super::{
    MavlinkError, MavlinkVehicle,
    orders::{Order, Step, single},
    phase::{Goal, Nose, Phase},
    setpoint,
};

/// How fast it moves towards a goal that it must have taken, in metres per second.
const MOVING_MPS: f64 = 0.3;

/// The autopilot's target is another one when it has been that for so long, in seconds.
const REPLACED_S: f64 = 0.9;

impl<S: ByteStream, C: Clock> MavlinkVehicle<S, C> {
    pub(super) fn turn_order(&self, heading: f64) -> Order {
        let yaw_deg = yaw_of_heading(heading).to_degrees().rem_euclid(360.0);
        let rate_deg_s = self.config.turn_rate_deg_s;
        // An absolute heading, the short way: a relative one counts from the slewing target.
        let parameters = [single(yaw_deg), single(rate_deg_s), 0.0, 0.0, 0.0, 0.0, 0.0];
        Order::new(MavCmd::MAV_CMD_CONDITION_YAW, parameters)
    }

    /// Orders a heading until the attitude shows it. PX4 takes it from the set-points.
    pub(super) fn turn_further(&mut self, now: f64) -> Result<(), MavlinkError> {
        let Some(turning) = &mut self.turning else { return Ok(()) };
        if self.telemetry.autopilot() == Autopilot::Px4 {
            self.turning = None;
            return Ok(());
        }
        // Half a turn at the ordered rate, besides what orders may take.
        let patience = self.config.ack_timeout_s + 180.0 / self.config.turn_rate_deg_s;
        let step = turning.advance(now, patience, self.config.attempts);
        let heading = self.fresh_pose(now).map(|pose| pose.heading);
        if heading.is_ok_and(|heading| self.is_at_heading(heading)) {
            self.turning = None;
            return Ok(());
        }
        match step {
            Step::Wait => Ok(()),
            Step::Send(command) => self.command(now, command),
            Step::Failed(why) => {
                self.turning = None;
                self.failure = format!("the turn was given up: {why}");
                Ok(())
            }
        }
    }

    /// Sends the goal when it is due.
    pub(super) fn send_goal(&mut self, now: f64, who: (u8, u8)) -> Result<(), MavlinkError> {
        let (Some(frame), Some(mut goal)) = (self.frame, self.goal) else { return Ok(()) };
        let regular = 1.0 / self.config.setpoint_rate_hz;
        let turns = matches!(goal.nose, Nose::Turns(_));
        if self.phase == Phase::Flying
            && let Some(away_m) = self.drifted(&frame, &mut goal)
        {
            let why = format!(
                "it has gone {away_m:.0} m away from its goal, which we did not order: another \
                 station flies it"
            );
            self.yield_to_station(why);
            return Ok(());
        }
        if goal.confirmed && !turns {
            let elsewhere = self.sent_elsewhere(&frame, &goal);
            match (goal.replaced, elsewhere) {
                (Some(since), Some((at, distance))) if at - since >= REPLACED_S => {
                    let why = format!("another station has sent it {distance:.0} m from its goal");
                    self.yield_to_station(why);
                    return Ok(());
                }
                (since, elsewhere) => {
                    goal.replaced = elsewhere.map(|(at, _)| since.unwrap_or(at));
                }
            }
        }
        goal.confirmed = goal.confirmed || self.is_confirmed(&frame, &goal);
        let period = match self.telemetry.autopilot() {
            Autopilot::Px4 => regular,
            Autopilot::ArduPilot if turns => regular,
            Autopilot::ArduPilot if goal.confirmed => f64::INFINITY,
            Autopilot::ArduPilot => self.config.ack_timeout_s,
        };
        // A hair early rather than a whole call late.
        if goal.is_new() || now - goal.sent >= period - 1e-3 {
            (goal.sent, goal.times) = (now, goal.times.saturating_add(1));
            let message = setpoint::message(&frame, &goal, who, now);
            self.goal = Some(goal);
            return self.send(now, &message);
        }
        self.goal = Some(goal);
        Ok(())
    }

    /// How far it has gone away from a goal that it was sent, in metres.
    fn drifted(&self, frame: &CommonFrame, goal: &mut Goal) -> Option<f64> {
        let at = self.telemetry.position.as_ref()?.at;
        let place = setpoint::pose(frame, &self.telemetry, at)?.position;
        let speed = setpoint::velocity(&self.telemetry).norm();
        if goal.is_new() { None } else { goal.drift.see(at, place, speed, &goal.place) }
    }

    /// When the autopilot, which knew the goal, reported another target, and how far from the goal
    /// that is.
    fn sent_elsewhere(&self, frame: &CommonFrame, goal: &Goal) -> Option<(f64, f64)> {
        let target = self.telemetry.target.as_ref().filter(|target| target.at >= goal.sent)?;
        let alt = setpoint::launch_alt(&self.telemetry)?;
        let distance = setpoint::distance_m(frame, goal, &target.value, alt);
        (distance >= setpoint::SAME_M).then_some((target.at, distance))
    }

    /// Whether it has shown that it took the goal: its own target is the same, or, where it reports
    /// none, it is there or moves there.
    fn is_confirmed(&self, frame: &CommonFrame, goal: &Goal) -> bool {
        let (Some(position), false) = (&self.telemetry.position, goal.is_new()) else {
            return false;
        };
        let target = self.telemetry.target.as_ref().filter(|target| target.at >= goal.sent);
        if let (Some(target), Some(alt)) = (target, setpoint::launch_alt(&self.telemetry)) {
            return setpoint::distance_m(frame, goal, &target.value, alt) < setpoint::SAME_M;
        }
        if self.telemetry.target.is_some() || position.at < goal.sent {
            return false;
        }
        let Some(pose) = setpoint::pose(frame, &self.telemetry, position.at) else { return false };
        let way = goal.place - pose.position;
        let distance = way.norm();
        distance < 0.5 || setpoint::velocity(&self.telemetry).dot(&way) / distance > MOVING_MPS
    }
}
