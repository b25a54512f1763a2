use std::{collections::VecDeque, fmt};

use foxhunt_core::{BeaconId, OwnedSweep, PatternSource, Sweep};

use super::OnBoard;
use crate::truth::is_due;

/// A source of a drone whose sweeps come later by its
/// [`late_s`](crate::DroneConfig::late_s): what they hold, the time of their end included,
/// stays as it is. A turn that is begun before they came gives them up.
pub struct LateSource<S> {
    on_board: OnBoard,
    source: S,
    /// The delay in seconds.
    delay: f64,
    /// Sweeps on the way, and when each comes.
    under_way: VecDeque<(f64, OwnedSweep)>,
    lent: Option<OwnedSweep>,
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
            self.under_way.push_back((now + self.delay, OwnedSweep::from(&sweep)));
        }
        let come = self.under_way.front().is_some_and(|(time, _)| is_due(*time, now));
        self.lent = come.then(|| self.under_way.pop_front()).flatten().map(|(_, sweep)| sweep);
        Ok(self.lent.as_ref().map(OwnedSweep::as_sweep))
    }

    fn next_event(&self) -> Option<f64> {
        let comes = self.under_way.front().map_or(f64::INFINITY, |(time, _)| *time);
        Some(self.source.next_event()?.min(comes))
    }
}
