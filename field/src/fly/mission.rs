use std::{collections::VecDeque, fmt};

use foxhunt_core::{PatternSource, Station, parameter::FieldError};
use foxhunt_hardware::Aircraft;
use foxhunt_hunt::hunt::{Event, FlightStage, Hunt, drive};

use super::{
    Ending, FlightRules, FlownDrone,
    flown_drone::{Departure, all_that_move},
};

/// Silence after which an aircraft takes no part, in seconds.
const SILENT_S: f64 = 5.0;

/// A flight of real aircraft from the ground to the ground, with a hunt in the middle.
///
/// No aircraft is armed before all of them are ready; an aircraft that the pilot takes gets no
/// orders any more; whatever goes wrong ends with the pilot's rules. It reads no clock and never
/// waits: call [`step`](Self::step) some hundred times a second until it [is over](Self::is_over).
pub struct Mission<A, S> {
    rules: FlightRules,
    hunt: Hunt,
    drones: Vec<FlownDrone<A, S>>,
    stage: FlightStage,
    since: f64,
    /// Rule by which the aircraft leave.
    ending: Ending,
    /// True if drones that are ready wait for [`go`](Self::go).
    waits: bool,
    ready: bool,
    /// Time when an aircraft took part last.
    attended: f64,
    /// Number of leaving drones that are not down yet.
    leaving: usize,
    /// Reason why the flight ended before its time.
    failure: Option<String>,
    /// Reason why each drone does not take off, by its last order to.
    refused: Vec<Option<String>>,
    /// Drones that nobody waits for any more.
    written_off: Vec<bool>,
    events: VecDeque<Event>,
}

impl<A, S> fmt::Debug for Mission<A, S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Mission")
            .field("rules", &self.rules)
            .field("drones", &self.drones.len())
            .field("stage", &self.stage)
            .field("failure", &self.failure)
            .finish_non_exhaustive()
    }
}

impl<A: Aircraft, S: PatternSource> Mission<A, S> {
    /// Creates a flight that begins at `time` with aircraft on the ground.
    ///
    /// # Errors
    ///
    /// [`MissionError`] when there is no aircraft, or a rule is out of its range.
    pub fn new(
        rules: FlightRules,
        hunt: Hunt,
        drones: Vec<FlownDrone<A, S>>,
        time: f64,
    ) -> Result<Self, MissionError> {
        rules.check().map_err(|error| error.within("flight"))?;
        if drones.is_empty() {
            return Err(MissionError::NoDrone);
        }
        let count = drones.len();
        let mut mission = Self {
            rules,
            hunt,
            drones,
            stage: FlightStage::Preparing,
            since: time,
            ending: rules.at_end,
            waits: false,
            ready: false,
            attended: time,
            leaving: 0,
            failure: None,
            refused: vec![None; count],
            written_off: vec![false; count],
            events: VecDeque::new(),
        };
        mission.enter(time, FlightStage::Preparing, "the log begins".into());
        Ok(mission)
    }

    /// Sets whether drones that are ready wait for [`go`](Self::go) before they take off; at first
    /// they do not.
    pub fn wait_for_go(&mut self, waits: bool) {
        self.waits = waits;
    }

    /// Allows that drones which are in the air already, in the mode that takes orders, are taken
    /// over: for a caller that knows that nobody else flies them. Without it the flight does not
    /// begin.
    pub fn allow_take_over(&mut self) {
        self.drones.iter_mut().for_each(FlownDrone::allow_take_over);
    }

    /// Lets them take off.
    pub fn go(&mut self) {
        self.waits = false;
    }

    /// Passes on the pilot's word that what came down without our order may take off again. Of
    /// effect while the drones climb; afterwards nothing takes off any more.
    pub fn clear_to_take_off(&mut self, time: f64) {
        if self.stage == FlightStage::Climbing {
            self.since = time;
            self.drones.iter_mut().for_each(FlownDrone::clear_to_take_off);
        }
    }

    /// Returns true if all drones are ready, and wait for [`go`](Self::go).
    #[must_use]
    pub fn is_ready(&self) -> bool {
        self.stage == FlightStage::Preparing && self.ready && self.waits
    }

    /// Does what can be done now.
    pub fn step(&mut self, time: f64) {
        self.read_states(time);
        match self.stage {
            FlightStage::Preparing => self.prepare(time),
            FlightStage::Climbing => self.climb(time),
            FlightStage::Hunting => self.fly(time),
            FlightStage::Leaving => self.leave(time),
            // Over.
            _ => {}
        }
        while let Some(event) = self.hunt.poll_event() {
            if matches!(&event, Event::BeaconFinished { fix, .. } if fix.steps > 0) {
                self.photograph(time);
            }
            if let Event::Landed { drone, .. } = event
                && let Some(landed) = self.drones.get_mut(drone)
            {
                landed.was_landed();
            }
            self.events.push_back(event);
        }
    }

    /// Gives a drone up, which is known to be lost: the end of the flight does not wait until it is
    /// down. It gets its orders all the same.
    pub fn write_off(&mut self, drone: usize) {
        if let Some(written_off) = self.written_off.get_mut(drone) {
            *written_off = true;
        }
    }

    /// Breaks off: the aircraft leave by the pilot's rule for that.
    pub fn abort(&mut self, time: f64, reason: &str) {
        match self.stage {
            FlightStage::Preparing => {
                self.failure = Some(reason.to_owned());
                self.enter(time, FlightStage::Over, reason.to_owned());
            }
            FlightStage::Climbing | FlightStage::Hunting => self.fail(time, reason),
            FlightStage::Leaving if self.ending != self.rules.on_abort => {
                self.end(time, self.rules.on_abort, reason.to_owned());
            }
            _ => {}
        }
    }

    /// The next thing to be logged, each once.
    pub fn poll_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// The stage of the flight.
    #[must_use]
    pub fn stage(&self) -> FlightStage {
        self.stage
    }

    /// Returns true if nothing remains to be done.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.stage == FlightStage::Over
    }

    /// Returns the reason why it ended before its time, if it did.
    #[must_use]
    pub fn failure(&self) -> Option<&str> {
        self.failure.as_deref()
    }

    /// The hunt.
    #[must_use]
    pub fn hunt(&self) -> &Hunt {
        &self.hunt
    }

    /// Reads the state of every aircraft, which serves its link, and logs what has changed.
    fn read_states(&mut self, time: f64) {
        for (index, drone) in self.drones.iter_mut().enumerate() {
            if let Err(error) = drone.read_state(time, index, &mut self.events) {
                self.hunt.device_failed(time, Some(index), error.to_string());
            }
            if let Some(error) = drone.aircraft.picture_failure() {
                self.hunt.device_failed(time, Some(index), error.to_string());
            }
        }
    }

    /// Has the cameras of those in our hands take a picture.
    fn photograph(&mut self, time: f64) {
        for (index, drone) in self.drones.iter_mut().enumerate() {
            if drone.is_commanded()
                && let Err(error) = drone.aircraft.photograph()
            {
                self.hunt.device_failed(time, Some(index), error.to_string());
            }
        }
    }

    /// Waits until all are ready, then has all take off. One that somebody else flies ends it: when
    /// it is down again nobody has given it to us.
    fn prepare(&mut self, time: f64) {
        if let Some(why) = self.drones.iter().find_map(FlownDrone::flown_by_others) {
            return self.abort(time, &why);
        }
        let unready = self.drones.iter_mut().find_map(|drone| {
            let why = drone.not_ready()?;
            Some(format!("{} is not ready: {why}", drone.name))
        });
        self.ready = unready.is_none();
        match unready {
            None if self.waits => self.since = time,
            None => self.enter(time, FlightStage::Climbing, "all are ready".into()),
            Some(why) if time - self.since >= self.rules.ready_timeout_s => self.abort(time, &why),
            Some(_) => {}
        }
    }

    /// Has them take off until all are up, and begins the hunt.
    fn climb(&mut self, time: f64) {
        let mut waiting = None;
        let drones = self.drones.iter_mut().zip(&mut self.refused).enumerate();
        for (index, (drone, refused)) in drones {
            if drone.is_commanded() {
                continue;
            }
            if let Err(error) = drone.take_off(time, self.rules.takeoff_up_m) {
                let why = format!("{} does not take off: {error}", drone.name);
                self.hunt.device_failed(time, Some(index), why.clone());
                *refused = Some(why);
            }
            waiting = waiting.or_else(|| {
                let silent = || format!("{} is not up, and gives no reason", drone.name);
                Some(match drone.hindrance() {
                    "" => refused.clone().unwrap_or_else(silent),
                    why => format!("{} is not up: {why}", drone.name),
                })
            });
        }
        match waiting {
            None => self.begin(time),
            Some(why) if time - self.since >= self.rules.climb_timeout_s => self.abort(time, &why),
            Some(_) => {}
        }
    }

    fn begin(&mut self, time: f64) {
        let station = |drone: &mut FlownDrone<A, S>| Ok(Station::holding(drone.aircraft.pose()?));
        let stations: Result<Vec<Station>, A::Error> =
            self.drones.iter_mut().map(station).collect();
        match stations {
            // They have all been up a moment ago; a place that is missing now comes again.
            Err(_) => {}
            Ok(stations) => {
                for (index, drone) in self.drones.iter().enumerate() {
                    self.hunt.set_rooted(index, drone.is_rooted());
                }
                match self.hunt.start(time, stations) {
                    Ok(()) => {
                        self.attended = time;
                        self.enter(time, FlightStage::Hunting, "all are up".into());
                    }
                    Err(error) => self.abort(time, &error.to_string()),
                }
            }
        }
    }

    /// Lets the hunt go on with the drones that take orders.
    fn fly(&mut self, time: f64) {
        for (index, drone) in self.drones.iter_mut().enumerate() {
            drone.take_over_again(time);
            self.hunt.set_away(index, !drone.is_commanded());
            self.hunt.set_rooted(index, drone.is_rooted());
        }
        if !all_that_move(&self.drones, |drone| drone.is_out(SILENT_S)) {
            self.attended = time;
        }
        let deserted_s = time - self.attended;
        if all_that_move(&self.drones, FlownDrone::is_down) {
            self.fail(time, "all drones are on the ground");
        } else if deserted_s >= self.rules.deserted_timeout_s {
            self.fail(time, &format!("no drone has taken part for {deserted_s:.0} s"));
        } else if let Err(error) = drive(&mut self.hunt, &mut self.drones, time) {
            self.abort(time, &error.to_string());
        } else if self.hunt.is_finished() {
            self.end(time, self.rules.at_end, "the hunt is over".into());
        } else {
            self.listen_between(time);
        }
    }

    /// Has receivers that listen between the hunt's turns do so: what they receive then is for ears
    /// and recordings.
    fn listen_between(&mut self, time: f64) {
        for (index, drone) in self.drones.iter_mut().enumerate() {
            let Some(order) = drone.listens_between.as_ref().filter(|_| !self.hunt.awaits(index))
            else {
                continue;
            };
            // The rest of a turn that the hunt has given up is for ears, too.
            order.end();
            if let Err(error) = drone.source.poll().map(drop) {
                self.hunt.device_failed(time, Some(index), error.to_string());
            }
        }
    }

    /// Orders all that are in our hands down, until each is down, or in the hands of somebody who
    /// is named. Until then one that is given back is brought home, too.
    ///
    /// They return one after the other: each climbs to the height of its autopilot and flies home
    /// over the others, which hold their places until it is down. One whose battery is low, or
    /// whose link fails, does not wait.
    fn leave(&mut self, time: f64) {
        let mut waited_for = Vec::new();
        let mut left = Vec::new();
        let mut comes_home = false;
        for (index, drone) in self.drones.iter_mut().enumerate() {
            let waits = self.ending == Ending::Return && drone.can_wait(time);
            if waits && std::mem::replace(&mut comes_home, true) {
                waited_for.push(drone.name.as_str());
                continue;
            }
            let departure = drone.departure(self.ending);
            if departure == Departure::Ordered
                && let Err(error) = drone.order_to_leave(time, self.ending)
            {
                self.hunt.device_failed(time, Some(index), error.to_string());
            }
            let written_off = self.written_off.get(index).is_some_and(|written_off| *written_off);
            match departure {
                Departure::Down => {}
                Departure::Left(to) => left.push(to),
                Departure::Ordered | Departure::Awaited if written_off => {}
                Departure::Ordered | Departure::Awaited => waited_for.push(drone.name.as_str()),
            }
        }
        if waited_for.len() < self.leaving {
            // Each has the time of one.
            self.since = time;
        }
        self.leaving = waited_for.len();
        let why = if !waited_for.is_empty() {
            if time - self.since < self.rules.leaving_timeout_s {
                return;
            }
            left.insert(0, format!("not known to be down: {}", waited_for.join(", ")));
            left.join("; ")
        } else if left.is_empty() {
            return self.enter(time, FlightStage::Over, "nobody is left to be brought down".into());
        } else {
            left.join("; ")
        };
        if self.ending != Ending::Hold || !waited_for.is_empty() {
            self.failure = Some(match self.failure.take() {
                Some(failure) => format!("{failure}; {why}"),
                None => why.clone(),
            });
        }
        self.enter(time, FlightStage::Over, why);
    }

    /// Ends the hunt before its time; those in our hands leave by the pilot's rule for that.
    fn fail(&mut self, time: f64, reason: &str) {
        self.failure.get_or_insert_with(|| reason.to_owned());
        self.end(time, self.rules.on_abort, reason.to_owned());
    }

    fn end(&mut self, time: f64, ending: Ending, reason: String) {
        self.ending = ending;
        self.drones.iter_mut().for_each(FlownDrone::reset_orders);
        self.enter(time, FlightStage::Leaving, reason);
    }

    fn enter(&mut self, time: f64, stage: FlightStage, reason: String) {
        self.stage = stage;
        self.since = time;
        self.events.push_back(Event::FlightStage { time, stage, reason });
    }
}

/// Reason why a flight cannot begin.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MissionError {
    /// No drone was given.
    #[error("a flight needs at least one drone")]
    NoDrone,
    /// A rule is out of its range.
    #[error(transparent)]
    Rule(#[from] FieldError),
}
