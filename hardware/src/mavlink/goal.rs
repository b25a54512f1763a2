use foxhunt_core::Clock;
use foxhunt_wire::{
    ByteStream,
    mavlink::{Autopilot, CommonFrame, dialect::MavCmd, yaw_of_heading},
};
use nalgebra::Vector3;

use super::{
    MavlinkError, MavlinkVehicle,
    orders::{Order, Step, single},
    phase::{Goal, Nose, Phase},
    setpoint,
};

/// Speed towards a goal above which it must have taken it, in metres per second.
const MOVING_MPS: f64 = 0.3;

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

    /// Sends the goal when it is due. Ends it where the autopilot has made another one of it.
    pub(super) fn send_goal(&mut self, now: f64) -> Result<(), MavlinkError> {
        let (Some(frame), Some(mut goal)) = (self.frame, self.goal) else { return Ok(()) };
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
        let target = setpoint::target(&frame, &self.telemetry, &goal);
        let known = target.as_ref().filter(|target| !goal.is_new() && target.at >= goal.sent);
        if let Some(target) = known {
            let (over_ground, up) = apart(&target.value, &goal.place);
            let there = is_there(over_ground, up);
            let flies = self.phase == Phase::Flying;
            let other = !there && flies && !goal.is_still_before(&target.value);
            goal.confirmed |= there;
            if goal.others.see(target.at, other) {
                self.end_goal(over_ground, up);
                return Ok(());
            }
        } else if target.is_none() {
            goal.confirmed = goal.confirmed || self.moves_there(&frame, &goal);
        }
        let turns = matches!(goal.nose, Nose::Turns(_));
        let regular = 1.0 / self.config.setpoint_rate_hz;
        let period = match self.telemetry.autopilot() {
            Autopilot::Px4 => regular,
            Autopilot::ArduPilot if turns => regular,
            Autopilot::ArduPilot if goal.confirmed => f64::INFINITY,
            Autopilot::ArduPilot => self.config.ack_timeout_s,
        };
        // A hair early rather than a whole call late.
        if (goal.is_new() || now - goal.sent >= period - 1e-3)
            && let Some(message) = setpoint::message(&frame, &goal, &self.telemetry, now)
        {
            if goal.is_new() {
                (goal.first, goal.before) = (now, target.map(|target| target.value));
            }
            (goal.sent, goal.times) = (now, goal.times.saturating_add(1));
            self.goal = Some(goal);
            return self.send(now, &message);
        }
        self.goal = Some(goal);
        Ok(())
    }

    /// Returns its distance away from a goal that it was sent, in metres.
    fn drifted(&self, frame: &CommonFrame, goal: &mut Goal) -> Option<f64> {
        let at = self.telemetry.position.as_ref()?.at;
        let place = setpoint::pose(frame, &self.telemetry, at)?.position;
        let speed = setpoint::velocity(&self.telemetry).norm();
        if goal.is_new() { None } else { goal.drift.see(at, place, speed, &goal.place) }
    }

    /// Ends a goal of which the autopilot has made another one, so far over ground and upwards. A
    /// place over ground that is ours with another height is our own goal, misunderstood: no
    /// further one is sent, and it comes home by a rule of its own, which hangs on no height of
    /// ours.
    fn end_goal(&mut self, over_ground: f64, up: f64) {
        if over_ground < setpoint::SAME_M && up.is_finite() {
            let side = if up > 0.0 { "above" } else { "below" };
            let up = up.abs();
            let why = format!("it flies to a place {up:.1} m {side} the one to which it was sent");
            self.leave_without_goals(why);
        } else if over_ground.is_finite() {
            let why = format!("another station has sent it {over_ground:.0} m from its goal");
            self.yield_to_station(why);
        } else {
            self.yield_to_station("another station has given it velocities".into());
        }
    }

    /// Has it come home without any set-point: its heights cannot be relied upon.
    pub(super) fn leave_without_goals(&mut self, why: String) {
        self.begin_coming_down(Phase::Returning);
        (self.goal, self.failure) = (None, why);
    }

    /// Returns true if it is there or moves there: for autopilots that report no target of their
    /// own.
    fn moves_there(&self, frame: &CommonFrame, goal: &Goal) -> bool {
        let position = self.telemetry.position.as_ref();
        let Some(position) = position.filter(|at| !goal.is_new() && at.at >= goal.sent) else {
            return false;
        };
        let Some(pose) = setpoint::pose(frame, &self.telemetry, position.at) else { return false };
        let way = goal.place - pose.position;
        let distance = way.norm();
        distance < 0.5 || setpoint::velocity(&self.telemetry).dot(&way) / distance > MOVING_MPS
    }
}

/// Metres over ground and upwards from a goal to a target.
fn apart(target: &Vector3<f64>, goal: &Vector3<f64>) -> (f64, f64) {
    let way = target - goal;
    let over_ground =
        if way.xy().iter().all(|of| of.is_finite()) { way.xy().norm() } else { f64::INFINITY };
    (over_ground, if way.z.is_finite() { way.z } else { f64::INFINITY })
}

fn is_there(over_ground: f64, up: f64) -> bool {
    over_ground < setpoint::SAME_M && up.abs() < setpoint::SAME_UP_M
}

impl Goal {
    /// Returns true if a target equals the autopilot's target before this goal, which it may not
    /// have received, or refuses.
    fn is_still_before(&self, target: &Vector3<f64>) -> bool {
        !self.confirmed
            && self.before.is_some_and(|before| {
                let (over_ground, up) = apart(target, &before);
                is_there(over_ground, up)
            })
    }
}
