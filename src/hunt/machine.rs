use std::collections::VecDeque;

use foxhunt_core::{
    BeaconId, BearingExtractor, BeliefOf, Correction, Estimate, Estimator, EstimatorError,
    FormationPlanner, Observation, ObservationError, Outcome, Reception, Station, Sweep,
};
use foxhunt_filters::consistency::NisHealth;
use foxhunt_formation::{Phase, PhaseError, Phases, Signal};
use nalgebra::{Vector2, Vector3};

use super::{
    Command, Event, Fix, Heard, HuntConfig, HuntError, Search, Track, TrackConfig, cloud::cloud,
};

/// A hunt for one beacon after the other with a formation of drones; where turns are
/// [shared](HuntConfig::shared_turns), those that have not had their turn yet are listened for all
/// the same.
///
/// It does no I/O and reads no clock: [`start`](Self::start), [`advance`](Self::advance) and
/// [`sweep`](Self::sweep) take what happened, [`poll_command`](Self::poll_command) and
/// [`poll_event`](Self::poll_event) give what is to be done and what is to be logged. So the
/// same code runs simulated, replayed and flown; `foxhunt::hunt::drive` moves data between it and
/// devices. Each part is any implementor of its trait, `Box<dyn …>` included; `estimators` makes
/// an estimator for a beacon from its prior.
///
/// A drone that delivers nothing delays each formation position by its time-out and never stops
/// the hunt.
#[derive(Debug)]
pub struct Hunt<X, P, F, E, const N: usize, const M: usize> {
    extractor: X,
    planner: P,
    estimators: F,
    config: HuntConfig,
    track_config: TrackConfig,
    beacons: Vec<String>,
    stations: Vec<Station>,
    phases: Phases,
    since: f64,
    current: u16,
    /// One for each beacon; none where it has not begun or is over.
    searches: Vec<Option<Search<E, N, M>>>,
    /// Whose sweeps each drone owes.
    awaited: Vec<Vec<BeaconId>>,
    /// How often the present position was measured without hearing the current beacon.
    attempts: u32,
    fixes: Vec<Fix>,
    commands: VecDeque<Command>,
    events: VecDeque<Event>,
    /// What failed since the last change of phase, so that one fault makes one event.
    failures: Vec<(Option<usize>, String)>,
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
    /// When there is no beacon, or a field of the configuration is not positive.
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
        let searches = beacons.iter().map(|_| None).collect();
        Ok(Self {
            extractor,
            planner,
            estimators,
            config,
            track_config,
            beacons,
            stations: Vec::new(),
            phases: Phases::default(),
            since: 0.0,
            current: 0,
            searches,
            awaited: Vec::new(),
            attempts: 0,
            fixes: Vec::new(),
            commands: VecDeque::new(),
            events: VecDeque::new(),
            failures: Vec::new(),
        })
    }

    /// Begins with the first beacon from where the drones stand.
    ///
    /// # Errors
    ///
    /// When there is no drone, the hunt has begun before (it goes on as it was), or there is no
    /// plan or estimator.
    pub fn start(&mut self, time: f64, stations: Vec<Station>) -> Result<(), HuntError> {
        if stations.is_empty() {
            return Err(HuntError::Nothing { missing: "drone" });
        }
        let phase = self.phases.phase();
        if phase != Phase::Idle {
            return Err(PhaseError { phase, signal: Signal::Begin }.into());
        }
        self.awaited = vec![Vec::new(); stations.len()];
        self.stations = stations;
        self.begin_beacon(time)
    }

    /// Lets time pass: drones arrive, and those that deliver nothing are given up.
    /// [`stations_mut`](Self::stations_mut) holds where the drones are.
    ///
    /// # Errors
    ///
    /// When there is no plan, or no estimator for the next beacon.
    pub fn advance(&mut self, time: f64) -> Result<(), HuntError> {
        match self.phases.phase() {
            Phase::Start | Phase::Moving(_) => {
                let near = |s: &Station| {
                    (s.goal.position - s.pose.position).norm() <= self.config.arrival_tolerance_m
                };
                if self.stations.iter().all(near) || time - self.since >= self.config.move_timeout_s
                {
                    self.signal(time, Signal::Arrived)?;
                    self.attempts = 0;
                    self.listen(time);
                }
                Ok(())
            }
            Phase::Measuring(_) => {
                let waited_s = time - self.since;
                let asked = u32::try_from(self.asked().count()).unwrap_or(u32::MAX);
                if waited_s >= self.config.turn_timeout_s * f64::from(asked) {
                    for (drone, owed) in self.awaited.iter_mut().enumerate() {
                        if !std::mem::take(owed).is_empty() {
                            self.events.push_back(Event::Missing { time, drone, waited_s });
                        }
                    }
                }
                let all_in = self.awaited.iter().all(Vec::is_empty);
                if all_in { self.position_done(time) } else { Ok(()) }
            }
            Phase::Idle | Phase::Finished(_) => Ok(()),
        }
    }

    /// Takes a drone's sweep. One that cannot be used is an event, never an error; one that comes
    /// late, when it is no longer awaited, is used as long as its beacon is still searched for.
    pub fn sweep(&mut self, time: f64, drone: usize, sweep: &Sweep<'_>) {
        let Some(awaited) = self.awaited.get_mut(drone) else { return };
        let search = self.searches.get_mut(usize::from(sweep.beacon.0));
        let Some(search) = search.and_then(Option::as_mut) else { return };
        if matches!(self.phases.phase(), Phase::Measuring(_)) {
            awaited.retain(|owed| *owed != sweep.beacon);
        }
        if !(sweep.time.is_finite() && sweep.receiver.is_finite()) {
            let reason =
                format!("its end, {} s, or {:?} is not finite", sweep.time, sweep.receiver);
            return self.events.push_back(Event::Refused { time, drone, reason });
        }
        let reading = match self.extractor.extract(sweep) {
            Ok(reading) => reading,
            Err(error) => {
                let reason = error.to_string();
                return self.events.push_back(Event::Refused { time, drone, reason });
            }
        };
        let receiver_sigma_m = self.config.receiver_sigma_m.map(Vector3::repeat);
        let reception = Reception { receiver_sigma_m, ..Reception::new(sweep, &reading) };
        let first_position = search.measured == 0;
        self.events.push_back(Event::Received { time, drone, first_position, reception });
        let reason = match search.track.hear(&reception, first_position) {
            Ok(Heard::Corrected(correction)) => {
                search.heard += u32::from(correction != Correction::Empty);
                let estimate = search.track.position();
                self.events.push_back(Event::Corrected { time, drone, correction, estimate });
                if let Some(NisHealth::Diverged { average, interval }) = search.track.alarm() {
                    let (beacon, average_nis) = (sweep.beacon, average);
                    let event = Event::FilterDiverged { time, beacon, average_nis, interval };
                    self.events.push_back(event);
                }
                return;
            }
            Ok(Heard::Discarded) => {
                reading.bearing.err().map_or_else(String::new, |error| error.to_string())
            }
            Err(error) => error.to_string(),
        };
        self.events.push_back(Event::Refused { time, drone, reason });
    }

    /// Notes that a device failed; the hunt goes on. The same failure is one event in each phase.
    pub fn device_failed(&mut self, time: f64, drone: Option<usize>, reason: String) {
        if !self.failures.iter().any(|known| known.0 == drone && known.1 == reason) {
            self.failures.push((drone, reason.clone()));
            self.events.push_back(Event::DeviceFailed { time, drone, reason });
        }
    }

    /// The next thing to be done, each once.
    pub fn poll_command(&mut self) -> Option<Command> {
        self.commands.pop_front()
    }

    /// The next thing to be logged, each once, in the order in which it happened.
    pub fn poll_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// Whether a sweep of this drone is waited for.
    #[must_use]
    pub fn awaits(&self, drone: usize) -> bool {
        self.awaited.get(drone).is_some_and(|owed| !owed.is_empty())
    }

    /// Where the drones are and shall go.
    #[must_use]
    pub fn stations(&self) -> &[Station] {
        &self.stations
    }

    /// The same, to fill in where the drones are.
    pub fn stations_mut(&mut self) -> &mut [Station] {
        &mut self.stations
    }

    /// What the formation is doing.
    #[must_use]
    pub fn phase(&self) -> Phase {
        self.phases.phase()
    }

    /// Whether every beacon is done.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.fixes.len() == self.beacons.len()
    }

    /// What was found so far, in the order of the beacons.
    #[must_use]
    pub fn fixes(&self) -> &[Fix] {
        &self.fixes
    }

    /// What is believed of the beacon that is searched for now.
    pub fn estimate(&self) -> Option<Estimate<N>> {
        let search = self.searches.get(usize::from(self.current))?.as_ref()?;
        Some(search.track.estimator().estimate())
    }

    /// Whom a turn listens for: the beacon that is searched for, and those to come where turns are
    /// shared.
    fn asked(&self) -> impl Iterator<Item = BeaconId> + use<X, P, F, E, N, M> {
        let count = u16::try_from(self.beacons.len()).unwrap_or(u16::MAX);
        let end = if self.config.shared_turns { count } else { self.current.saturating_add(1) };
        (self.current..end).map(BeaconId)
    }

    fn begin_beacon(&mut self, time: f64) -> Result<(), HuntError> {
        let centre = self.config.prior_centre_m.map(Vector2::from);
        let centre = centre.unwrap_or_else(|| centroid(&self.stations));
        let prior = Estimate::isotropic(centre, self.config.prior_sigma_m);
        let mut begun = Vec::new();
        for beacon in self.asked() {
            let index = usize::from(beacon.0);
            if self.searches[index].is_none() {
                let name = self.beacons[index].clone();
                let estimator = (self.estimators)(&prior)
                    .map_err(|source| HuntError::Estimator { beacon: name.clone(), source })?;
                let track = Track::new(estimator, self.track_config);
                begun.push((beacon, name, Search { track, measured: 0, heard: 0 }));
            }
        }
        let current = usize::from(self.current);
        match &self.searches[current] {
            Some(search) if search.track.steps() > 0 => {
                let belief = BeliefOf(search.track.estimator());
                self.planner.resume(&belief, &mut self.stations)
            }
            _ => self.planner.begin(&mut self.stations),
        }
        .map_err(|source| HuntError::Plan { beacon: self.beacons[current].clone(), source })?;
        for (beacon, name, search) in begun {
            self.searches[usize::from(beacon.0)] = Some(search);
            self.events.push_back(Event::BeaconStarted { time, beacon, name, prior });
        }
        self.signal(time, Signal::Begin)?;
        self.go(time);
        Ok(())
    }

    fn signal(&mut self, time: f64, signal: Signal) -> Result<(), HuntError> {
        let phase = self.phases.signal(signal)?;
        self.since = time;
        self.failures.clear();
        self.events.push_back(Event::PhaseChanged { time, phase });
        Ok(())
    }

    fn go(&mut self, time: f64) {
        let goals = self.stations.iter().map(|s| s.goal.position).collect();
        self.events.push_back(Event::GoalsSet { time, goals });
        let go = |(drone, s): (usize, &Station)| Command::GoTo { drone, goal: s.goal };
        self.commands.extend(self.stations.iter().enumerate().map(go));
    }

    fn listen(&mut self, time: f64) {
        self.since = time;
        let beacons: Vec<BeaconId> = self.asked().collect();
        for (drone, owed) in self.awaited.iter_mut().enumerate() {
            owed.clone_from(&beacons);
            self.commands.push_back(Command::Listen { drone, beacons: beacons.clone() });
        }
    }

    /// Every drone of the present formation position was heard or given up.
    fn position_done(&mut self, time: f64) -> Result<(), HuntError> {
        let current = usize::from(self.current);
        let Some(search) = &self.searches[current] else { return Ok(()) };
        let (heard, before) = (search.heard > 0, search.measured > 0);
        if !heard {
            // The planner would take an estimate that did not move for one that has settled.
            self.attempts += 1;
            if self.attempts < self.config.attempts {
                self.listen(time);
                return Ok(());
            }
        }
        for search in self.searches.iter_mut().flatten() {
            search.measured += u32::from(std::mem::take(&mut search.heard) > 0);
        }
        if !heard {
            let outcome = if before { Outcome::SignalLost } else { Outcome::NothingHeard };
            self.signal(time, Signal::GivenUp(outcome))?;
            return self.finish_beacon(time, outcome);
        }
        let Some(search) = &self.searches[current] else { return Ok(()) };
        let decision =
            self.planner.plan(&BeliefOf(search.track.estimator()), &mut self.stations).map_err(
                |source| HuntError::Plan { beacon: self.beacons[current].clone(), source },
            )?;
        self.signal(time, Signal::Decided(decision))?;
        match self.phases.phase() {
            Phase::Finished(outcome) => self.finish_beacon(time, outcome),
            _ => {
                self.go(time);
                Ok(())
            }
        }
    }

    fn finish_beacon(&mut self, time: f64, outcome: Outcome) -> Result<(), HuntError> {
        let current = usize::from(self.current);
        let Some(search) = self.searches[current].take() else { return Ok(()) };
        let fix = Fix {
            beacon: BeaconId(self.current),
            name: self.beacons[current].clone(),
            estimate: search.track.position(),
            steps: search.track.steps(),
            formation_positions: search.measured,
            outcome,
        };
        let belief = BeliefOf(search.track.estimator());
        if let Some(places) = cloud(&belief) {
            self.events.push_back(Event::Cloud { time, beacon: fix.beacon, places });
        }
        self.events.push_back(Event::BeaconFinished { time, fix: fix.clone() });
        self.fixes.push(fix);
        if self.is_finished() {
            return Ok(());
        }
        self.current += 1;
        self.begin_beacon(time)
    }
}

fn centroid(stations: &[Station]) -> Vector2<f64> {
    let count = u32::try_from(stations.len()).unwrap_or(u32::MAX).max(1);
    stations.iter().map(|s| s.pose.position.xy()).sum::<Vector2<f64>>() / f64::from(count)
}
