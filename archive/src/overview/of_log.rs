use std::collections::BTreeMap;

use foxhunt_core::{Estimate, OwnedSweep, Reception};
use foxhunt_formation::Phase;
use foxhunt_hunt::{
    hunt::{Event, TrackStep, cloud},
    log::{Log, LoggedBeacon},
    registry::{EstimatorEntry, Registry},
};
use foxhunt_wire::geodesy::LocalFrame;
use nalgebra::{Vector2, Vector3};

use super::{
    Believed, Knot, KnownAntenna, Overview, Received, Receiver, SearchOverview, Turn, notice,
};
use crate::replay::{Moment, Replay, ReplayError, replay_watched};

/// A turn whose samples were kept beside the log.
#[derive(Clone, Debug, PartialEq)]
pub struct KeptTurn {
    /// Which drone's.
    pub drone: usize,
    /// The turn.
    pub sweep: OwnedSweep,
}

/// How many places stand for one belief at most.
const MOST_PLACES: u32 = 2000;

/// How many stand for all beliefs of a hunt together: they are most of a page.
const ALL_PLACES: usize = 400_000;

impl Overview {
    /// A hunt out of its log, replayed through its own estimator or another one: the beliefs are
    /// those of the replay to the bit, which comes with them. `turns` may be empty.
    ///
    /// # Errors
    ///
    /// [`ReplayError`] as of [`replay`](crate::replay::replay).
    pub fn of_log(
        log: &Log,
        registry: &Registry,
        other: Option<&EstimatorEntry>,
        turns: &[KeptTurn],
        antenna: Option<KnownAntenna<'_>>,
    ) -> Result<(Self, Replay), ReplayError> {
        let received = log.events.iter().filter(|e| matches!(e, Event::Received { .. })).count();
        let places = ALL_PLACES.checked_div(received).and_then(|each| u32::try_from(each).ok());
        let places = places.unwrap_or(MOST_PLACES).clamp(100, MOST_PLACES);
        let mut moments = BTreeMap::new();
        let mut watch = |moment: Moment<'_>| {
            let cloud = cloud(moment.track.belief(), places).unwrap_or_default();
            let estimate = match moment.step {
                None => moment.track.prior(),
                Some(_) => moment.track.position(),
            };
            let Moment { event, search, track, step } = moment;
            moments.insert(event, Step { search, step, steps: track.steps(), estimate, cloud });
        };
        let replay = replay_watched(log, registry, other, &mut watch)?;
        let header = &log.header;
        let method = other.map_or(header.estimator_name.clone(), |entry| entry.name.to_string());
        #[expect(clippy::cast_precision_loss, reason = "UNIX time is far below 2^53 s")]
        let epoch_unix_s = header.epoch_unix_s.map(|epoch| epoch as f64);
        let overview = Self {
            title: header.scenario.clone(),
            method,
            seed: Some(header.seed),
            epoch_unix_s,
            frame: header.origin.and_then(|origin| LocalFrame::new(origin).ok()),
            ..Self::default()
        };
        let turns = turns.iter().map(|turn| (key(turn.drone, &turn.sweep), turn)).collect();
        let mut reader = Reader { log, moments, turns, antenna, overview, flights: Vec::new() };
        for (index, event) in log.events.iter().enumerate() {
            reader.read(index, event);
        }
        Ok((reader.overview, replay))
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

/// What a reception and its turn have in common: drone, beacon, and the bits of the time.
type Key = (usize, u16, u64);

fn key(drone: usize, sweep: &OwnedSweep) -> Key {
    (drone, sweep.beacon.0, sweep.time.to_bits())
}

/// Where a drone is, by its orders.
#[derive(Clone, Copy, Default)]
struct Flight {
    /// Where it was last known to be.
    at: Option<Vector3<f64>>,
    /// Where it was sent from there.
    to: Option<Vector3<f64>>,
}

/// Puts events together.
struct Reader<'a> {
    log: &'a Log,
    moments: BTreeMap<usize, Step>,
    turns: BTreeMap<Key, &'a KeptTurn>,
    antenna: Option<KnownAntenna<'a>>,
    overview: Overview,
    /// Each drone's.
    flights: Vec<Flight>,
}

impl Reader<'_> {
    fn read(&mut self, index: usize, event: &Event) {
        self.overview.notices.extend(notice(event));
        match event {
            Event::BeaconStarted { time, beacon, name, .. } => {
                let beacon = self.log.header.beacons.get(usize::from(beacon.0));
                let search = SearchOverview {
                    name: name.clone(),
                    truth: beacon.map_or_else(Vec::new, |beacon| way(beacon, &self.log.events)),
                    ..SearchOverview::default()
                };
                self.overview.searches.push(search);
                self.believe(index, *time, beacon);
            }
            Event::Received { drone, reception, .. } => self.receive(index, *drone, reception),
            Event::Sent { time, drone, to, .. } => self.send(*drone, *time, *to),
            Event::PhaseChanged { time, phase: Phase::Measuring(_) } => self.arrive(*time),
            Event::BeaconFinished { fix, .. } => {
                let mut searches = self.overview.searches.iter_mut();
                if let Some(search) = searches.rfind(|search| search.name == fix.name) {
                    search.outcome = Some(fix.outcome.to_string());
                }
            }
            _ => {}
        }
    }

    /// Adds what is believed after an event, and returns the search.
    fn believe(&mut self, index: usize, time: f64, beacon: Option<&LoggedBeacon>) {
        let Some(step) = self.moments.get_mut(&index) else { return };
        let Some(search) = self.overview.searches.get_mut(step.search) else { return };
        let truth = beacon.and_then(|beacon| beacon.place_at(time));
        search.beliefs.push(Believed {
            time,
            steps: step.steps,
            estimate: step.estimate,
            ellipse_95: step.estimate.ellipse(0.95),
            error_m: truth.map(|truth| (step.estimate.mean - truth).norm()),
            cloud: std::mem::take(&mut step.cloud),
        });
    }

    fn receive(&mut self, index: usize, drone: usize, reception: &Reception) {
        let beacon = self.log.header.beacons.get(usize::from(reception.beacon.0));
        self.believe(index, reception.time, beacon);
        let step = self.moments.get(&index);
        let (used, nis) = match step.and_then(|step| step.step) {
            Some(TrackStep::Updated { correction, degrees_of_freedom }) => {
                let nis = correction.nis().map(|nis| (nis, degrees_of_freedom));
                (!correction.is_rejected(), nis)
            }
            _ => (false, None),
        };
        let bearing = reception.bearing.map(|bearing| bearing.angle);
        let kept = self.turns.get(&(drone, reception.beacon.0, reception.time.to_bits()));
        let turn = kept.map(|kept| Turn::new(&kept.sweep.as_sweep(), self.antenna, bearing));
        let place = reception.receiver.position;
        let received = Received {
            time: reception.time,
            receiver: drone,
            search: step.map(|step| step.search),
            place,
            level: reception.level,
            bearing: reception.bearing,
            modes: reception.modes,
            remark: reception.silence.map(|floor| {
                format!("nothing above the receiver's floor of {:.1} dBm", floor.rss_dbm)
            }),
            used,
            nis,
            turn,
        };
        self.flight(drone);
        self.overview.add(received);
        if let Some(flight) = self.flights.get_mut(drone) {
            *flight = Flight { at: Some(place), to: None };
        }
    }

    /// The flight of a drone; those that are new have a name, and begin where the log has them.
    fn flight(&mut self, drone: usize) -> Flight {
        while self.flights.len() <= drone {
            let home = self.log.header.homes.get(self.flights.len()).copied();
            self.flights.push(Flight { at: home, to: None });
            let name = format!("drone {}", self.flights.len());
            let path = home.map(|place| Knot { time: 0.0, place }).into_iter().collect();
            self.overview.receivers.push(Receiver { name, path });
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

/// Where a beacon truly is: one place, or its way until its last reception in two hundred steps.
fn way(beacon: &LoggedBeacon, events: &[Event]) -> Vec<Knot> {
    const STEPS: u16 = 200;
    let knot = |time: f64| beacon.place_at(time).map(|place| Knot { time, place: place.push(0.0) });
    if beacon.course.is_none() {
        return knot(0.0).into_iter().collect();
    }
    let times = events.iter().filter_map(|event| match event {
        Event::Received { reception, .. } if reception.time.is_finite() => Some(reception.time),
        _ => None,
    });
    let until = times.fold(0.0, f64::max);
    (0..=STEPS).filter_map(|step| knot(until * f64::from(step) / f64::from(STEPS))).collect()
}
