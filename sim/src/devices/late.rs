use std::{collections::VecDeque, fmt};

use foxhunt_core::{BeaconId, PatternSource, Pose, Sample, Sweep, Unheard};

use nalgebra::Vector3;

use super::OnBoard;
use crate::truth::is_due;

/// A source of a drone whose sweeps come as much later as its
/// [`late_s`](crate::DroneConfig::late_s) says: what they hold, the time of their end included,
/// stays as it is. A turn that is begun before they came gives them up.
pub struct LateSource<S> {
    on_board: OnBoard,
    source: S,
    /// In seconds.
    delay: f64,
    /// Sweeps on the way, and when each comes.
    under_way: VecDeque<(f64, KeptSweep)>,
    lent: Option<KeptSweep>,
}

/// A sweep with what it holds.
#[derive(Clone, Debug)]
struct KeptSweep {
    beacon: BeaconId,
    time: f64,
    receiver: Pose,
    positions: u16,
    samples: Vec<Sample>,
    unheard: Vec<Unheard>,
    floor_dbm: Option<f64>,
    receiver_sigma_m: Option<Vector3<f64>>,
}

impl<S: fmt::Debug> fmt::Debug for LateSource<S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("LateSource")
            .field("source", &self.source)
            .field("delay", &self.delay)
            .field("under_way", &self.under_way.len())
            .finish_non_exhaustive()
    }
}

impl<S> LateSource<S> {
    pub(crate) fn new(on_board: OnBoard, source: S) -> Self {
        let delay = on_board.with(|drone, _| drone.failures.late_s);
        Self { on_board, source, delay, under_way: VecDeque::new(), lent: None }
    }
}

impl<S: PatternSource> PatternSource for LateSource<S> {
    type Error = S::Error;

    fn begin(&mut self, beacons: &[BeaconId]) -> Result<(), S::Error> {
        self.under_way.clear();
        self.source.begin(beacons)
    }

    fn poll(&mut self) -> Result<Option<Sweep<'_>>, S::Error> {
        if self.delay <= 0.0 {
            return self.source.poll();
        }
        let now = self.on_board.with(|_, now| now);
        while let Some(sweep) = self.source.poll()? {
            self.under_way.push_back((now + self.delay, KeptSweep::of(&sweep)));
        }
        let come = self.under_way.front().is_some_and(|(time, _)| is_due(*time, now));
        self.lent = come.then(|| self.under_way.pop_front()).flatten().map(|(_, sweep)| sweep);
        Ok(self.lent.as_ref().map(KeptSweep::lend))
    }
}

impl KeptSweep {
    fn of(sweep: &Sweep<'_>) -> Self {
        Self {
            beacon: sweep.beacon,
            time: sweep.time,
            receiver: sweep.receiver,
            positions: sweep.positions,
            samples: sweep.samples.to_vec(),
            unheard: sweep.unheard.to_vec(),
            floor_dbm: sweep.floor_dbm,
            receiver_sigma_m: sweep.receiver_sigma_m,
        }
    }

    fn lend(&self) -> Sweep<'_> {
        Sweep {
            beacon: self.beacon,
            time: self.time,
            receiver: self.receiver,
            positions: self.positions,
            samples: &self.samples,
            unheard: &self.unheard,
            floor_dbm: self.floor_dbm,
            receiver_sigma_m: self.receiver_sigma_m,
        }
    }
}
