use std::collections::BTreeSet;

use foxhunt_core::{
    BeaconId, BearingExtractor, Estimate, Estimator, EstimatorError, FormationPlanner, Observation,
    ObservationError, Pose, Reception, Station,
};
use foxhunt_formation::{Phase, PhaseError, Phases, Signal};
use nalgebra::Vector2;

use super::{
    Command, Event, Fix, Flight, HuntConfig, HuntError, Outbox, TrackConfig, search::Quarry,
};

/// A hunt for one beacon after the other with a formation of drones; where turns are
/// [shared](HuntConfig::shared_turns), those that have not had their turn yet are listened for all
/// the same, and the planner may weigh them.
///
/// It does no I/O and reads no clock: [`start`](Self::start), [`located`](Self::located),
/// [`advance`](Self::advance) and [`sweep`](Self::sweep) take what happened, or
/// [`reception`](Self::reception) where the drones make their own of their sweeps;
/// [`poll_command`](Self::poll_command) and [`poll_event`](Self::poll_event) give what is to be done
/// and what is to be logged. So the same code runs simulated, replayed and flown;
/// `foxhunt::hunt::drive` moves data between it and devices. Each part is any implementor of its
/// trait, `Box<dyn …>` included; `estimators` makes an estimator for a beacon from its prior.
///
/// A drone that delivers nothing, does not move or is not seen drops out of the formation and never
/// stops the hunt; one that comes back is taken in again. A hunt that was broken off
/// [goes on](Self::resume) from its log.
#[derive(Debug)]
pub struct Hunt<X, P, F, E, const N: usize, const M: usize> {
    pub(super) extractor: X,
    pub(super) planner: P,
    pub(super) estimators: F,
    pub(super) config: HuntConfig,
    pub(super) track_config: TrackConfig,
    pub(super) beacons: Vec<Quarry<E, N, M>>,
    /// Absent until the hunt has begun.
    pub(super) flight: Option<Flight>,
    pub(super) phases: Phases,
    pub(super) since: f64,
    /// The beacon that is searched for.
    pub(super) current: usize,
    /// How often the present position was measured without hearing anything.
    pub(super) attempts: u32,
    pub(super) fixes: Vec<Fix>,
    pub(super) outbox: Outbox,
    /// Which receptions were taken in: drone, beacon, and the bits of the time.
    pub(super) taken: BTreeSet<(usize, BeaconId, u64)>,
}

impl<X, P, F, E, const N: usize, const M: usize> Hunt<X, P, F, E, N, M>
where
    X: BearingExtractor,
    P: FormationPlanner,
    F: FnMut(&Estimate<2>) -> Result<E, EstimatorError>,
    E: Estimator<N, M>,
    Observation<M>: for<'a> TryFrom<&'a Reception, Error = ObservationError>,
{
    /// A hunt for `beacons`, in their order, that has not begun.
    ///
    /// # Errors
    ///
    /// When there is no beacon, or a field of the configuration is out of its range.
    pub fn new(
        extractor: X,
        planner: P,
        estimators: F,
        beacons: Vec<String>,
        config: HuntConfig,
        track_config: TrackConfig,
    ) -> Result<Self, HuntError> {
        config.check()?;
        if beacons.is_empty() || u16::try_from(beacons.len()).is_err() {
            return Err(HuntError::Nothing { missing: "beacon" });
        }
        Ok(Self {
            extractor,
            planner,
            estimators,
            config,
            track_config,
            beacons: beacons.into_iter().map(Quarry::waiting).collect(),
            flight: None,
            phases: Phases::default(),
            since: 0.0,
            current: 0,
            attempts: 0,
            fixes: Vec::new(),
            outbox: Outbox::default(),
            taken: BTreeSet::new(),
        })
    }

    /// Begins with the first beacon from where the drones stand, which is their home.
    ///
    /// # Errors
    ///
    /// When there is no drone, the hunt has begun before (it goes on as it was), two drones are
    /// nearer to each other than the separation, one is where it may not fly, or there is no plan
    /// or estimator.
    pub fn start(&mut self, time: f64, stations: Vec<Station>) -> Result<(), HuntError> {
        if stations.is_empty() {
            return Err(HuntError::Nothing { missing: "drone" });
        }
        let phase = self.phases.phase();
        if phase != Phase::Idle {
            return Err(PhaseError { phase, signal: Signal::Begin }.into());
        }
        self.flight = Some(Flight::new(&self.config, time, stations)?);
        self.begin_beacon(time).inspect_err(|_| self.reset())
    }

    /// As if it had not begun.
    pub(super) fn reset(&mut self) {
        (self.flight, self.outbox) = (None, Outbox::default());
        (self.phases, self.since, self.current) = (Phases::default(), 0.0, 0);
        self.fixes.clear();
        self.taken.clear();
        self.beacons.iter_mut().for_each(Quarry::reset);
    }

    /// Takes note of where a drone is; to be told as often as it is known. One that is not located
    /// for a while is lost.
    pub fn located(&mut self, time: f64, drone: usize, pose: Pose) {
        if let Some(flight) = &mut self.flight {
            flight.located(time, drone, pose);
        }
    }

    /// Lets time pass: drones fly on, arrive and drop out, and those that deliver nothing are given
    /// up.
    ///
    /// # Errors
    ///
    /// When there is no estimator for the next beacon.
    pub fn advance(&mut self, time: f64) -> Result<(), HuntError> {
        let all_found = self.all_found();
        let asked = f64::from(u32::try_from(self.asked().len()).unwrap_or(u32::MAX));
        let Some(flight) = &mut self.flight else { return Ok(()) };
        flight.pass(time, &mut self.outbox);
        if !all_found && let Some(reason) = flight.must_return(time) {
            return self.recall(time, reason);
        }
        self.stop_by_budget(time)?;
        let Some(flight) = &mut self.flight else { return Ok(()) };
        let waited_s = time - self.since;
        match self.phases.phase() {
            Phase::Start | Phase::Moving(_) => {
                if flight.is_formed() || waited_s >= self.config.move_timeout_s {
                    self.signal(time, Signal::Arrived)?;
                    self.attempts = 0;
                    self.listen(time);
                }
                Ok(())
            }
            Phase::Measuring(_) => {
                if waited_s >= self.config.turn_timeout_s * asked {
                    flight.give_up_turns(time, waited_s, &mut self.outbox);
                }
                if flight.is_waiting() { Ok(()) } else { self.position_done(time) }
            }
            Phase::Idle | Phase::Finished(_) => Ok(()),
        }
    }

    /// Notes that a device failed; the hunt goes on. The same failure is one event in each phase.
    pub fn device_failed(&mut self, time: f64, drone: Option<usize>, reason: String) {
        self.outbox.failed(time, drone, reason);
    }

    /// Notes that a drone did not take its order to fly somewhere; it is told again.
    pub fn not_sent(&mut self, time: f64, drone: usize, reason: String) {
        if let Some(flight) = &mut self.flight {
            flight.not_sent(drone);
        }
        self.device_failed(time, Some(drone), reason);
    }

    /// Notes that a drone did not take its order to land; it is told again for a while.
    pub fn not_landed(&mut self, time: f64, drone: usize, reason: String) {
        if let Some(flight) = &mut self.flight {
            flight.not_landed(time, drone);
        }
        self.device_failed(time, Some(drone), reason);
    }

    /// The next thing to be done, each once.
    pub fn poll_command(&mut self) -> Option<Command> {
        self.outbox.commands.pop_front()
    }

    /// The next thing to be logged, each once, in the order in which it happened.
    pub fn poll_event(&mut self) -> Option<Event> {
        self.outbox.events.pop_front()
    }

    /// Whether a drone still owes a sweep, awaited or late.
    #[must_use]
    pub fn awaits(&self, drone: usize) -> bool {
        self.flight.as_ref().is_some_and(|flight| flight.owes(drone))
    }

    /// Of which beacons a drone still owes a sweep.
    #[must_use]
    pub fn owed_by(&self, drone: usize) -> &[BeaconId] {
        self.flight.as_ref().map_or(&[], |flight| flight.owed_by(drone))
    }

    /// Where the drones are and shall go; nobody before the start.
    #[must_use]
    pub fn stations(&self) -> &[Station] {
        self.flight.as_ref().map_or(&[], Flight::stations)
    }

    /// What the formation is doing.
    #[must_use]
    pub fn phase(&self) -> Phase {
        self.phases.phase()
    }

    /// Whether every beacon is done, and the drones are home if they were to go there.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.all_found() && self.flight.as_ref().is_none_or(Flight::is_over)
    }

    /// What was found so far, in the order in which the searches ended.
    #[must_use]
    pub fn fixes(&self) -> &[Fix] {
        &self.fixes
    }

    /// How many beacons are to be found, those that are done included.
    #[must_use]
    pub fn beacon_count(&self) -> usize {
        self.beacons.len()
    }

    /// What is believed of the beacon that is searched for now.
    pub fn estimate(&self) -> Option<Estimate<N>> {
        Some(self.beacons.get(self.current)?.search()?.track.estimator().estimate())
    }

    /// What is believed of every beacon that is searched for, and was found of those that are done.
    pub fn believed(&self) -> Vec<Believed<'_>> {
        let mut told = Vec::new();
        for (index, quarry) in self.beacons.iter().enumerate() {
            let beacon = beacon_id(index);
            let fix = || self.fixes.iter().find(|fix| fix.beacon == beacon).map(|fix| fix.estimate);
            let estimate = quarry.search().map(|search| search.track.position()).or_else(fix);
            let name = &quarry.name;
            told.extend(estimate.map(|estimate| Believed { beacon, name, estimate }));
        }
        told
    }

    /// Whether there is a fix of every beacon.
    pub(super) fn all_found(&self) -> bool {
        self.fixes.len() == self.beacons.len()
    }

    /// Whom a turn listens for: the beacon that is searched for, and all that are not done where
    /// turns are shared.
    pub(super) fn asked(&self) -> Vec<BeaconId> {
        let shared = self.config.shared_turns;
        let open = |(index, quarry): &(usize, &Quarry<E, N, M>)| {
            (shared || *index == self.current) && !quarry.is_done()
        };
        let asked = self.beacons.iter().enumerate().filter(open);
        asked.map(|(index, _)| beacon_id(index)).collect()
    }

    pub(super) fn signal(&mut self, time: f64, signal: Signal) -> Result<(), HuntError> {
        let phase = self.phases.signal(signal)?;
        self.since = time;
        self.outbox.tell(Event::PhaseChanged { time, phase });
        Ok(())
    }

    /// Has every drone that is in the air turn its antenna.
    pub(super) fn listen(&mut self, time: f64) {
        self.since = time;
        let beacons = self.asked();
        if let Some(flight) = &mut self.flight {
            flight.listen(time, &beacons, &mut self.outbox);
        }
    }

    /// What is believed of a beacon before anything was heard of it.
    pub(super) fn prior(&self) -> Estimate<2> {
        let centre = self.config.prior_centre_m.map(Vector2::from);
        let centre = centre.unwrap_or_else(|| centroid(self.stations()));
        Estimate::isotropic(centre, self.config.prior_sigma_m)
    }
}

/// What is believed of one of a hunt's beacons.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Believed<'a> {
    /// Which beacon.
    pub beacon: BeaconId,
    /// Its name.
    pub name: &'a str,
    /// Where it is believed to be.
    pub estimate: Estimate<2>,
}

/// Beacons are counted in sixteen bits, which `new` and `take_in` see to.
pub(super) fn beacon_id(index: usize) -> BeaconId {
    BeaconId(u16::try_from(index).unwrap_or(u16::MAX))
}

fn centroid(stations: &[Station]) -> Vector2<f64> {
    let count = u32::try_from(stations.len()).unwrap_or(u32::MAX).max(1);
    stations.iter().map(|s| s.pose.position.xy()).sum::<Vector2<f64>>() / f64::from(count)
}
