use std::collections::VecDeque;

use foxhunt_core::{Pose, Reception, Station};
use foxhunt_hardware::link::{
    ClockOffset, Delivery, FusionLink, Leave, LinkError, Report, Stage, Status, UnixTime,
};
use foxhunt_hunt::hunt::{Command, Event, Hunt, HuntError};
use nalgebra::Vector3;

use super::{FusionNodeConfig, NetworkError, Remote, remote::view};

/// The log of a hunt that was broken off.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Past {
    /// Places where the drones began, East, North and Up in metres.
    pub homes: Vec<Vector3<f64>>,
    /// Events of the hunt.
    pub events: Vec<Event>,
}

/// Maximum number of reports taken at one step, so that a flood does not stop the hunt.
const MOST_REPORTS: usize = 10_000;

/// Number of reports lost at one step after which the rest waits for the next one, so that a broken
/// link does not stop the hunt.
const MOST_LOST: usize = 100;

/// Time between two steps after which the later one is late, in seconds: its computer was busy with
/// something else.
const STOOD_STILL_S: f64 = 1.0;

/// The part of a hunt on several computers that fuses: runs the [`Hunt`] on the drones' reports,
/// and sends each its orders.
///
/// It does no I/O of its own, reads no clock and never waits: [`step`](Self::step) is called in a
/// loop with the time. A delivery is acknowledged only when all events were
/// [polled](Self::poll_event), so that what a drone forgets is in the log.
#[derive(Debug)]
pub struct FusionNode<L> {
    hunt: Hunt,
    link: L,
    epoch: UnixTime,
    config: FusionNodeConfig,
    drones: Vec<Remote>,
    /// Deliveries that seemed to come from the future, and may have come since the step's time was
    /// read.
    early: Vec<(usize, Delivery)>,
    stepped_at: Option<f64>,
    past: Option<Past>,
    homes: Vec<Vector3<f64>>,
    /// Time when a drone showed up first.
    assembling: Option<f64>,
    /// True if drones that are ready wait for [`go`](Self::go).
    waits: bool,
    ready: bool,
    /// Reason why the hunt was broken off.
    failure: Option<String>,
    /// Events to be logged besides the hunt's own.
    events: VecDeque<Event>,
    hindrance: Option<String>,
    number: u64,
    order_at: f64,
    show_at: f64,
}

impl<L: FusionLink> FusionNode<L> {
    /// Fuses for `drones` drones with a hunt that has not begun; it begins when all of them have
    /// shown up, or goes on from a `past`. `epoch` is when the clock was at 0, the same as in the
    /// past.
    ///
    /// # Errors
    ///
    /// [`NetworkError::Config`] names the field that is out of its range;
    /// [`NetworkError::NoDrone`].
    pub fn new(
        hunt: Hunt,
        drones: usize,
        link: L,
        epoch: UnixTime,
        past: Option<Past>,
        config: FusionNodeConfig,
    ) -> Result<Self, NetworkError> {
        config.check()?;
        if drones == 0 {
            return Err(NetworkError::NoDrone);
        }
        Ok(Self {
            hunt,
            link,
            epoch,
            config,
            drones: std::iter::repeat_with(Remote::default).take(drones).collect(),
            early: Vec::new(),
            stepped_at: None,
            past,
            homes: Vec::new(),
            assembling: None,
            waits: false,
            ready: false,
            failure: None,
            events: VecDeque::new(),
            hindrance: None,
            number: 0,
            order_at: f64::NEG_INFINITY,
            show_at: f64::NEG_INFINITY,
        })
    }

    /// Moves on at a time in seconds of its own clock: takes reports, runs the hunt, gives orders.
    ///
    /// # Errors
    ///
    /// [`NetworkError::Link`] when the link failed, with the first of its errors; whatever did not
    /// fail was done all the same, and it may be called again. [`NetworkError::Hunt`] when the hunt
    /// cannot begin or go on.
    pub fn step(&mut self, time: f64) -> Result<(), NetworkError> {
        let now = self.epoch.after(time).ok_or(NetworkError::Time { time })?;
        self.excuse(time);
        self.drones.iter_mut().for_each(|drone| drone.answer(now));
        for (index, delivery) in std::mem::take(&mut self.early) {
            self.take_delivery(time, index, delivery, true);
        }
        let received = self.receive_reports(time);
        if self.failure.is_none() && !self.has_begun() {
            self.prepare(now);
            self.assemble(time)?;
        }
        if self.failure.is_none() && self.has_begun() {
            self.note_stages(now);
            self.hunt.advance(time)?;
            self.give_orders(now);
        }
        let sent = self.send_orders(time, now);
        let shown = self.show(time, now);
        Ok(received.and(sent).and(shown)?)
    }

    /// Returns the next event to be logged, each once, in the order in which they happened. Poll
    /// until it returns `None` after every step.
    pub fn poll_event(&mut self) -> Option<Event> {
        // A log begins with the hunt: its head names where the drones are then.
        if !self.has_begun() && self.failure.is_none() {
            return None;
        }
        let event = self.events.pop_front().or_else(|| self.hunt.poll_event());
        if event.is_none() {
            self.drones.iter_mut().for_each(Remote::logged);
        }
        event
    }

    /// The hunt.
    pub fn hunt(&self) -> &Hunt {
        &self.hunt
    }

    /// Returns the places where the drones began, East, North and Up in metres; empty before the
    /// hunt has begun.
    pub fn homes(&self) -> &[Vector3<f64>] {
        &self.homes
    }

    /// Returns the reason why the hunt has not begun though all drones are there, if there is one.
    pub fn hindrance(&self) -> Option<&str> {
        self.hindrance.as_deref()
    }

    /// The drones that have not shown up, or are silent.
    pub fn silent(&self, time: f64) -> Vec<usize> {
        let drones = self.drones.iter().enumerate();
        drones
            .filter(|(_, drone)| !self.is_reporting(drone, time))
            .map(|(drone, _)| drone)
            .collect()
    }

    /// Returns true if the hunt is over or was broken off, and every drone that is not silent has
    /// followed its last order, and is down if it was ordered to come down.
    pub fn is_finished(&self, time: f64) -> bool {
        let done = |drone: &Remote| drone.is_done() || !self.is_reporting(drone, time);
        let over = self.has_begun() && self.hunt.is_finished() || self.failure.is_some();
        over && self.drones.iter().all(done)
    }

    /// Sets whether drones that are ready wait for [`go`](Self::go) before they take off; at first
    /// they do not.
    pub fn wait_for_go(&mut self, waits: bool) {
        self.waits = waits;
    }

    /// Returns true if all drones stand ready, and wait for [`go`](Self::go).
    pub fn is_ready(&self) -> bool {
        self.ready && self.waits
    }

    /// Lets them take off.
    pub fn go(&mut self) {
        self.waits = false;
    }

    /// Breaks the hunt off: the drones leave by the pilot's rule for that.
    ///
    /// # Errors
    ///
    /// [`NetworkError::Time`] when `time` cannot be represented.
    pub fn abort(&mut self, time: f64, reason: &str) -> Result<(), NetworkError> {
        let now = self.epoch.after(time).ok_or(NetworkError::Time { time })?;
        self.break_off(now, reason.to_owned());
        Ok(())
    }

    /// Returns the reason why the hunt was broken off, if it was.
    pub fn failure(&self) -> Option<&str> {
        self.failure.as_deref()
    }

    /// Returns each drone's stage and what is in its way.
    pub fn stages(&self) -> impl Iterator<Item = (Stage, &str)> {
        self.drones.iter().map(|drone| (drone.stage, drone.failure.as_str()))
    }

    fn break_off(&mut self, now: UnixTime, reason: String) {
        if self.failure.is_none() && !(self.has_begun() && self.hunt.is_finished()) {
            let number = self.next_number(now);
            self.drones.iter_mut().for_each(|drone| drone.leave(number, Leave::OnAbort));
            self.failure = Some(reason);
        }
    }

    fn has_begun(&self) -> bool {
        !self.hunt.stations().is_empty()
    }

    fn is_reporting(&self, drone: &Remote, time: f64) -> bool {
        drone.reported_at.is_some_and(|last| time - last < self.config.silent_after_s)
    }

    /// Locates the drones again that had reported before this node stood still: they are not silent
    /// only because nobody received their reports.
    fn excuse(&mut self, time: f64) {
        let Some(before) = self.stepped_at.replace(time) else { return };
        if time - before <= STOOD_STILL_S {
            return;
        }
        for (index, drone) in self.drones.iter().enumerate() {
            if let Some((_, pose)) = drone.place
                && self.is_reporting(drone, before)
            {
                self.hunt.located(time, index, pose);
            }
        }
    }

    /// Receives the reports that have come. One that is lost does not keep the others back: a drone
    /// that reports is not silent.
    fn receive_reports(&mut self, time: f64) -> Result<(), LinkError> {
        let mut first = Ok(());
        let mut lost = 0;
        for _ in 0..MOST_REPORTS {
            let (index, report) = match self.link.receive() {
                Ok(Some(report)) => report,
                Ok(None) => break,
                // Logged without a drone: the sender is not one of ours.
                Err(error @ LinkError::Refused { .. }) => {
                    self.hunt.device_failed(time, None, error.to_string());
                    continue;
                }
                Err(error) => {
                    first = first.and(Err(error));
                    lost += 1;
                    if lost == MOST_LOST {
                        break;
                    }
                    continue;
                }
            };
            let Some(drone) = self.drones.get_mut(index) else {
                continue;
            };
            match report {
                Report::Pose { at, pose } if pose.is_finite() => {
                    if drone.place(at, pose, self.config.path_places) {
                        drone.reported_at = Some(time);
                        drone.late_s = time - at.since(self.epoch);
                        self.assembling.get_or_insert(time);
                        self.hunt.located(time, index, pose);
                    }
                }
                Report::Pose { pose, .. } => {
                    let reason = format!("its place is not finite: {pose:?}");
                    self.hunt.device_failed(time, Some(index), reason);
                }
                Report::Status(status) => self.take_status(time, index, status),
                Report::Delivery(delivery) => self.take_delivery(time, index, *delivery, false),
            }
        }
        first
    }

    /// Takes note of how a drone is; what is new is logged.
    fn take_status(&mut self, time: f64, index: usize, status: Status) {
        let drone = &mut self.drones[index];
        if !status.failure.is_empty() && drone.failure != status.failure {
            self.hunt.device_failed(time, Some(index), status.failure.clone());
        }
        drone.status(time, status);
        if let Some(ClockOffset { offset_s, uncertainty_s, jumps }) = drone.clock_to_log() {
            let event = Event::ClockOffset { time, drone: index, offset_s, uncertainty_s, jumps };
            self.events.push_back(event);
        }
    }

    /// Has all take off when all are ready. One that leaves before the hunt has begun ends it.
    fn prepare(&mut self, now: UnixTime) {
        let left = |(_, drone): &(usize, &Remote)| {
            drone.order.take_off && matches!(drone.stage, Stage::Leaving | Stage::Over)
        };
        if let Some((index, drone)) = self.drones.iter().enumerate().find(left) {
            let reason =
                format!("drone {index}, counted from 0, does not take part: {}", drone.failure);
            return self.break_off(now, reason);
        }
        // What has landed since a hunt began stays where it is.
        if self.past.is_some() {
            return;
        }
        let is_ready = |drone: &Remote| {
            let stage = matches!(drone.stage, Stage::Ready | Stage::Climbing | Stage::Flying);
            drone.place.is_some() && stage
        };
        self.ready = self.drones.iter().all(is_ready);
        if self.ready && !self.waits {
            let number = self.next_number(now);
            for drone in self.drones.iter_mut().filter(|drone| drone.stage == Stage::Ready) {
                drone.take_off(number, true);
            }
        }
    }

    /// Leaves those out of the formation that take no orders; without any that may come back the
    /// hunt is broken off.
    fn note_stages(&mut self, now: UnixTime) {
        for (index, drone) in self.drones.iter().enumerate() {
            self.hunt.set_away(index, drone.stage != Stage::Flying);
        }
        if self.drones.iter().all(|drone| drone.stage == Stage::Over) {
            self.break_off(now, "no drone is left".to_owned());
        }
    }

    /// Hands a delivery to the hunt, unless it was before, or is of a beacon whose search has not
    /// begun: that one will come again. One from the future is refused when it still is at the next
    /// step.
    fn take_delivery(&mut self, time: f64, index: usize, delivery: Delivery, waited: bool) {
        let name = delivery.name();
        let ended = delivery.ended.since(self.epoch);
        let beacon = delivery.beacon;
        if !self.has_begun() || self.hunt.is_yet_to_come(beacon) {
            return;
        }
        let ahead_s = ended - time;
        if ahead_s > self.config.clock_tolerance_s && !waited {
            self.early.push((index, delivery));
            return;
        }
        let drone = &mut self.drones[index];
        let outcome = delivery.reception.map(|made| Reception { beacon, time: ended, ..made });
        let known = match &outcome {
            Ok(reception) => self.hunt.has_fused(index, reception),
            Err(_) => false,
        };
        if known || drone.knows(&name) {
            drone.doubled += 1;
        } else {
            drone.delivered += 1;
            match outcome {
                Ok(_) if ahead_s > self.config.clock_tolerance_s => {
                    let reason = format!("it comes from {ahead_s:.1} s in the future");
                    self.hunt.nothing_received(time, index, beacon, ended, reason);
                }
                Ok(reception) => self.hunt.reception(time, index, &reception),
                Err(reason) => self.hunt.nothing_received(time, index, beacon, ended, reason),
            }
        }
        drone.handled(name);
    }

    /// Begins, or goes on from the past, when the drones are there.
    fn assemble(&mut self, time: f64) -> Result<(), NetworkError> {
        let absent = |drone: &Remote| {
            let flies = drone.stage == Stage::Flying && drone.place.is_some();
            !flies || !self.is_reporting(drone, time)
        };
        let missing = self.drones.iter().any(absent);
        let patient = |since: f64| time - since < self.config.assemble_s;
        let wait = self.past.is_none() || self.assembling.is_none_or(patient);
        if missing && wait {
            return Ok(());
        }
        let homes = self.past.as_ref().map_or(&[][..], |past| &past.homes);
        let place = |(index, drone): (usize, &Remote)| {
            let home = || homes.get(index).map(|home| Pose::level(*home, 0.0));
            drone.place.map(|(_, pose)| pose).or_else(home).map(Station::holding)
        };
        let stations: Option<Vec<Station>> = self.drones.iter().enumerate().map(place).collect();
        let Some(stations) = stations else {
            return Ok(());
        };
        let here: Vec<_> = stations.iter().map(|station| station.pose.position).collect();
        let Some(past) = &self.past else {
            self.hunt.start(time, stations)?;
            self.homes = here;
            return Ok(());
        };
        match self.hunt.resume(time, stations, &past.homes, &past.events) {
            Ok(()) => {
                let known = past.homes.len() == here.len();
                self.homes = if known { past.homes.clone() } else { here };
                self.past = None;
                self.hindrance = None;
                Ok(())
            }
            // They are in the air, and will come apart.
            Err(error @ HuntError::Traffic(_)) => {
                self.hindrance = Some(error.to_string());
                Ok(())
            }
            Err(error) => Err(error.into()),
        }
    }

    /// Puts the hunt's commands into orders.
    fn give_orders(&mut self, now: UnixTime) {
        while let Some(command) = self.hunt.poll_command() {
            let number = self.next_number(now);
            let (Command::GoTo { drone, .. }
            | Command::Land { drone }
            | Command::Listen { drone, .. }) = command;
            let Some(drone) = self.drones.get_mut(drone) else {
                continue;
            };
            match command {
                Command::GoTo { goal, .. } => drone.go_to(number, goal),
                Command::Land { .. } => drone.land(number),
                Command::Listen { beacons, .. } => drone.listen(number, beacons),
            }
        }
        let number = self.next_number(now);
        let over = self.hunt.is_finished();
        for drone in &mut self.drones {
            drone.take_off(number, false);
            if over {
                drone.leave(number, Leave::AtEnd);
            }
        }
        for index in 0..self.drones.len() {
            // Its orders are newer than ours: the clock went back since they were given.
            if self.drones[index].follows > self.drones[index].order.number {
                self.number = self.number.max(self.drones[index].follows);
                let number = self.next_number(now);
                let order = &mut self.drones[index].order;
                order.number = number;
                if order.turn.number > 0 {
                    order.turn.number = number;
                }
            }
            self.drones[index].limit_turn(self.hunt.owed_by(index));
        }
    }

    /// Larger than every number before, those before a restart included.
    fn next_number(&mut self, now: UnixTime) -> u64 {
        self.number = now.nanoseconds().max(self.number.saturating_add(1));
        self.number
    }

    /// Sends new orders at once, and all of them now and then.
    fn send_orders(&mut self, time: f64, now: UnixTime) -> Result<(), LinkError> {
        let again = time >= self.order_at;
        if again {
            self.order_at = time + self.config.order_every_s;
        }
        let mut all_sent = Ok(());
        for (index, drone) in self.drones.iter_mut().enumerate() {
            if again || !drone.sent && drone.order.number > 0 {
                drone.order.at = now;
                let sent = self.link.send(index, &drone.order);
                drone.sent |= sent.is_ok();
                all_sent = all_sent.and(sent);
            }
        }
        all_sent
    }

    fn show(&mut self, time: f64, now: UnixTime) -> Result<(), LinkError> {
        if time < self.show_at {
            return Ok(());
        }
        self.show_at = time + self.config.show_every_s;
        let silent = self.silent(time);
        let hindrance = self.hindrance.as_deref();
        let view =
            view(now, &self.hunt, &self.drones, &silent, hindrance, self.config.clock_tolerance_s);
        self.link.show(&view)
    }
}
