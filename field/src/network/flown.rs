use std::{collections::VecDeque, fmt};

use foxhunt_core::{BearingExtractor, PatternSource, parameter::FieldError};
use foxhunt_hardware::{
    Aircraft, Shared,
    link::{DroneLink, Leave, Order, Stage, UnixTime},
};
use foxhunt_hunt::hunt::Event;

use super::{DroneNode, DroneNodeConfig, NetworkError};
use crate::fly::{Departure, Ending, FlightRules, FlownDrone};

/// A [`DroneNode`] with a real aircraft, by the same pilot's rules as a
/// [`Mission`](crate::fly::Mission): it takes off by an order alone, which comes when all drones
/// are ready; what the pilot takes gets no orders until he gives it back; and it leaves by its
/// rules when the hunt is over or broken off.
///
/// Without orders it flies to its last goal and holds there; after
/// [`orders_timeout_s`](FlightRules::orders_timeout_s) it leaves as when the pilot breaks off. An
/// aircraft that is in the air when the node begins, because the node was restarted, is taken over
/// only where that is [allowed](Self::allow_take_over).
pub struct FlownNode<A, S, X, L> {
    index: usize,
    node: DroneNode<S, Shared<A>, X, L>,
    drone: FlownDrone<Shared<A>, ()>,
    rules: FlightRules,
    stage: Stage,
    since: f64,
    /// Rule by which it leaves.
    ending: Ending,
    /// Reason why it leaves, or what keeps it from flying.
    reason: String,
    events: VecDeque<Event>,
}

impl<A, S, X, L> fmt::Debug for FlownNode<A, S, X, L> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FlownNode")
            .field("drone", &self.drone.name)
            .field("stage", &self.stage)
            .field("reason", &self.reason)
            .finish_non_exhaustive()
    }
}

impl<A, S, X, L> FlownNode<A, S, X, L>
where
    A: Aircraft,
    S: PatternSource,
    X: BearingExtractor,
    L: DroneLink,
{
    /// A node of a drone, counted from 0, whose devices are open; `epoch` is when its clock was at
    /// 0.
    ///
    /// # Errors
    ///
    /// [`NetworkError::Config`] and [`NetworkError::Rule`] name the field that is out of its range.
    pub fn new(
        index: usize,
        drone: FlownDrone<Shared<A>, S>,
        extractor: X,
        link: L,
        epoch: UnixTime,
        rules: FlightRules,
        config: DroneNodeConfig,
    ) -> Result<Self, NetworkError> {
        rules.check().map_err(|error| FieldError::from(error).within("flight"))?;
        let FlownDrone { name, aircraft, source, .. } = drone;
        let node = DroneNode::new(source, aircraft.clone(), extractor, link, epoch, config)?;
        Ok(Self {
            index,
            node,
            drone: FlownDrone::new(name, aircraft, ()),
            rules,
            stage: Stage::Preparing,
            since: f64::NEG_INFINITY,
            ending: rules.at_end,
            reason: String::new(),
            events: VecDeque::new(),
        })
    }

    /// Allows that the drone is taken over if it is in the air already, in the mode that takes
    /// orders: for a caller that knows that nobody else flies it.
    pub fn allow_take_over(&mut self) {
        self.drone.allow_take_over();
    }

    /// Moves on at a time in seconds of its own clock.
    ///
    /// # Errors
    ///
    /// [`NetworkError::Link`] when the link failed, and [`NetworkError::Time`]; it may be called
    /// again.
    pub fn step(&mut self, time: f64) -> Result<(), NetworkError> {
        let received = self.node.receive(time);
        let mut failure = None;
        if let Err(error) = self.drone.read_state(time, self.index, &mut self.events) {
            failure = Some(error.to_string());
        }
        self.move_on(time);
        if let Some(failure) = failure {
            self.reason = failure;
        }
        self.node.set_stage(self.stage, &self.reason);
        received.and(self.node.act(time))
    }

    /// The next thing that happened to the aircraft, each once.
    pub fn poll_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// Returns the stage of the node.
    pub fn stage(&self) -> Stage {
        self.stage
    }

    /// Returns the reason why it leaves, or what keeps it from flying; empty if nothing does.
    pub fn reason(&self) -> &str {
        &self.reason
    }

    /// The order that it follows.
    pub fn order(&self) -> &Order {
        self.node.order()
    }

    /// Has it leave by the pilot's rule for a flight that is broken off.
    pub fn abort(&mut self, time: f64, reason: &str) {
        match self.stage {
            Stage::Over => {}
            Stage::Preparing | Stage::Ready => self.enter(time, Stage::Over, reason),
            Stage::Leaving if self.ending == self.rules.on_abort => {}
            _ => self.leave(time, self.rules.on_abort, reason),
        }
    }

    fn move_on(&mut self, time: f64) {
        match self.node.order().leave {
            Leave::OnAbort if self.may_leave() => {
                return self.abort(time, "the hunt was broken off");
            }
            Leave::AtEnd if self.may_leave() => {
                return self.leave(time, self.rules.at_end, "the hunt is over");
            }
            _ => {}
        }
        match self.stage {
            Stage::Preparing | Stage::Ready => self.prepare(time),
            Stage::Climbing => self.climb(time),
            Stage::Flying | Stage::Away => self.fly(time),
            Stage::Leaving => self.come_down(time),
            // Over.
            _ => {}
        }
    }

    fn may_leave(&self) -> bool {
        !matches!(self.stage, Stage::Leaving | Stage::Over)
    }

    /// On the ground, or in the air and not ours.
    fn prepare(&mut self, time: f64) {
        if let Some(why) = self.drone.flown_by_others() {
            (self.stage, self.reason) = (Stage::Preparing, why);
            return;
        }
        if self.drone.is_airborne() {
            // It is offered, and may be taken over: from a flight that was cut short.
            return self.enter(time, Stage::Climbing, "");
        }
        match self.drone.not_ready() {
            Some(why) => (self.stage, self.reason) = (Stage::Preparing, why),
            None if self.node.order().take_off => self.enter(time, Stage::Climbing, ""),
            None => (self.stage, self.reason) = (Stage::Ready, String::new()),
        }
    }

    fn climb(&mut self, time: f64) {
        if self.drone.is_commanded() {
            return self.enter(time, Stage::Flying, "");
        }
        self.reason = format!("it is not up: {}", self.drone.hindrance());
        if let Err(error) = self.drone.take_off(time, self.rules.takeoff_up_m) {
            self.reason = format!("it does not take off: {error}");
        }
        if time - self.since >= self.rules.climb_timeout_s {
            let reason = self.reason.clone();
            self.leave(time, self.rules.on_abort, &reason);
        }
    }

    fn fly(&mut self, time: f64) {
        let silent_s = self.node.silent_s(time);
        if self.drone.is_down() {
            return self.enter(time, Stage::Over, "it is on the ground");
        }
        if silent_s >= self.rules.orders_timeout_s {
            let reason = format!("no order has come for {silent_s:.0} s");
            return self.leave(time, self.rules.on_abort, &reason);
        }
        if self.node.lands() {
            (self.stage, self.reason) = (Stage::Away, "it lands".to_owned());
            return;
        }
        self.drone.take_over_again(time);
        (self.stage, self.reason) = match self.drone.is_commanded() {
            true => (Stage::Flying, String::new()),
            false => (Stage::Away, self.drone.hindrance().to_owned()),
        };
    }

    /// Orders it down while it is in our hands.
    fn come_down(&mut self, time: f64) {
        let departure = self.drone.departure(self.ending);
        if departure == Departure::Ordered
            && let Err(error) = self.drone.order_to_leave(time, self.ending)
        {
            self.events.push_back(Event::DeviceFailed {
                time,
                drone: Some(self.index),
                reason: error.to_string(),
            });
        }
        match departure {
            Departure::Down => {
                let reason = format!("it is down: {}", self.reason);
                self.enter(time, Stage::Over, &reason);
            }
            Departure::Left(to) => self.enter(time, Stage::Over, &to),
            Departure::Ordered | Departure::Awaited
                if time - self.since >= self.rules.leaving_timeout_s =>
            {
                self.enter(time, Stage::Over, "not known to be down");
            }
            _ => {}
        }
    }

    fn leave(&mut self, time: f64, ending: Ending, reason: &str) {
        self.ending = ending;
        self.drone.reset_orders();
        self.enter(time, Stage::Leaving, reason);
    }

    fn enter(&mut self, time: f64, stage: Stage, reason: &str) {
        (self.stage, self.since) = (stage, time);
        reason.clone_into(&mut self.reason);
    }
}
