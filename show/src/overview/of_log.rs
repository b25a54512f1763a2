use std::{collections::BTreeMap, fmt};

use foxhunt_core::{BeaconId, Estimate, OwnedSweep, Reception};
use foxhunt_formation::Phase;
use foxhunt_hunt::{
    hunt::{Event, FoundTransmitter, TrackStep, cloud},
    log::{Log, LogHeader, LoggedBeacon},
    registry::{EstimatorEntry, Registry},
};
use foxhunt_wire::geodesy::LocalFrame;
use nalgebra::{Vector2, Vector3};

use super::{
    Believed, Health, Knot, KnownAntenna, Overview, Received, Receiver, SearchOverview, Turn,
    notice,
};
use foxhunt_archive::{
    replay::{Moment, Replay, ReplayError, ReplayedFix, Replayer},
    struck::{ReceptionId, ReceptionKey, Struck},
};

/// A turn whose samples were kept beside the log.
#[derive(Clone, Debug, PartialEq)]
pub struct KeptTurn {
    /// Index of the drone.
    pub drone: usize,
    /// The turn.
    pub sweep: OwnedSweep,
}

/// Maximum number of places for one belief.
const MOST_PLACES: u32 = 2000;

/// Maximum number of places for all beliefs of a hunt together: they are most of a page.
const ALL_PLACES: usize = 400_000;

impl Overview {
    /// Reads a hunt from its log, replayed through its own estimator or another one: the beliefs
    /// are the returned replay's to the bit. `turns` may be empty.
    ///
    /// # Errors
    ///
    /// [`ReplayError`] as of [`replay`](foxhunt_archive::replay::replay).
    pub fn of_log(
        log: &Log,
        registry: &Registry,
        other: Option<&EstimatorEntry>,
        struck: &Struck,
        turns: Vec<KeptTurn>,
        antenna: Option<KnownAntenna<'_>>,
    ) -> Result<(Self, Replay), ReplayError> {
        let mut reader = OverviewReader::new(&log.header, registry, other, antenna)?
            .without(struck.clone())
            .with_places(places_of(log));
        for turn in turns {
            reader.turn(turn);
        }
        for event in &log.events {
            reader.event(event)?;
        }
        Ok(reader.finish())
    }
}

impl Overview {
    /// Reads a hunt from its log as [`of_log`](Self::of_log) does, with the smoothed track of each
    /// beacon beside its beliefs.
    ///
    /// # Errors
    ///
    /// [`ReplayError`] as of [`replay`](foxhunt_archive::replay::replay);
    /// [`ReplayError::Smoothing`] when an estimator has no smoother.
    pub fn of_log_smoothed(
        log: &Log,
        registry: &Registry,
        other: Option<&EstimatorEntry>,
        struck: &Struck,
    ) -> Result<(Self, Replay), ReplayError> {
        let mut reader = OverviewReader::new(&log.header, registry, other, None)?;
        reader.replayer = Replayer::smoothable(&log.header, registry, other)?;
        let mut reader = reader.without(struck.clone()).with_places(places_of(log));
        for event in &log.events {
            reader.event(event)?;
        }
        reader.finish_smoothed()
    }
}

/// The transmitters on a beacon's frequency, each as a search with one belief; none for an
/// estimator of one transmitter.
fn transmitters(fix: &ReplayedFix, header: &LogHeader) -> Vec<SearchOverview> {
    let beacon = header.beacons.get(usize::from(fix.beacon.0));
    let found = fix.transmitters.iter().flatten().zip(1_u32..);
    let search = |(found, number): (&FoundTransmitter, u32)| {
        let estimate = found.estimate;
        let truth = beacon.and_then(|beacon| beacon.nearest_at(fix.time, &estimate.mean));
        SearchOverview {
            name: format!("{} {number}", fix.name),
            truth: truth.map(|place| Knot::on_ground(fix.time, place)).into_iter().collect(),
            beliefs: vec![Believed::of(fix.time, fix.steps, estimate, truth)],
            outcome: Some(format!("there with {:.3}", found.existence)),
            ..SearchOverview::default()
        }
    };
    found.map(search).collect()
}

/// Number of places for one belief of a log.
fn places_of(log: &Log) -> u32 {
    let received = log.events.iter().filter(|e| matches!(e, Event::Received { .. })).count();
    let places = ALL_PLACES.checked_div(received).and_then(|each| u32::try_from(each).ok());
    places.unwrap_or(MOST_PLACES).clamp(100, MOST_PLACES)
}

/// Key that a reception and its turn have in common: drone, beacon, and the bits of the time.
type Key = (usize, u16, u64);

/// A drone's flight, by its orders.
#[derive(Clone, Copy, Default)]
struct Flight {
    /// Last known place of the drone.
    at: Option<Vector3<f64>>,
    /// Goal of its order from there.
    to: Option<Vector3<f64>>,
}

/// Puts a hunt's events together, from a log or while it is flown.
pub struct OverviewReader<'a> {
    header: LogHeader,
    replayer: Replayer<'a>,
    struck: Struck,
    /// Maximum number of places for one belief.
    places: u32,
    turns: BTreeMap<Key, KeptTurn>,
    antenna: Option<KnownAntenna<'a>>,
    overview: Overview,
    /// Each drone's.
    flights: Vec<Flight>,
}

impl fmt::Debug for OverviewReader<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("OverviewReader").field("replayer", &self.replayer).finish_non_exhaustive()
    }
}

impl<'a> OverviewReader<'a> {
    /// Begins with the header of a log; the estimator is chosen as in [`Replayer::new`].
    ///
    /// # Errors
    ///
    /// The errors of [`Replayer::new`].
    pub fn new(
        header: &LogHeader,
        registry: &Registry,
        other: Option<&EstimatorEntry>,
        antenna: Option<KnownAntenna<'a>>,
    ) -> Result<Self, ReplayError> {
        let method = other.map_or(header.estimator_name.clone(), |entry| entry.name.to_string());
        #[expect(clippy::cast_precision_loss, reason = "UNIX time is far below 2^53 s")]
        let epoch_unix_s = header.epoch_unix_s.map(|epoch| epoch as f64);
        let overview = Overview {
            title: header.scenario.clone(),
            method,
            seed: Some(header.seed),
            epoch_unix_s,
            frame: header.origin.and_then(|origin| LocalFrame::new(origin).ok()),
            ..Overview::default()
        };
        Ok(Self {
            header: header.clone(),
            replayer: Replayer::new(header, registry, other)?,
            struck: Struck::default(),
            places: MOST_PLACES,
            turns: BTreeMap::new(),
            antenna,
            overview,
            flights: Vec::new(),
        })
    }

    /// Leaves receptions out of the estimates; they stay in the overview.
    #[must_use]
    pub fn without(self, struck: Struck) -> Self {
        Self { replayer: self.replayer.without(struck.clone()), struck, ..self }
    }

    /// Sets how many places stand for one belief at most; 2000 unless given.
    #[must_use]
    pub fn with_places(self, places: u32) -> Self {
        Self { places, ..self }
    }

    /// Keeps a turn until its reception comes.
    pub fn turn(&mut self, turn: KeptTurn) {
        let key = (turn.drone, turn.sweep.beacon.0, turn.sweep.time.to_bits());
        let _ = self.turns.insert(key, turn);
    }

    /// Returns the overview of the events so far.
    #[must_use]
    pub fn overview(&self) -> &Overview {
        &self.overview
    }

    /// Returns the overview and the replay of all events.
    #[must_use]
    pub fn finish(mut self) -> (Overview, Replay) {
        let replay = self.replayer.finish();
        // Both are in the order in which the searches began.
        for (search, fix) in self.overview.searches.iter_mut().zip(&replay.fixes) {
            search.remarks.clone_from(&fix.remarks);
        }
        let found = replay.fixes.iter().flat_map(|fix| transmitters(fix, &self.header));
        self.overview.searches.extend(found);
        (self.overview, replay)
    }

    /// Returns the overview with the smoothed tracks, and the replay of all events.
    fn finish_smoothed(mut self) -> Result<(Overview, Replay), ReplayError> {
        let replay = self.replayer.finish_smoothed()?;
        for (search, fix) in self.overview.searches.iter_mut().zip(&replay.fixes) {
            search.remarks.clone_from(&fix.remarks);
            let beacon = self.header.beacons.get(usize::from(fix.beacon.0));
            let steps = 1..=u32::MAX;
            search.smoothed = (fix.smoothed.iter().zip(steps))
                .map(|((time, estimate), steps)| {
                    let truth = beacon.and_then(|beacon| beacon.nearest_at(*time, &estimate.mean));
                    Believed::of(*time, steps, *estimate, truth)
                })
                .collect();
        }
        Ok((self.overview, replay))
    }

    /// Adds what happened.
    ///
    /// # Errors
    ///
    /// As [`Replayer::event`].
    pub fn event(&mut self, event: &Event) -> Result<(), ReplayError> {
        self.overview.notices.extend(notice(event));
        let moment = self.replayer.event(event)?.map(|moment| Step::of(&moment, self.places));
        match event {
            Event::BeaconStarted { time, beacon, name, .. } => {
                let search = SearchOverview { name: name.clone(), ..SearchOverview::default() };
                self.overview.searches.push(search);
                self.believe(*time, *beacon, moment);
            }
            Event::Received { drone, reception, .. } => self.receive(*drone, reception, moment),
            Event::Sent { time, drone, to, .. } => self.send(*drone, *time, *to),
            Event::PhaseChanged { time, phase: Phase::Measuring(_) } => self.arrive(*time),
            Event::Health { time, drone, battery, linked, position_sigma_m, above_ground } => {
                self.flight(*drone);
                if let Some(receiver) = self.overview.receivers.get_mut(*drone) {
                    receiver.health.push(Health {
                        time: *time,
                        battery: *battery,
                        linked: *linked,
                        position_sigma_m: *position_sigma_m,
                        above_ground: *above_ground,
                    });
                }
            }
            Event::BeaconFinished { fix, .. } => {
                let mut searches = self.overview.searches.iter_mut();
                if let Some(search) = searches.rfind(|search| search.name == fix.name) {
                    search.outcome = Some(fix.outcome.to_string());
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Adds what is believed since.
    fn believe(&mut self, time: f64, beacon: BeaconId, step: Option<Step>) {
        let Some(step) = step else { return };
        let Some(search) = self.overview.searches.get_mut(step.search) else { return };
        let beacon = self.header.beacons.get(usize::from(beacon.0));
        if let Some(beacon) = beacon {
            extend_way(&mut search.truth, beacon, time);
        }
        let truth = beacon.and_then(|beacon| beacon.nearest_at(time, &step.estimate.mean));
        let believed = Believed::of(time, step.steps, step.estimate, truth);
        search.beliefs.push(Believed { cloud: step.cloud, ..believed });
    }

    fn receive(&mut self, drone: usize, reception: &Reception, step: Option<Step>) {
        let search = step.as_ref().map(|step| step.search);
        let (used, nis) = match step.as_ref().and_then(|step| step.step) {
            Some(TrackStep::Updated { correction, degrees_of_freedom }) => {
                let nis = correction.nis().map(|nis| (nis, degrees_of_freedom));
                (!correction.is_rejected(), nis)
            }
            _ => (false, None),
        };
        let id = ReceptionId::new(drone, reception);
        let struck = self.struck.contains(&id);
        // Nothing is believed anew of what is left out.
        self.believe(reception.time, reception.beacon, step.filter(|_| !struck));
        let bearing = reception.bearing.map(|bearing| bearing.angle);
        let kept = self.turns.remove(&(drone, reception.beacon.0, reception.time.to_bits()));
        let turn = kept.map(|kept| Turn::new(&kept.sweep.as_sweep(), self.antenna, bearing));
        let place = reception.receiver.position;
        let received = Received {
            time: reception.time,
            receiver: drone,
            search,
            place,
            level: reception.level,
            bearing: reception.bearing,
            modes: reception.modes,
            remark: reception.silence.map(|floor| {
                format!("nothing above the receiver's floor of {:.1} dBm", floor.rss_dbm)
            }),
            used,
            struck,
            id: Some(ReceptionKey::Logged(id)),
            nis,
            turn,
        };
        self.flight(drone);
        self.overview.add(received);
        if let Some(flight) = self.flights.get_mut(drone) {
            *flight = Flight { at: Some(place), to: None };
        }
    }

    /// The flight of a drone; a new drone has a name, and begins where the log has it.
    fn flight(&mut self, drone: usize) -> Flight {
        while self.flights.len() <= drone {
            let home = self.header.homes.get(self.flights.len()).copied();
            self.flights.push(Flight { at: home, to: None });
            let name = format!("drone {}", self.flights.len());
            let path = home.map(|place| Knot { time: 0.0, place }).into_iter().collect();
            self.overview.receivers.push(Receiver { name, path, health: Vec::new() });
        }
        self.flights.get(drone).copied().unwrap_or_default()
    }

    /// A drone sets off, or has come to a corner of its way.
    fn send(&mut self, drone: usize, time: f64, to: Vector3<f64>) {
        let flight = self.flight(drone);
        self.put(drone, time, flight.to.or(flight.at));
        if let Some(flight) = self.flights.get_mut(drone) {
            flight.to = Some(to);
        }
    }

    /// All drones are where they were sent.
    fn arrive(&mut self, time: f64) {
        for drone in 0..self.flights.len() {
            if let Some(to) = self.flight(drone).to {
                self.put(drone, time, Some(to));
            }
        }
    }

    /// A drone is at a place.
    fn put(&mut self, drone: usize, time: f64, place: Option<Vector3<f64>>) {
        let Some(place) = place else { return };
        if let Some(receiver) = self.overview.receivers.get_mut(drone) {
            receiver.path.push(Knot { time, place });
        }
        if let Some(flight) = self.flights.get_mut(drone) {
            *flight = Flight { at: Some(place), to: None };
        }
    }
}

/// One step of the replay.
struct Step {
    search: usize,
    step: Option<TrackStep>,
    steps: u32,
    estimate: Estimate<2>,
    cloud: Vec<Vector2<f64>>,
}

impl Step {
    fn of(moment: &Moment<'_>, places: u32) -> Self {
        let Moment { search, track, step } = *moment;
        let steps = track.steps();
        let estimate = match step {
            None if steps == 0 => track.prior(),
            _ => track.position(),
        };
        let cloud = cloud(track.belief(), places).unwrap_or_default();
        Self { search, step, steps, estimate, cloud }
    }
}

/// Adds to the way of a beacon where it truly is until a time: one place where it stays.
fn extend_way(way: &mut Vec<Knot>, beacon: &LoggedBeacon, time: f64) {
    /// In seconds; no course turns sharply in less.
    const STEP: f64 = 2.0;
    let knot = |time: f64| beacon.place_at(time).map(|place| Knot { time, place: place.push(0.0) });
    let before = way.last().map_or(0.0, |knot| knot.time);
    if way.is_empty() {
        way.extend(knot(0.0));
    }
    if beacon.course.is_none() || !(time > before && time - before < 1e5) {
        return;
    }
    let mut next = before + STEP;
    while next < time {
        way.extend(knot(next));
        next += STEP;
    }
    way.extend(knot(time));
}
