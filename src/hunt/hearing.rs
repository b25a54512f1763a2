//! How what the drones heard is taken in.

use foxhunt_core::{
    BeaconId, BearingExtractor, Correction, Estimate, Estimator, EstimatorError, FormationPlanner,
    NoBearing, Observation, ObservationError, Reception, Sweep,
};
use foxhunt_filters::consistency::NisHealth;
use foxhunt_formation::Phase;
use nalgebra::Vector3;

use super::{Event, Heard, Hunt, search::Quarry};

impl<X, P, F, E, const N: usize, const M: usize> Hunt<X, P, F, E, N, M>
where
    X: BearingExtractor,
    P: FormationPlanner,
    F: FnMut(&Estimate<2>) -> Result<E, EstimatorError>,
    E: Estimator<N, M>,
    Observation<M>: for<'a> TryFrom<&'a Reception, Error = ObservationError>,
{
    /// Takes a drone's sweep. One that cannot be used is an event, never an error; one that comes
    /// late, when it is no longer awaited, is used as long as its beacon is still searched for.
    pub fn sweep(&mut self, time: f64, drone: usize, sweep: &Sweep<'_>) {
        if !self.is_searched(sweep.beacon) {
            self.note_delivery(time, drone, sweep.beacon, sweep.time);
            return;
        }
        match self.read(sweep) {
            Ok((reception, lack)) => self.hear(time, drone, &reception, lack),
            Err(reason) => self.heard_none(time, drone, sweep.beacon, sweep.time, reason),
        }
    }

    /// What the hunt's extractor reads in a sweep, or why it is of no use; for drones that send
    /// [receptions](Self::reception) rather than sweeps.
    ///
    /// # Errors
    ///
    /// The reason in words, as it is logged.
    pub fn extract(&self, sweep: &Sweep<'_>) -> Result<Reception, String> {
        self.read(sweep).map(|(reception, _)| reception)
    }

    /// The same, and why there is no bearing.
    fn read(&self, sweep: &Sweep<'_>) -> Result<(Reception, Option<NoBearing>), String> {
        if !(sweep.time.is_finite() && sweep.receiver.is_finite()) {
            return Err(format!(
                "its end, {} s, or {:?} is not finite",
                sweep.time, sweep.receiver
            ));
        }
        let reading = self.extractor.extract(sweep).map_err(|error| error.to_string())?;
        Ok((Reception::new(sweep, &reading), reading.bearing.err()))
    }

    /// Takes what a drone heard of a beacon in a turn, extracted where it was heard. It is taken
    /// in once: the same drone's reception of the same beacon at the same time, to the bit, makes
    /// no difference, however often it comes. One that cannot be used is an event.
    pub fn reception(&mut self, time: f64, drone: usize, reception: &Reception) {
        self.hear(time, drone, reception, None);
    }

    fn hear(&mut self, time: f64, drone: usize, reception: &Reception, lack: Option<NoBearing>) {
        let beacon = reception.beacon;
        if self.has_taken(drone, reception) {
            return;
        }
        let Some(in_time) = self.note_delivery(time, drone, beacon, reception.time) else { return };
        let listening = matches!(self.phases.phase(), Phase::Measuring(_));
        let index = usize::from(beacon.0);
        let Some(search) = self.beacons.get_mut(index).and_then(Quarry::search_mut) else { return };
        if !(reception.time.is_finite() && reception.receiver.is_finite()) {
            let Reception { time: ended, receiver, .. } = reception;
            let reason = format!("its end, {ended} s, or {receiver:?} is not finite");
            return self.outbox.tell(Event::Refused { time, drone, reason });
        }
        // What no observation can be made of, a NaN from another computer, must not stand in the log:
        // it could not be read back.
        if let Err(error) = Observation::<2>::try_from(reception) {
            return self.outbox.tell(Event::Refused { time, drone, reason: error.to_string() });
        }
        let mut reception = *reception;
        let assumed = self.config.receiver_sigma_m.map(Vector3::repeat);
        reception.receiver_sigma_m = reception.receiver_sigma_m.or(assumed);
        self.taken.insert((drone, beacon, reception.time.to_bits()));
        let first_position = search.measured == 0;
        self.outbox.tell(Event::Received { time, drone, first_position, reception });
        let reason = match search.track.hear(&reception, first_position) {
            Ok(Heard::Corrected(correction)) => {
                // A late one tells of the place where it was made, and not of this position.
                let counts = in_time && listening && correction != Correction::Empty;
                search.heard += u32::from(counts);
                let estimate = search.track.position();
                self.outbox.tell(Event::Corrected { time, drone, correction, estimate });
                if let Some(NisHealth::Diverged { average, interval }) = search.track.alarm() {
                    let average_nis = average;
                    let event = Event::FilterDiverged { time, beacon, average_nis, interval };
                    self.outbox.tell(event);
                }
                self.planner.hear(&reception);
                return;
            }
            Ok(Heard::Discarded) => {
                lack.map_or_else(|| "it has no bearing".to_owned(), |lack| lack.to_string())
            }
            Err(error) => error.to_string(),
        };
        self.outbox.tell(Event::Refused { time, drone, reason });
    }

    /// Takes note that a drone's turn, which ended at `ended`, told nothing of a beacon.
    pub fn heard_none(
        &mut self,
        time: f64,
        drone: usize,
        beacon: BeaconId,
        ended: f64,
        reason: String,
    ) {
        let known = self.note_delivery(time, drone, beacon, ended).is_some();
        if known && self.is_searched(beacon) {
            self.outbox.tell(Event::Refused { time, drone, reason });
        }
    }

    /// Whether a drone's reception was taken in before: the same beacon at the same time, to the
    /// bit.
    #[must_use]
    pub fn has_taken(&self, drone: usize, reception: &Reception) -> bool {
        self.taken.contains(&(drone, reception.beacon, reception.time.to_bits()))
    }

    /// Whether a beacon's search has not begun, so that what is heard of it is of no use yet.
    #[must_use]
    pub fn is_yet_to_come(&self, beacon: BeaconId) -> bool {
        let quarry = self.beacons.get(usize::from(beacon.0));
        quarry.is_some_and(|quarry| !quarry.is_done() && quarry.search().is_none())
    }

    fn is_searched(&self, beacon: BeaconId) -> bool {
        self.beacons.get(usize::from(beacon.0)).is_some_and(|quarry| quarry.search().is_some())
    }

    fn note_delivery(
        &mut self,
        time: f64,
        drone: usize,
        beacon: BeaconId,
        ended: f64,
    ) -> Option<bool> {
        self.flight.as_mut()?.delivered(time, drone, beacon, ended)
    }
}
